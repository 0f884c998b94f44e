"""What the sheet states of the rough diffuse and planetary models, by other forms and by integrals.

The golden values are in test_golden, glossy and layered models in test_layered_and_glossy.
"""

import copy
import math

import pytest
import torch
from numpy.polynomial.legendre import leggauss
from probes import COS, albedo, doubles, few, held
from scipy.integrate import quad
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
    Lambert,
    LambertSphere,
    LommelSeeliger,
    MaxCosinePhong,
    Minnaert,
    ModifiedPhong,
    Oriented,
    Schlick,
    TorranceSparrow,
    burley,
    eon_albedo_from_directional,
    eon_albedo_from_white_sky,
    fixed,
    lambert_sphere_fast,
    minnaert,
)
from torchbrdf.models.planetary import lambert_sphere_phase


def white_sky(brdf, nodes=40):
    x, w = leggauss(nodes)
    return sum(float(wi) * c * albedo(brdf, c, 24) for c, wi in zip((1 + x) / 2, w, strict=True))


@pytest.mark.parametrize("k", [0.5, 1.0, 1.7])
def test_minnaert_albedo(k):
    brdf = Minnaert(albedo=held(0.6), k=held(k))
    for c in COS:
        assert albedo(brdf, c, 96) == pytest.approx(0.6 * c ** (k - 1), rel=1e-4)
    if k == 1:
        assert_close(brdf(*few()), Lambert(albedo=held(0.6))(*few()))


def grained(**material):
    return Oriented(AshikhminShirley(**material), doubles([1.0, 0.0, 0.0]))


@pytest.mark.parametrize("r", [0.0, 0.4, 1.0])
def test_fon_and_eon_albedos(r):
    fon, eon = FujiiOrenNayar(albedo=held(0.8), roughness=held(r)), EON(albedo=held(0.8), roughness=held(r))
    white = EON(albedo=held(1.0), roughness=held(r))
    for c in COS:
        for brdf in (fon, eon):
            assert albedo(brdf, c) == pytest.approx(float(brdf.directional_albedo(doubles(c))), abs=1e-5)
        assert float(white.directional_albedo(doubles(c))) == pytest.approx(1.0, abs=1e-14)
        fitted = EON(albedo=held(1.0), roughness=held(r), exact=False)
        assert albedo(fitted, c) == pytest.approx(1.0, abs=5e-4)
    if r == 0:
        assert_close(eon(*few()), Lambert(albedo=held(0.8))(*few()))


@pytest.mark.parametrize("target", [0.1, 0.6, 0.99])
def test_eon_inversions(target):
    r = doubles(0.7)
    rho = eon_albedo_from_white_sky(doubles(target), roughness=r)
    brdf = EON(albedo=fixed(rho), roughness=fixed(r))
    assert float(brdf.average_albedo()) == pytest.approx(target, rel=1e-12)
    assert white_sky(brdf) == pytest.approx(target, rel=1e-4)
    for c in COS:
        rho = eon_albedo_from_directional(doubles(target), doubles(c), roughness=r)
        brdf = EON(albedo=fixed(rho), roughness=fixed(r))
        assert float(brdf.directional_albedo(doubles(c))) == pytest.approx(target, rel=1e-12)


def test_burley_gains_and_frostbite_does_not():
    material = {"albedo": held(1.0), "roughness": held(1.0)}
    assert albedo(Burley(**material), 0.05) == pytest.approx(1.46, abs=0.01)
    frostbite = [albedo(Burley(**material, renormalised=True), c) for c in (0.05, 0.3, 0.6, 1.0)]
    assert 0.68 < min(frostbite) < max(frostbite) < 0.98
    # within two degrees of grazing it does, a little
    assert albedo(Burley(**material, renormalised=True), 0.001) == pytest.approx(1.030, abs=1e-3)
    cosines = Cosines.of(*few())
    assert_close(burley(cosines, albedo=doubles(1.0), roughness=doubles(1.0)), Burley(**material)(*few()))


def test_lommel_seeliger_albedo():
    brdf = LommelSeeliger(albedo=held(0.7))
    for c in COS:
        assert albedo(brdf, c) == pytest.approx(float(brdf.directional_albedo(doubles(c))), rel=1e-8)


def test_lambert_sphere_phase():
    angle = torch.linspace(0, math.pi, 200, dtype=torch.float64)
    cosines = Cosines.from_products(torch.ones_like(angle), torch.ones_like(angle), -angle.cos())
    expected = 2 * (angle.sin() - angle * angle.cos()) / (3 * math.pi**2)
    assert_close(lambert_sphere_phase(cosines), expected, rtol=1e-12, atol=1e-15)
    mean = quad(
        lambda t: 2 * math.pi * math.sin(t) * 2 * (math.sin(t) - t * math.cos(t)) / (3 * math.pi**2), 0, math.pi
    )
    assert mean[0] == pytest.approx(1.0)
    # forward scattering is all cancellation in the printed form; psi^3/3 is what is left
    small = doubles(1e-3)
    near = Cosines.from_products(doubles(1.0), doubles(1.0), -small.cos())
    assert_close(lambert_sphere_phase(near), 2 / (3 * math.pi**2) * small**3 / 3, rtol=1e-6, atol=0)
    assert albedo(LambertSphere(albedo=held(1.0)), 0.5) < 1


@pytest.mark.parametrize(("rho", "expected"), [(0.5, 0.506), (0.8, 0.829), (1.0, 1.082)])
def test_lambert_sphere_fast_white_sky(rho, expected):
    # uniform cosines by quadrature; the fit gains energy at 1, as the sheet says
    x, w = (torch.from_numpy(a) for a in leggauss(48))
    mu, wm = (1 + x) / 2, w / 2
    phi, wp = math.pi * (1 + x) / 2, math.pi * w / 2
    i, r, p = torch.meshgrid(mu, mu, phi, indexing="ij")
    phase = i * r + ((1 - i * i) * (1 - r * r)).sqrt() * p.cos()
    f = lambert_sphere_fast(Cosines.from_products(i, r, phase), albedo=doubles(rho))[..., 0]
    total = 4 * (f * i * r * wm[:, None, None] * wm[:, None] * wp).sum()
    assert float(total) == pytest.approx(expected, abs=2e-3)


def test_hapke():
    smooth = Hapke(albedo=held(1.0), asymmetry=held(0.0), surge=held(0.0), surge_width=held(0.05))
    assert 0.96 < min(albedo(smooth, c) for c in COS) < max(albedo(smooth, c) for c in (0.02, *COS)) < 1.045
    # the surge at retro is B_0, and half of it at tan(g/2) = h
    surge = Hapke(albedo=held(1e-6), asymmetry=held(0.0), surge=held(0.8), surge_width=held(0.1))
    plain = Hapke(albedo=held(1e-6), asymmetry=held(0.0), surge=held(0.0), surge_width=held(0.1))
    normal = doubles([0.0, 0.0, 1.0])
    g = 2 * math.atan(0.1)
    tilted = doubles([math.sin(g), 0.0, math.cos(g)])
    for view, expected in ((normal, 1.8), (tilted, 1.4)):
        ratio = surge.components(normal, normal, view)["single"] / plain.components(normal, normal, view)["single"]
        assert float(ratio) == pytest.approx(expected, rel=1e-6)


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


def around(centre, radius, dtype=torch.float32):
    """400 unit vectors within `radius` [rad] of each of the given ones, at all distances down to a hundredth of it."""
    generator = torch.Generator().manual_seed(9)
    across = torch.randn(len(centre), 3, dtype=torch.float64, generator=generator)
    across = torch.nn.functional.normalize(across - (across * centre).sum(-1, keepdim=True) * centre, dim=-1)
    distance = radius * 10 ** (-2 * torch.rand(len(centre), 1, dtype=torch.float64, generator=generator))
    return torch.nn.functional.normalize(centre + distance * across, dim=-1).to(dtype)


@pytest.mark.parametrize("cos_light", [1.0, 0.5, 0.02, math.cos(math.radians(89.99))])
@pytest.mark.parametrize(
    ("brdf", "radius", "mirrored", "rtol"),
    [
        (Hapke(surge=fixed(0.8), surge_width=fixed(1e-4)), 1e-3, False, 2e-3),
        (Hapke(asymmetry=fixed(-0.999), surge=fixed(0.0)), 1e-2, False, 2e-4),
        (ModifiedPhong(diffuse=fixed(0.0), specular=fixed(0.3), exponent=fixed(1e5)), 1e-2, True, 2e-4),
        (MaxCosinePhong(diffuse=fixed(0.0), specular=fixed(0.3), exponent=fixed(1e5)), 1e-2, True, 2e-4),
    ],
    ids=["surge of 1e-4", "backward peak", "modified Phong", "maximum of cosines"],
)
def test_float32_digits_of_narrow_lobes(brdf, radius, mirrored, rtol, cos_light):
    # Of the angle to the lobe's axis a few roundings of a unit vector are unknown, 1e-7 of up to 1e-3 or 1e-2 rad, and
    # the lobe changes by its own size within a hundredth of that. A dot product knows the angle to 3e-4 rad.
    normal = torch.nn.functional.normalize(few(400).normal, dim=-1)
    tangent = torch.nn.functional.normalize(
        few(400).view - (few(400).view * normal).sum(-1, keepdim=True) * normal, dim=-1
    )
    light = cos_light * normal + math.sqrt(1 - cos_light**2) * tangent
    axis = 2 * cos_light * normal - light if mirrored else light
    directions = (normal.float(), light.float(), around(axis, radius))
    exact = copy.deepcopy(brdf).double()(*(torch.nn.functional.normalize(v.double(), dim=-1) for v in directions))
    got = copy.deepcopy(brdf).float()(*directions)
    lit = (exact > 0) & (got > 0)  # at 89.99 deg many of the views lie below the horizon
    error = ((got - exact) / exact)[lit].abs().max()
    assert lit.any()
    assert error < rtol + 2 * torch.finfo(torch.float32).eps / cos_light  # a cosine is known to a rounding of 1


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_surge_at_retro_reflection_is_all_of_it(dtype):
    # B = B_0 at g = 0 whatever h: twice the light of a surface without a surge, but for the multiple scattering
    normal, light, _ = few(100, 89.99)
    plain, surging = (Hapke(surge=fixed(s), surge_width=fixed(1e-4)).to(dtype) for s in (0.0, 1.0))
    single = [brdf.components(*(v.to(dtype) for v in (normal, light, light)))["single"] for brdf in (plain, surging)]
    assert_close(single[1], 2 * single[0], rtol=1e-6, atol=0)
