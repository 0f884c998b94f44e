"""Facet distributions and shadowing against the integrals that define them."""

import math

import pytest
import torch
from helpers.probes import doubles
from numpy.polynomial.legendre import leggauss
from scipy.special import wofz
from torch.testing import assert_close

from torchbrdf import Cosines, HalfVector, v_cavity_masking
from torchbrdf.facets import (
    anisotropic_beckmann_distribution,
    anisotropic_ggx_distribution,
    beckmann_distribution,
    beckmann_lambda,
    ggx_distribution,
    ggx_lambda,
    slope_area,
    slope_area_angle,
    slope_area_norm,
    visible_azimuth,
)
from torchbrdf.testing import hard_directions, random_directions

NORMAL, TANGENT = torch.eye(3, dtype=torch.float64)[[2, 0]]


def gauss(low, high, panels, nodes):
    x, w = (torch.from_numpy(a) for a in leggauss(nodes))
    edges = torch.linspace(low, high, panels + 1, dtype=torch.float64)
    width = (high - low) / panels
    return (edges[:-1, None] + width * (1 + x) / 2).flatten(), (w * width / 2).repeat(panels)


def hemisphere(panels=24, nodes=12):
    """Directions (theta, phi, 3) and their solid angles."""
    theta, wt = gauss(0, math.pi / 2, panels, nodes)
    phi, wp = gauss(0, 2 * math.pi, panels, nodes)
    sin, cos = theta.sin()[:, None], theta.cos()[:, None]
    h = torch.stack(torch.broadcast_tensors(sin * phi.cos(), sin * phi.sin(), cos), -1)
    return h, sin * wt[:, None] * wp


def half_of(h):
    """HalfVector of light = view = h."""
    h = torch.nn.functional.normalize(h, dim=-1)
    return HalfVector.of(Cosines.of(NORMAL, h, h, tangent=TANGENT))


DISTRIBUTIONS = [
    (lambda h: ggx_distribution(h, alpha=doubles(0.4)), ggx_lambda, 0.4, 0.4),
    (lambda h: anisotropic_ggx_distribution(h, alpha_x=doubles(0.3), alpha_y=doubles(0.8)), ggx_lambda, 0.3, 0.8),
    (lambda h: beckmann_distribution(h, alpha=doubles(0.4)), beckmann_lambda, 0.4, 0.4),
    (
        lambda h: anisotropic_beckmann_distribution(h, alpha_x=doubles(0.3), alpha_y=doubles(0.8)),
        beckmann_lambda,
        0.3,
        0.8,
    ),
]


@pytest.mark.parametrize(("distribution", "smith", "ax", "ay"), DISTRIBUTIONS)
def test_facets_cover_the_surface_once_and_fill_the_view(distribution, smith, ax, ay):
    h, solid = hemisphere()
    d = distribution(half_of(h))
    assert_close((d * h[..., 2] * solid).sum(), doubles(1.0), rtol=1e-7, atol=0)
    # what a view sees of all facets is its own cross section: int G1 D (v.m)+ dm = cos(view)
    for theta in (0.3, 1.0, 1.4):
        v = doubles([math.sin(theta) * math.cos(0.7), math.sin(theta) * math.sin(0.7), math.cos(theta)])
        t = ((ax * v[0]) ** 2 + (ay * v[1]) ** 2) / v[2] ** 2
        seen = (d * (h @ v).relu() * solid).sum() / (1 + smith(t))
        assert_close(seen, v[2], rtol=1e-3, atol=0)  # the horizon v.m = 0 is no panel's end


@pytest.mark.parametrize("sigma", [0.01, 0.05, 0.2, 0.5, 1.0, math.pi / 2])
def test_slope_area_norm_is_the_faddeeva_form(sigma):
    def t(x):
        z = x / (sigma * math.sqrt(2)) - 1j * sigma / math.sqrt(2)
        return sigma * math.sqrt(math.pi / 2) * complex(math.e) ** (-x * x / (2 * sigma**2) + 1j * x) * wofz(1j * z)

    assert_close(
        slope_area_norm(doubles(sigma)), doubles(2 * math.pi * (t(0) - t(math.pi / 2)).imag), rtol=1e-12, atol=0
    )


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_slope_area_norm_and_its_derivative_are_integrals(dtype):
    """Of exp(-theta^2/2 sigma^2) sin(theta), by quadrature: per texel, down to sigma = 0.02."""
    sigma = torch.linspace(0.02, math.pi / 2, 40, dtype=dtype, requires_grad=True)
    theta, weight = gauss(0, math.pi / 2, 60, 12)
    s = sigma.detach().double()[:, None]
    density = 2 * math.pi * (-((theta / s) ** 2) / 2).exp() * theta.sin() * weight
    norm = slope_area_norm(sigma)
    (slope,) = torch.autograd.grad(norm.sum(), sigma)
    value, derivative = (1e-13, 2e-11) if dtype == torch.float64 else (1e-6, 1e-5)
    assert_close(norm.detach().double(), density.sum(-1), rtol=value, atol=0)
    assert_close(slope.double(), (density * theta**2 / s**3).sum(-1), rtol=derivative, atol=0)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_beckmann_lambda_and_its_derivative(dtype):
    """Against erfcx, and dLambda/dT = a exp(-a^2)/(4 sqrt(pi)); known to the rounding of 1, which it is added to."""
    t = torch.logspace(-3, 8, 60, dtype=dtype, requires_grad=True)
    a = t.detach().double() ** -0.5
    exact = 0.5 * (-a * a).exp() * (1 / (a * math.sqrt(math.pi)) - torch.special.erfcx(a))
    got = beckmann_lambda(t)
    (slope,) = torch.autograd.grad(got.sum(), t)
    eps = torch.finfo(dtype).eps
    assert_close(got.detach().double(), exact, rtol=8 * eps, atol=4 * eps)
    assert_close(slope.double(), a * (-a * a).exp() / (4 * math.sqrt(math.pi)), rtol=1e3 * eps, atol=4 * eps)


@pytest.mark.parametrize("sigma", [0.05, 0.3, 1.0, math.pi / 2])
def test_slope_area_angle_inverts_the_integral(sigma):
    u = torch.linspace(0, 0.999999, 101, dtype=torch.float64)
    theta = slope_area_angle(u, doubles(sigma))
    x, w = gauss(0, 1, 8, 16)
    angles = theta[:, None] * x
    part = 2 * math.pi * ((-(angles**2) / (2 * sigma**2)).exp() * angles.sin() * w).sum(-1) * theta
    assert_close(part / slope_area_norm(doubles(sigma)), u, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("slope", [0.0, 0.5, 1.0, 3.0, 100.0])
def test_visible_azimuth_inverts_the_integral(slope):
    u = torch.linspace(0.001, 0.499, 50, dtype=torch.float64)
    phi = visible_azimuth(u, torch.full_like(u, slope))
    x, w = gauss(0, 1, 400, 6)
    density = (1 + slope * (phi[:, None] * x).cos()).clamp(0, 2) / (2 * math.pi)
    assert_close((density * w).sum(-1) * phi, u, rtol=1e-5, atol=1e-6)
    assert_close(
        visible_azimuth(1 - u, torch.full_like(u, slope)).abs(), visible_azimuth(0.5 - u, torch.full_like(u, slope))
    )


def test_slope_area_is_a_density_of_projected_area():
    h, solid = hemisphere()
    assert_close((slope_area(half_of(h), sigma=doubles(0.5)) * solid).sum(), doubles(1.0), rtol=1e-10, atol=0)


def masking(theta_i, theta_r, phi):
    light, view = (
        doubles([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)])
        for t, p in ((theta_i, 0.0), (theta_r, phi))
    )
    cosines = Cosines.of(NORMAL, light, view)
    return float(v_cavity_masking(cosines, HalfVector.of(cosines)))


def test_v_cavity_masking_is_the_minimum():
    # the sheet: 0.22 at 30/80 degrees, where the printed Max gives 1
    half = math.radians(25)  # forward, half vector at (80 - 30)/2 degrees
    expected = 2 * math.cos(half) * math.cos(math.radians(80)) / math.cos(math.radians(55))
    assert masking(math.radians(30), math.radians(80), math.pi) == pytest.approx(expected, rel=1e-12)
    retro = 2 * math.cos(math.radians(55)) * math.cos(math.radians(80)) / math.cos(math.radians(25))
    assert masking(math.radians(30), math.radians(80), 0.0) == pytest.approx(retro, rel=1e-12)
    assert retro == pytest.approx(0.22, abs=0.005)
    assert masking(1.2, 1.2, math.pi) == 1


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_half_vector_is_that_of_the_vectors(dtype):
    normal, light, view = random_directions(2000, dtype=dtype, generator=torch.Generator().manual_seed(0))
    n, s, v = (x.double() for x in (normal, light, view))
    h = torch.nn.functional.normalize(s + v, dim=-1)
    cos, across = (n * h).sum(-1), torch.linalg.cross(n, h).square().sum(-1)
    eps = torch.finfo(dtype).eps
    tangent = torch.linalg.cross(normal, torch.roll(normal, 1, -1))
    grain = torch.linalg.cross(n, torch.linalg.cross(torch.nn.functional.normalize(tangent.double(), dim=-1), n))
    for given in (None, tangent):
        half = HalfVector.of(Cosines.of(normal, light, view, tangent=given))
        assert_close(half.cos.double(), cos, rtol=300 * eps, atol=0)
        assert_close(half.cos_light.double(), (s * h).sum(-1), rtol=300 * eps, atol=0)
        assert_close(half.sine_squared.double(), across, rtol=300 * eps, atol=64 * eps**2)
        assert (half.sine_squared >= 0).all()
        assert (half.cos <= 1).all()
    along = (h * torch.nn.functional.normalize(grain, dim=-1)).sum(-1)
    assert_close(half.tangent.double(), along, rtol=0, atol=300 * eps)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_half_vector_is_finite_in_hard_directions(dtype):
    for normal, light, view in hard_directions(dtype).values():
        half = HalfVector.of(Cosines.of(normal, light, view))
        assert all(x.isfinite().all() for x in (half.cos, half.sine_squared, half.cos_light))
        assert (half.cos > 0).all()
