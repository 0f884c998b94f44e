"""The unpolarised He-Torrance reflectance: reference values, printed equations, limits, derivatives, float32."""

import math

import numpy as np
import pytest
import torch
from helpers.he_torrance_printed import amplitudes, polar, printed, z0
from helpers.he_torrance_surfaces import GOLDEN, SURFACES, UP, close, directions, lobe, material, of_golden
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import Cosines, HeTorrance, conductor, fixed, he_torrance, specular_reflectivity
from torchbrdf.models.he_torrance.reflectance import directional_diffuse, unchecked_specular_reflectivity
from torchbrdf.models.he_torrance.shadowing import shadowing
from torchbrdf.models.he_torrance.specular import averaged_specular
from torchbrdf.testing import hard_directions, random_directions


@pytest.mark.parametrize("case", GOLDEN["brdf"], ids=lambda c: c["tag"])
def test_reference_values(case):
    light, view = directions(case)
    # the cosine of an angle near 90 degrees has lost digits before the model sees it
    grazing = max(case["inp"]["theta_i"], case["inp"]["theta_r"])
    rtol = 5e-12 if grazing < 89.99 else 5e-11
    close(lobe(light, view, **of_golden(case)), case["ref"]["dd"], rtol)
    close(specular_reflectivity(light[2], **of_golden(case)), case["ref"]["sp"], rtol)
    total = he_torrance(Cosines.of(UP, light, view), diffuse=doubles(case["inp"]["a"]), **of_golden(case))
    close(total, float(case["ref"]["dd"]) + float(case["ref"]["ud"]), rtol)


@pytest.mark.parametrize("surface", SURFACES)
def test_printed_equations(surface):
    rng = np.random.default_rng(0)
    for _ in range(12):
        light, view = (polar(rng.uniform(0.05, 1.5), rng.uniform(0, 2 * math.pi)) for _ in range(2))
        expected, _ = printed(light, view, surface)
        f_s, f_p = amplitudes(float(np.linalg.norm(light + view)) / 2, surface.index)
        expected *= (abs(f_s) ** 2 + abs(f_p) ** 2) / 2
        got = lobe(doubles(light.tolist()), doubles(view.tolist()), **material(*surface))
        close(got, expected, 1e-11)


def test_smooth_surface_is_a_fresnel_mirror_over_a_matte_body():
    cos = doubles([0.05, 0.5, 1.0])
    index = {"eta": doubles([1.5]), "k": doubles([0.0])}
    lengths = {"tau": doubles(2.0), "wavelength": doubles([0.5])}
    assert_close(
        specular_reflectivity(cos, sigma0=doubles(0.0), **lengths, **index),
        conductor(cos[:, None], **index),
        rtol=0,
        atol=0,
    )
    light, view = doubles(polar(0.7, 0.2).tolist()), doubles(polar(0.4, 2.0).tolist())
    cosines = Cosines.of(UP, light, view)
    flat = he_torrance(cosines, sigma0=doubles(0.0), diffuse=doubles([0.3]), **lengths, **index)
    assert_close(flat, doubles([0.3 / math.pi]), rtol=1e-15, atol=0)
    # the approach: the lobe is proportional to sigma0^2, the mirror loses what the lobe gains
    small = [lobe(light, view, **material(s, 0.3, 0.5, 1.5)) for s in (1e-5, 2e-5)]
    close(small[1] / small[0], 4.0, 1e-6)
    model = HeTorrance(sigma0=fixed(doubles(0.0)), tau=doubles(2.0), wavelength=doubles([0.5]), eta=doubles([1.5]))
    assert_close(model.directional_albedo(doubles(0.5)), conductor(doubles([0.5]), **index), rtol=1e-14, atol=0)


@pytest.mark.parametrize(("theta_i", "theta_r", "dphi"), [(20, 35, 160), (50, 45, 175), (60, 75, 180), (10, 30, 90)])
def test_geometric_optics(theta_i, theta_r, dphi):
    # Beckmann facets of the effective roughness; the first term of the deviation is (1 - 2u + u^2/2)/g
    light = polar(math.radians(theta_i), 0.0)
    view = polar(math.radians(theta_r), math.radians(dphi))
    sigma0, tau = 5.0, 30.0
    k_sum, shadow = 0.0, 1.0
    for theta in (math.radians(theta_i), math.radians(theta_r)):
        b = tau / (2 * sigma0 * math.tan(theta))
        k_sum += math.tan(theta) * math.erfc(b)
        shadow *= (1 - math.erfc(b) / 2) / (1 + 0.5 * (math.exp(-b * b) / (math.sqrt(math.pi) * b) - math.erfc(b)))
    sigma = sigma0 / math.sqrt(1 + (z0(k_sum, sigma0) / sigma0) ** 2)
    h = light + view
    tan2, cos2 = (h[0] ** 2 + h[1] ** 2) / h[2] ** 2, h[2] ** 2 / (h @ h)
    alpha = 2 * sigma / tau
    facets = math.exp(-tan2 / alpha**2) / (math.pi * alpha**2 * cos2**2)
    f_s, f_p = amplitudes(float(np.linalg.norm(h)) / 2, 0.77 + 6.08j)
    geometric = (abs(f_s) ** 2 + abs(f_p) ** 2) / 2 * shadow * facets / (4 * light[2] * view[2])
    u = tan2 / alpha**2
    for wavelength in (0.5, 0.05):
        g = (2 * math.pi / wavelength * sigma * h[2]) ** 2
        got = lobe(*(doubles(x.tolist()) for x in (light, view)), **material(sigma0, tau, wavelength, 0.77 + 6.08j))
        deviation = float(got) / geometric - 1
        assert abs(deviation - (1 - 2 * u + u * u / 2) / g) < 30 * (1 + u**4) / g**2 + 1e-12


def test_rough_surfaces_depend_on_the_slope_alone():
    light, view = doubles(polar(0.6, 0.0).tolist()), doubles(polar(0.9, 2.9).tolist())
    fine, coarse = (lobe(light, view, **material(4.4 * s, 24.0 * s, 0.5, 1.5)) for s in (10.0, 1000.0))
    close(fine, coarse, 3e-4)
    assert abs(float(lobe(light, view, **material(0.044, 0.24, 0.5, 1.5)) / coarse) - 1) > 0.5


def test_long_waves_see_a_mirror():
    # lambda >> sigma0 cos: g -> 0, rho_s -> |F|^2 S, and the lobe is the first term of its series
    surface = material(0.28, 1.77, 500.0, 2.15 + 20.7j)
    cos = doubles([0.2, 0.9])
    seen = shadowing(cos, (1 - cos**2).sqrt(), sigma0=doubles(0.28), tau=doubles(1.77)).visibility
    expected = conductor(cos, eta=surface["eta"], k=surface["k"]) * seen**2
    assert_close(specular_reflectivity(cos, **surface)[:, 0], expected, rtol=1e-4, atol=0)
    light, view = polar(0.5, 0.0), polar(0.8, 2.0)
    h = light + view
    t = (math.pi * 1.77 / 500.0) ** 2 * (h[0] ** 2 + h[1] ** 2)
    first = (h @ h) ** 2 / math.pi * (math.pi**2 * 0.28 * 1.77 / 500.0**2) ** 2 * math.exp(-t) / (light[2] * view[2])
    f = conductor(doubles([math.sqrt(h @ h) / 2]), eta=surface["eta"], k=surface["k"])
    close(lobe(doubles(light.tolist()), doubles(view.tolist()), **surface), first * float(f), 1e-4)


def test_retro_and_normal_incidence_are_approached_smoothly():
    surface = material(0.28, 1.77, 0.6, 0.77 + 6.08j)
    for theta in (0.0, 0.7):
        at = lobe(*(doubles(polar(theta, 0.3).tolist()) for _ in range(2)), **surface)
        near = [
            lobe(doubles(polar(theta, 0.3).tolist()), doubles(polar(theta + d, 0.3).tolist()), **surface)
            for d in (1e-6, -1e-6)
        ]
        assert_close((near[0] + near[1]) / 2, at, rtol=1e-8, atol=0)


BOX = [
    # sigma0, tau, wavelength, index
    (0.02, 0.4, 0.5, 1.5 + 0.01j),
    (0.1, 1.0, 0.5, 0.2 + 3.5j),
    (0.28, 1.77, 0.5, 0.77 + 6.08j),
    (0.28, 1.77, 2.0, 2.15 + 20.7j),
    (2.0, 9.0, 0.5, 1.74 + 0.2j),
    (4.4, 1.0, 0.55, 1.5 + 0.1j),
]


def log_uniform(low, high, n, generator, dtype):
    u = torch.rand(n, dtype=torch.float64, generator=generator)
    return (math.log(low) + u * math.log(high / low)).exp().to(dtype)


@pytest.mark.parametrize("parameters", BOX)
def test_derivatives(parameters):
    # with respect to everything, at random and in the directions where formulas change
    surface = {name: value.requires_grad_() for name, value in material(*parameters).items()}
    generator = torch.Generator().manual_seed(0)
    vectors = [v.requires_grad_() for v in random_directions(2, dtype=torch.float64, generator=generator)]

    def f(normal, light, view, diffuse, *values):
        cosines = Cosines.of(normal, light, view, normalize=True)
        return he_torrance(cosines, diffuse=diffuse, **dict(zip(surface, values, strict=True)))

    inputs = (*vectors, doubles([0.2]).requires_grad_(), *surface.values())
    assert torch.autograd.gradcheck(f, inputs, eps=1e-6, atol=1e-6, rtol=1e-5, check_forward_ad=True)


def test_derivatives_at_sigma0_zero():
    # even in sigma0: the unchecked function continues to negative ones
    surface = material(0.0, 1.0, 0.5, 1.5 + 0.1j)
    sigma0 = surface.pop("sigma0").requires_grad_()
    cosines = Cosines.of(*random_directions(4, dtype=torch.float64, generator=torch.Generator().manual_seed(0)))
    assert torch.autograd.gradcheck(lambda s: directional_diffuse(cosines, sigma0=s, **surface), sigma0)
    assert torch.autograd.gradcheck(
        lambda s: unchecked_specular_reflectivity(cosines.light, sigma0=s, **surface), sigma0
    )
    assert torch.autograd.gradgradcheck(lambda s: directional_diffuse(cosines, sigma0=s, **surface), sigma0)


def extreme_vectors(n, dtype, generator):
    """Anywhere above the horizon, a third of it grazing, some in retro, mirror or normal directions."""
    u = torch.rand(n, 4, dtype=torch.float64, generator=generator)
    kind = torch.randint(0, 6, (n,), generator=generator)
    near = 10 ** (-12 * torch.rand(n, 2, dtype=torch.float64, generator=generator))
    theta = [u[:, i] * math.pi / 2 for i in range(2)]
    theta = [torch.where(kind == i, math.pi / 2 - near[:, i], theta[i]) for i in range(2)]
    theta[1] = torch.where((kind == 2) | (kind == 3), theta[0], theta[1])
    theta = [torch.where(kind == 4 + i, near[:, i], theta[i]) for i in range(2)]
    phi = [2 * math.pi * u[:, 2 + i] for i in range(2)]
    phi[1] = torch.where(kind == 2, phi[0], torch.where(kind == 3, phi[0] + math.pi, phi[1]))
    vectors = [
        torch.stack((t.sin() * p.cos(), t.sin() * p.sin(), t.cos()), -1).to(dtype)
        for t, p in zip(theta, phi, strict=True)
    ]
    return vectors[0].requires_grad_(), vectors[1].requires_grad_()


def assert_finite_everywhere(n, dtype, seed):
    generator = torch.Generator().manual_seed(seed)
    light, view = extreme_vectors(n, dtype, generator)
    wavelength = doubles([0.5]).to(dtype)
    sigma0 = log_uniform(1e-7, 5e3, n, generator, dtype)
    # half of the slopes in the range of surfaces, half from mirrors to needles
    ratio = torch.where(
        torch.arange(n) % 2 == 0, log_uniform(0.01, 5, n, generator, dtype), log_uniform(1e-6, 1e2, n, generator, dtype)
    )
    sigma0[::50] = 0.0
    tau = (sigma0 / ratio).clamp(min=1e-3, max=1e6)
    eta, k = log_uniform(1e-2, 1e2, n, generator, dtype)[:, None], log_uniform(1e-3, 1e2, n, generator, dtype)[:, None]
    k[::7] = 0.0
    surface = {"sigma0": sigma0, "tau": tau, "wavelength": wavelength, "eta": eta, "k": k}
    surface = {name: value.requires_grad_() for name, value in surface.items()}
    up = torch.tensor([0.0, 0.0, 1.0], dtype=dtype)
    cosines = Cosines.of(up, light, view, normalize=True)
    for what, f in (
        ("directional diffuse", he_torrance(cosines, diffuse=torch.tensor([0.1], dtype=dtype), **surface)),
        ("mirror", specular_reflectivity(cosines.light, **surface)),
        ("specular", cosines.zero_below_horizon(averaged_specular(cosines, solid_angle=0.1, **surface))),
    ):
        assert f.isfinite().all(), what
        assert (f >= 0).all(), what
        for name, g in zip(
            ("light", "view", *surface),
            torch.autograd.grad(f.sum(), (light, view, *surface.values()), allow_unused=True, retain_graph=True),
            strict=True,
        ):
            assert g is None or g.isfinite().all(), f"{what}: gradient to {name}"


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_finite_for_random_and_extreme_inputs(dtype):
    assert_finite_everywhere(100_000, dtype, 0)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_finite_for_ten_million_inputs(dtype):
    for seed in range(100):
        assert_finite_everywhere(100_000, dtype, seed)


@pytest.mark.parametrize("parameters", BOX)
def test_float32(parameters):
    # an exponent of x carries x rounding errors of its argument, which is what |ln f| stands for
    single = {name: value.float() for name, value in material(*parameters).items()}
    directions = random_directions(20_000, generator=torch.Generator().manual_seed(0))
    exact = {name: value.double() for name, value in single.items()}
    upcast = [torch.nn.functional.normalize(v.double(), dim=-1) for v in directions]
    f = directional_diffuse(Cosines.of(*directions), **single)
    reference = directional_diffuse(Cosines.of(*upcast), **exact)
    assert f.dtype == torch.float32
    held = reference > 1e-25
    error = (f.double() / reference - 1)[held].abs()
    allowed = 3e-6 + 8 * torch.finfo(torch.float32).eps * reference[held].log().abs()
    assert (error <= allowed).all(), (error / allowed).max()
    # the mirror share: e^-g
    cos = upcast[1][:, 2].abs().float()
    got, expected = specular_reflectivity(cos, **single), specular_reflectivity(cos.double(), **exact)
    held = expected > 1e-25
    error = (got.double() / expected - 1)[held].abs()
    assert (error <= 3e-6 + 8 * torch.finfo(torch.float32).eps * expected[held].log().abs()).all()


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_reciprocal_in_hard_directions(dtype):
    surface = {name: value.to(dtype) for name, value in material(0.28, 1.77, 0.5, 0.77 + 6.08j).items()}
    for normal, light, view in hard_directions(dtype).values():
        forth = he_torrance(Cosines.of(normal, light, view), diffuse=torch.zeros((), dtype=dtype), **surface)
        back = he_torrance(Cosines.of(normal, view, light), diffuse=torch.zeros((), dtype=dtype), **surface)
        assert_close(forth, back, rtol=2e-4 if dtype == torch.float32 else 1e-11, atol=1e-30)
