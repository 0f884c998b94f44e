"""Albedos, masking and digits of the glossy and layered models, by other forms and by integrals."""

import math

import pytest
import torch
from probes import COS, albedo, doubles, few, held
from scipy.integrate import quad
from torch.testing import assert_close

from torchbrdf import (
    GGX,
    AshikhminShirley,
    Beckmann,
    Cosines,
    Coupled,
    Dampened,
    Dielectric,
    MaxCosinePhong,
    Mirror,
    ModifiedPhong,
    OrenNayar,
    Oriented,
    Perfect,
    Schlick,
    TorranceSparrow,
    fixed,
    smith_separable,
    torrance_sparrow,
    trainable,
)
from torchbrdf import testing as laws


@pytest.mark.parametrize("exponent", [1.0, 20.0, 200.0])
def test_phong_normalisations(exponent):
    material = {"diffuse": held(0.0), "specular": held(0.6), "exponent": held(exponent)}
    modified, cosine = ModifiedPhong(**material), MaxCosinePhong(**material)
    assert albedo(modified, 1.0) == pytest.approx(0.6, rel=1e-6)
    for c in COS:
        assert albedo(cosine, c, 96) <= 0.6 + 1e-6
    if exponent == 200:
        assert albedo(modified, 0.3, 96) == pytest.approx(0.6 * 0.3, rel=0.05)  # dark at grazing, as k_s cos


@pytest.mark.parametrize("sigma", [0.3, 1.0])
def test_torrance_sparrow_conserves(sigma):
    brdf = TorranceSparrow(sigma=held(sigma))
    assert max(albedo(brdf, c, 128) for c in (0.02, *COS)) <= 1 + 1e-4


def test_torrance_sparrow_without_its_constant():
    brdf, plain = (TorranceSparrow(sigma=held(0.4), normalised=n) for n in (True, False))
    ratio = plain(*few()) / brdf(*few())
    norm = 2 * math.pi * quad(lambda t: math.exp(-t * t / 0.32) * math.sin(t), 0, math.pi / 2, epsabs=1e-14)[0]
    assert_close(ratio, torch.full_like(ratio, 4 * norm), rtol=1e-10, atol=0)


def test_torrance_sparrow_function():
    cosines = Cosines.of(*few())
    assert_close(torrance_sparrow(cosines, sigma=doubles(0.4)), TorranceSparrow(sigma=held(0.4))(*few()))
    with pytest.raises(ValueError, match=r"torrance_sparrow: sigma must lie in"):
        torrance_sparrow(cosines, sigma=doubles(2.0))


@pytest.mark.parametrize(("degrees", "rho", "k_s"), [(20, 0.8, 0.019), (42, 0.75, 0.085), (26, 0.7, 0.043)])
def test_body_and_surface(degrees, rho, k_s):
    # samples D, E, F of Oren & Nayar: k_b body + k_s surface, (32)
    sigma = held(math.radians(degrees))
    body, surface = OrenNayar(albedo=held(rho), sigma=sigma), TorranceSparrow(sigma=sigma, normalised=False)
    mixture = (1.0 * body + k_s * surface).double()
    assert_close(mixture(*few()), body(*few()) + k_s * surface(*few()), rtol=1e-6, atol=0)
    assert set(mixture.components(*few())) == {
        "OrenNayar.direct",
        "OrenNayar.interreflection",
        "TorranceSparrow.specular",
    }
    assert list(trainable(mixture)) == ["weights"]


@pytest.mark.parametrize("interface", [Schlick(f0=held(0.05)), Schlick(f0=held(0.2)), Dielectric(eta=held(1.5))])
def test_coupled_white_body_reflects_everything(interface):
    brdf = Coupled(albedo=held(1.0), fresnel=interface)
    for c in COS:
        mirror = float(interface(doubles(c)))
        assert albedo(brdf, c) + mirror == pytest.approx(1.0, abs=1e-6)
        assert float(brdf.directional_albedo(doubles(c))) == pytest.approx(1.0, abs=1e-14)


def test_coupled_under_a_full_mirror_is_dark():
    assert (Coupled(albedo=held(1.0), fresnel=Schlick(f0=held(1.0)))(*few()) == 0).all()


def test_mirror_and_dampened():
    assert (Mirror()(*few()) == 0).all()
    assert_close(Mirror(fresnel=Schlick(f0=held(0.3))).directional_albedo(doubles([1.0])), doubles([[0.3]]))
    brdf = Dampened(albedo=held(0.8), fresnel=Dielectric(eta=held(1.5)))
    mean = quad(lambda c: 2 * c * float(brdf.fresnel(doubles(c))), 0, 1)[0]
    for c in COS:  # of uniform light, into one direction
        assert albedo(brdf, c) == pytest.approx(0.8 * (1 - mean), rel=1e-5)


@pytest.mark.parametrize("cos_light", COS)
def test_dampened_returns_what_its_interface_lets_through(cos_light):
    # "For each incident theta", (25.1): light from one direction, summed over all views; above 1 with F of the view.
    brdf = Dampened(albedo=held(1.0), fresnel=Dielectric(eta=held(1.5)))
    light = doubles([math.sqrt(1 - cos_light**2), 0.0, cos_light])

    def leaving(cos_view):
        view = doubles([0.0, math.sqrt(1 - cos_view**2), cos_view])
        return 2 * math.pi * cos_view * float(brdf(doubles([0.0, 0.0, 1.0]), light, view, normalize=True))

    matte = quad(leaving, 0, 1)[0]
    assert matte + float(brdf.fresnel(doubles(cos_light))) == pytest.approx(1.0, abs=1e-9)


def grained(**material):
    return Oriented(AshikhminShirley(**material), doubles([1.0, 0.0, 0.0]))


def test_ashikhmin_shirley_albedos():
    zero, one = held(0.0), held(1.0)
    matte = grained(diffuse=one, specular=held(0.1), exponent_x=zero, exponent_y=zero)
    for c in COS:
        parts = matte.brdf.components  # the diffuse part alone has a closed form
        assert parts is not None
        body = grained(diffuse=one, specular=zero, exponent_x=held(1.0), exponent_y=held(1.0))
        shine = grained(diffuse=zero, specular=zero, exponent_x=held(1.0), exponent_y=held(1.0))
        assert albedo(body, c) - albedo(shine, c) == pytest.approx(1 - (1 - c / 2) ** 5, rel=1e-9)
        assert albedo(matte, c) <= 1
    for n, expected in ((1.0, 0.25), (10.0, 0.696), (100.0, 0.961)):
        shine = grained(diffuse=zero, specular=one, exponent_x=held(n), exponent_y=held(n))
        assert albedo(shine, 1.0, 64) == pytest.approx(expected, abs=5e-4)


def test_ashikhmin_shirley_turns_with_its_grain():
    brdf = AshikhminShirley(exponent_x=held(5.0), exponent_y=held(200.0), diffuse=held(0.1), specular=held(0.3))
    swapped = AshikhminShirley(exponent_x=held(200.0), exponent_y=held(5.0), diffuse=held(0.1), specular=held(0.3))
    normal, light, view = few()
    tangent = torch.linalg.cross(normal, normal.roll(1, -1))
    across = torch.linalg.cross(normal, torch.nn.functional.normalize(tangent, dim=-1))
    assert_close(brdf(normal, light, view, tangent=tangent), swapped(normal, light, view, tangent=across))
    assert_close(brdf(normal, light, view, tangent=-3 * tangent + normal), brdf(normal, light, view, tangent=tangent))


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


def test_oriented_mixture_keeps_its_mirror():
    tangent = doubles([1.0, 0.0, 0.0])
    plain = (0.5 * AshikhminShirley() + 0.4 * Mirror()).double()
    oriented = Oriented(plain, tangent)
    cosines = oriented.cosines(*few(5))
    assert_close(oriented.delta_reflectance(cosines), torch.full((5, 1), 0.4, dtype=torch.float64), rtol=1e-6, atol=0)
    assert (oriented.delta_probability(cosines) > 0).all()
    # cosines that a renderer made without the model know no tangent
    bare = Cosines.of(*few(5))
    assert_close(oriented.evaluate(bare), plain(*few(5), tangent=tangent))
