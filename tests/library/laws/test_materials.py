"""Materials of many models: their domains, one value per texel."""

import pytest
import torch
from helpers.probes import doubles, few
from torch.testing import assert_close

from torchbrdf import (
    EON,
    GGX,
    AshikhminShirley,
    Beckmann,
    Burley,
    Cosines,
    Coupled,
    FujiiOrenNayar,
    Hapke,
    Minnaert,
    ModifiedPhong,
    Oriented,
    Schlick,
    TorranceSparrow,
    burley,
    fixed,
    lambert_sphere_fast,
    minnaert,
)


def grained(**material):
    return Oriented(AshikhminShirley(**material), doubles([1.0, 0.0, 0.0]))


def test_functions_refuse_materials_outside_their_domain():
    cosines = Cosines.of(*few(2))
    with pytest.raises(ValueError, match=r"minnaert: k must lie in \[0, inf\)"):
        minnaert(cosines, albedo=doubles(0.5), k=doubles(-1.0))
    with pytest.raises(ValueError, match="burley: roughness must lie in"):
        burley(cosines, albedo=doubles(0.5), roughness=doubles(1.5))
    with pytest.raises(ValueError, match="lambert_sphere_fast: albedo"):
        lambert_sphere_fast(cosines, albedo=doubles(1.5))
    with pytest.raises(ValueError, match=r"GGX.alpha must lie in \(0.001, 1\)"):
        GGX(alpha=0.0)


def test_materials_per_texel():
    generator = torch.Generator().manual_seed(4)
    normal, light, view = few(6, 60.0)
    colour = torch.rand(6, 3, dtype=torch.float64, generator=generator)
    width = 0.1 + 0.8 * torch.rand(6, dtype=torch.float64, generator=generator)
    builds = [
        lambda c, w: GGX(alpha=fixed(w), fresnel=Schlick(f0=fixed(c))),
        lambda c, w: Beckmann(alpha=fixed(w), fresnel=Schlick(f0=fixed(c))),
        lambda c, w: TorranceSparrow(sigma=fixed(w), fresnel=Schlick(f0=fixed(c))),
        lambda c, w: EON(albedo=fixed(c), roughness=fixed(w)),
        lambda c, w: FujiiOrenNayar(albedo=fixed(c), roughness=fixed(w)),
        lambda c, w: Minnaert(albedo=fixed(c), k=fixed(w)),
        lambda c, w: ModifiedPhong(diffuse=fixed(c), specular=fixed(c), exponent=fixed(10 * w)),
        lambda c, w: Burley(albedo=fixed(c), roughness=fixed(w)),
        lambda c, w: Hapke(albedo=fixed(c), asymmetry=fixed(-w), surge=fixed(w), surge_width=fixed(w)),
        lambda c, w: grained(diffuse=fixed(c), specular=fixed(c), exponent_x=fixed(9 * w), exponent_y=fixed(w)),
        lambda c, w: Coupled(albedo=fixed(c), fresnel=Schlick(f0=fixed(c))),
    ]
    u = torch.rand(6, 2, dtype=torch.float64, generator=generator)
    for build in builds:
        got = build(colour, width)(normal, light, view)
        assert got.shape == (6, 3)
        loop = [build(colour[k], width[k])(normal[k], light[k], view[k]) for k in range(6)]
        assert_close(got, torch.stack(loop), rtol=1e-10, atol=0)
        sample = build(colour, width).sample(normal, view, u)
        assert sample.weight.shape == (6, 3)
        alone = [build(colour[k], width[k]).sample(normal[k], view[k], u[k]).light for k in range(6)]
        assert_close(sample.light, torch.stack(alone), rtol=1e-9, atol=1e-9)
