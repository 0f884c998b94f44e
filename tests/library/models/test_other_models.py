"""What the sheet states of each model, by other forms and by integrals; the golden values are in test_golden."""

import math

import pytest
import torch
from numpy.polynomial.legendre import leggauss
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
    Dampened,
    Dielectric,
    FujiiOrenNayar,
    Hapke,
    Lambert,
    LambertSphere,
    LommelSeeliger,
    MaxCosinePhong,
    Minnaert,
    Mirror,
    ModifiedPhong,
    OrenNayar,
    Oriented,
    Perfect,
    Schlick,
    TabulatedBRDF,
    TorranceSparrow,
    burley,
    eon_albedo_from_directional,
    eon_albedo_from_white_sky,
    fixed,
    lambert_sphere_fast,
    minnaert,
    rusinkiewicz_angles,
    smith_separable,
    torrance_sparrow,
    trainable,
)
from torchbrdf import testing as laws
from torchbrdf.models.planetary import lambert_sphere_phase

COS = [0.05, 0.3, 0.8, 1.0]


def doubles(x):
    return torch.tensor(x, dtype=torch.float64)


def held(x):
    return fixed(doubles(x))


def albedo(brdf, cos, nodes=48):
    """By quadrature through `forward`, channel 0."""
    with torch.no_grad():
        return float(laws._directional_albedo(brdf, math.acos(cos), nodes)[0])


def white_sky(brdf, nodes=40):
    x, w = leggauss(nodes)
    return sum(float(wi) * c * albedo(brdf, c, 24) for c, wi in zip((1 + x) / 2, w, strict=True))


def few(n=200, max_angle=85.0):
    generator = torch.Generator().manual_seed(5)
    return laws.random_directions(n, dtype=torch.float64, generator=generator, max_angle=math.radians(max_angle))


@pytest.mark.parametrize("exponent", [1.0, 20.0, 200.0])
def test_phong_normalisations(exponent):
    material = {"diffuse": held(0.0), "specular": held(0.6), "exponent": held(exponent)}
    modified, cosine = ModifiedPhong(**material), MaxCosinePhong(**material)
    assert albedo(modified, 1.0) == pytest.approx(0.6, rel=1e-6)
    for c in COS:
        assert albedo(cosine, c, 96) <= 0.6 + 1e-6
    if exponent == 200:
        assert albedo(modified, 0.3, 96) == pytest.approx(0.6 * 0.3, rel=0.05)  # dark at grazing, as k_s cos


@pytest.mark.parametrize("k", [0.5, 1.0, 1.7])
def test_minnaert_albedo(k):
    brdf = Minnaert(albedo=held(0.6), k=held(k))
    for c in COS:
        assert albedo(brdf, c, 96) == pytest.approx(0.6 * c ** (k - 1), rel=1e-4)
    if k == 1:
        assert_close(brdf(*few()), Lambert(albedo=held(0.6))(*few()))


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
    for c in COS:
        assert albedo(brdf, c) == pytest.approx(0.8 * (1 - float(brdf.fresnel(doubles(c)))), rel=1e-9)


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


@pytest.mark.parametrize(("build", "expected"), [(GGX, 0.688), (Beckmann, 0.943)])
def test_microfacet_albedo_at_normal_incidence(build, expected):
    assert albedo(build(alpha=held(0.5), fresnel=Perfect()), 1.0, 64) == pytest.approx(expected, abs=5e-4)


def test_separable_masking_is_darker():
    correlated, separable = (GGX(alpha=held(0.5), **m) for m in ({}, {"masking": smith_separable}))
    assert (separable(*few()) <= correlated(*few())).all()


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


def test_rusinkiewicz_angles_are_those_of_rotated_vectors():
    normal, light, view = few()
    h = torch.nn.functional.normalize(light + view, dim=-1)
    x = torch.nn.functional.normalize(h * (h * normal).sum(-1, keepdim=True) - normal, dim=-1)
    y = torch.linalg.cross(h, x)
    phi = torch.atan2((light * y).sum(-1), (light * x).sum(-1)).abs()
    expected = ((normal * h).sum(-1).acos(), (light * h).sum(-1).acos(), torch.minimum(phi, math.pi - phi))
    for got, value in zip(rusinkiewicz_angles(Cosines.of(normal, light, view)), expected, strict=True):
        assert_close(got, value, rtol=0, atol=1e-7)


def test_tabulated_is_linear_in_its_angles():
    nodes = (6, 5, 4)
    for power in (1.0, 2.0):
        axes = [torch.linspace(0, 1, n, dtype=torch.float64) for n in nodes]
        th, td, pd = torch.meshgrid(
            *(a**p * math.pi / 2 for a, p in zip(axes, (power, 1, 1), strict=True)), indexing="ij"
        )
        values = torch.stack((0.2 + th, 1 + 2 * td + 0.5 * pd), -1)
        got = TabulatedBRDF(values, half_power=power)(*few())
        h, d, p = rusinkiewicz_angles(Cosines.of(*few()))
        assert_close(got, torch.stack((0.2 + h, 1 + 2 * d + 0.5 * p), -1), rtol=1e-12, atol=0)


def test_tabulated_converges_to_its_model():
    brdf = GGX(alpha=held(0.4))
    directions = few(500, 60.0)
    errors = [
        (TabulatedBRDF.of(brdf, nodes=(n, n, n // 2))(*directions) - brdf(*directions)).abs().mean() for n in (20, 40)
    ]
    assert errors[1] < errors[0] / 2.5
    assert_close(TabulatedBRDF.of(Lambert(albedo=held(0.5)), nodes=(2, 2, 1)).values.max(), doubles(0.5 / math.pi))


@pytest.mark.parametrize(
    ("values", "error", "match"),
    [
        (torch.ones(3, 3, 3), ValueError, "shape"),
        (torch.ones(1, 3, 3, 1), ValueError, "theta_h >= 2"),
        (-torch.ones(2, 2, 2, 1), ValueError, "8 of 8 are not"),
        (torch.full((2, 2, 2, 1), math.nan), ValueError, "not negative"),
        (torch.ones(2, 2, 2, 1).half(), TypeError, "float16"),
    ],
)
def test_tabulated_refuses(values, error, match):
    with pytest.raises(error, match=match):
        TabulatedBRDF(values)
    with pytest.raises(ValueError, match="half_power must be positive"):
        TabulatedBRDF(torch.ones(2, 2, 2, 1), half_power=0.0)


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
