"""The unpolarised He-Torrance model: reference values, the printed equations, limits."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from he_torrance_printed import Surface, amplitudes, polar, printed, z0
from scipy.integrate import quad
from torch.testing import assert_close

from torchbrdf import Cosines, HeTorrance, conductor, conductor_amplitudes, fixed, he_torrance, specular_reflectivity
from torchbrdf.models.he_torrance.roughness import effective_roughness, lambert_w
from torchbrdf.models.he_torrance.shadowing import shadowing

GOLDEN = json.loads((Path(__file__).parents[1] / "data" / "he_torrance.json").read_text())
UP = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)


def doubles(x):
    return torch.tensor(x, dtype=torch.float64)


def material(sigma0, tau, wavelength, index):
    index = complex(index)
    return {
        "sigma0": doubles(sigma0),
        "tau": doubles(tau),
        "wavelength": doubles([wavelength]),
        "eta": doubles([index.real]),
        "k": doubles([index.imag]),
    }


def of_golden(case):
    i = case["inp"]
    return material(i["sigma0"], i["tau"], i["lam"], complex(*i["n"]))


def directions(case):
    i = case["inp"]
    return tuple(
        doubles(polar(math.radians(i[f"theta_{x}"]), math.radians(i[f"phi_{x}"])).tolist()) for x in ("i", "r")
    )


def lobe(light, view, **surface):
    """Directional-diffuse part for the normal z, (channel,)."""
    return he_torrance(Cosines.of(UP, light, view), diffuse=doubles(0.0), **surface)


def close(got, expected, rtol):
    # 1e-290: values that underflow float64 on the way
    assert abs(float(got) - float(expected)) <= rtol * abs(float(expected)) + 1e-290


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


@pytest.mark.parametrize("case", GOLDEN["z0"])
def test_effective_roughness(case):
    k_sum = doubles([case["K"]]).requires_grad_()
    ratio = effective_roughness(k_sum)
    close(case["sigma0"] * ratio.detach(), case["sigma"], 1e-15)
    (slope,) = torch.autograd.grad(case["sigma0"] * ratio, k_sum)
    close(slope, case["dsigma_dK"], 1e-13)
    # z0 itself from (sigma0/sigma)^2 - 1, where that has digits
    root = z0(case["K"], case["sigma0"])
    close(root, case["z0"], 1e-13)
    if case["K"] > 0.1:
        close(case["sigma0"] * (1 / ratio.detach() ** 2 - 1).sqrt(), root, 1e-12)


def test_lambert_w_and_its_derivatives():
    x = torch.cat((doubles([0.0]), torch.logspace(-12, 30, 300, dtype=torch.float64))).requires_grad_()
    w = lambert_w(x)
    assert_close(w * w.exp(), x, rtol=1e-13, atol=0)
    (first,) = torch.autograd.grad(w.sum(), x, create_graph=True)
    (second,) = torch.autograd.grad(first.sum(), x)
    assert_close(first, 1 / (w.exp() * (1 + w)), rtol=1e-13, atol=0)
    assert_close(second, -(w + 2) / ((w.exp() ** 2) * (1 + w) ** 3), rtol=1e-12, atol=0)
    single = x.detach().clamp(max=1e30).float().requires_grad_()
    w = lambert_w(single)
    assert_close(w.double(), lambert_w(single.double()), rtol=3e-7, atol=0)
    assert_close(torch.autograd.grad(w.sum(), single)[0], (1 / (w.exp() * (1 + w))).detach(), rtol=1e-5, atol=0)
    value, tangent = torch.func.jvp(lambert_w, (x.detach(),), (torch.ones_like(x),))
    assert_close(tangent, first, rtol=1e-13, atol=0)
    assert_close(value, lambert_w(x))


@pytest.mark.parametrize("case", GOLDEN["smith"])
def test_shadowing(case):
    theta = doubles([math.radians(case["theta"])])
    got = shadowing(theta.cos(), theta.sin(), sigma0=doubles([case["sigma0_over_tau"]]), tau=doubles([1.0]))
    rtol = 1e-14 if case["theta"] < 89.5 else 2e-11
    close(got.visibility, case["S1"], rtol)
    close(got.over_cos, case["S1_over_cos"], rtol)
    close(got.k, case["K"], max(rtol, 2e-11))


@pytest.mark.parametrize(("degrees", "ratio"), [(30.0, 0.5), (60.0, 0.16), (80.0, 1.0), (89.0, 4.4)])
def test_shadowing_is_smiths_integral(degrees, ratio):
    theta, w = math.radians(degrees), math.sqrt(2) * ratio
    mu = 1 / math.tan(theta)

    def facets(q):
        return (q - mu) * math.exp(-(q**2) / (2 * w**2)) / (math.sqrt(2 * math.pi) * w)

    shadow = quad(facets, mu, mu + 12 * w, epsabs=1e-14)[0] / mu
    lit = 0.5 * (1 + math.erf(mu / (math.sqrt(2) * w)))
    got = shadowing(*(doubles([f(theta)]) for f in (math.cos, math.sin)), sigma0=doubles([ratio]), tau=doubles([1.0]))
    close(got.visibility, lit / (1 + shadow), 1e-10)


@pytest.mark.parametrize("case", GOLDEN["fresnel"])
def test_fresnel(case):
    cos, eta, k = (doubles([x]) for x in (case["cos"], *case["n"]))
    close(conductor(cos, eta=eta, k=k), case["F2"], 1e-12)
    for got, expected in zip(conductor_amplitudes(cos, eta=eta, k=k), (case["rs"], case["rp"]), strict=True):
        assert abs(complex(got) - complex(*map(float, expected))) < 1e-15


SURFACES = [
    Surface(0.28, 1.77, 0.5, 0.77 + 6.08j),
    Surface(0.28, 1.77, 2.0, 2.15 + 20.7j),
    Surface(4.4, 1.0, 0.55, 1.5 + 0j),
    Surface(1.45, 13.2, 0.5, 1.74 + 0.3j),
]


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
