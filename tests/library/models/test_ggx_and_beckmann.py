"""Facets of GGX and Beckmann: albedos, masking, digits of narrow lobes, stand-ins."""

import pytest
import torch
from helpers.probes import albedo, few, held
from helpers.two_channels import D, number

from torchbrdf import (
    GGX,
    Beckmann,
    ConstantFresnel,
    Cosines,
    Dielectric,
    Perfect,
    TorranceSparrow,
    fixed,
    smith_separable,
)
from torchbrdf import testing as laws


@pytest.mark.parametrize(("build", "expected"), [(GGX, 0.688), (Beckmann, 0.943)])
def test_microfacet_albedo_at_normal_incidence(build, expected):
    assert albedo(build(alpha=held(0.5), fresnel=Perfect()), 1.0, 64) == pytest.approx(expected, abs=5e-4)


def test_separable_masking_is_darker():
    correlated, separable = (GGX(alpha=held(0.5), **m) for m in ({}, {"masking": smith_separable}))
    assert (separable(*few()) <= correlated(*few())).all()


@pytest.mark.parametrize("build", [GGX, Beckmann])
def test_narrow_lobes_keep_their_digits_in_float32(build):
    # the half vector from the vectors; from dot products alone the error is 1e-7/alpha^2
    generator = torch.Generator().manual_seed(0)
    normal, light, _ = laws.random_directions(3000, generator=generator, max_angle=1.0)
    mirror = 2 * (normal * light).sum(-1, keepdim=True) * normal - light
    view = torch.nn.functional.normalize(mirror + 0.02 * torch.randn(3000, 3, generator=generator), dim=-1)
    alpha = torch.tensor(0.015625)
    exact = build(alpha=fixed(alpha.double()), fresnel=Perfect())(
        *(torch.nn.functional.normalize(v.double(), dim=-1) for v in (normal, light, view))
    )
    brdf = build(alpha=fixed(alpha), fresnel=Perfect())
    products = [(a * b).sum(-1) for a, b in ((normal, light), (normal, view), (light, view))]
    values = {
        "tangent": brdf(normal, light, view, tangent=torch.linalg.cross(normal, normal.roll(1, -1))),
        "vectors": brdf(normal, light, view),
        "products": brdf.evaluate(Cosines.from_products(*products)),
    }
    errors = {name: float(((value - exact) / exact).abs().median()) for name, value in values.items()}
    assert max(errors["tangent"], errors["vectors"]) < 1e-5
    assert errors["products"] > 1e-4


def test_constant_reflectance_is_that_of_normal_incidence():
    up = torch.tensor([0.0, 0, 1], dtype=D)
    glass = Dielectric(eta=number(1.5))
    lobes = (GGX(alpha=number(0.3)), Beckmann(alpha=number(0.3)), TorranceSparrow(sigma=number(0.3), fresnel=glass))
    for lobe in lobes:
        flat = lobe.stand_ins()["Fresnel variation"][0].model
        assert isinstance(flat.fresnel, ConstantFresnel)
        torch.testing.assert_close(flat(up, up, up), lobe(up, up, up), rtol=1e-6, atol=0)
        side = torch.tensor([0.96, 0, 0.28], dtype=D)
        mirrored = torch.tensor([-0.96, 0, 0.28], dtype=D)
        assert (flat(up, side, mirrored) < 0.7 * lobe(up, side, mirrored)).all()
    assert "Fresnel variation" not in TorranceSparrow(fresnel=Perfect()).stand_ins()
