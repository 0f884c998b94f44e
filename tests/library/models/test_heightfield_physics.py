"""What the heightfield's parts have to obey, each against an independent form: area, Smith, energy, roughness."""

import math

import numpy as np
import pytest
import torch
from heightfields import F64, cosines, f64
from torch.testing import assert_close

from torchbrdf import (
    MESHED_HEIGHTFIELD,
    SMOOTH_HEIGHTFIELD,
    HeightfieldConstants,
    rms_slope_from_beckmann_alpha,
    rms_slope_from_sigma,
    sigma_from_rms_slope,
)
from torchbrdf.models.heightfield.direct import QUADRATURES, Quadrature, direct_light
from torchbrdf.models.heightfield.slope_frame import slope_frame
from torchbrdf.models.heightfield.transport import _direct_albedo, _smith_modes, bounce_modes, polar_nodes
from torchbrdf.models.heightfield.visibility import facet_masking, independence, joint_masking, ray

# A turn so fast that two rays know nothing of each other: l = 1.
UNCORRELATED = HeightfieldConstants(level=0.5, grazing=0.3, turn=1e9, grazing_turn=0.0)


# s_1 and s_2: sin^2 of 22.5 and 67.5 degrees
CRAIG = (math.sin(math.pi / 8) ** 2, math.cos(math.pi / 8) ** 2)


def erfcx(x):
    return math.exp(x * x) * math.erfc(x) if x < 5 else torch.special.erfcx(f64(x)).item()


def gauss(low, high, panels=200):
    """Nodes and weights of 16-point panels on [low, high]."""
    x, w = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(low, high, panels + 1)
    width = np.diff(edges)[:, None]
    return f64((edges[:-1, None] + width * (1 + x) / 2).ravel()), f64((width / 2 * w).ravel())


@pytest.mark.parametrize("constants", [MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD])
@pytest.mark.parametrize("occlusion", [0.0, 0.4, 1.0, 1.2, 1.6, 1.8])
def test_projected_area_is_exact_in_each_direction(occlusion, constants):
    # the facets that are seen fill the area the ray sees: E[X+/(1 + L)] = 1
    for t in (0.03, 0.1, 0.4, 1.0, 3.0, 10.0, 60.0):
        along = ray(f64(t), f64(occlusion), constants)
        xi, weight = gauss(max(-1 / t, -10.0), 10.0)
        towards = 1 + t * xi
        density = torch.exp(-xi * xi / 2) / math.sqrt(2 * math.pi)
        seen = towards / (1 + facet_masking(towards / t, along))
        assert (seen * density * weight).sum().item() == pytest.approx(1, abs=1e-9)


def test_masking_is_never_negative():
    t = torch.cat((torch.zeros(1), 10 ** torch.linspace(-3, 6, 400))).to(F64)
    for constants in (MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD):
        for occlusion in (0.0, 0.5, 1.0, 1.2, 1.6, 1.8):
            along = ray(t, f64(occlusion), constants)
            assert (along.masking >= 0).all()
            assert (along.occlusion <= occlusion + 1e-12).all()
            assert (facet_masking(torch.linspace(0, 9, 401).to(F64), along) >= 0).all()


def test_occlusion_is_free_up_to_one_smooth_scale():
    # what levels it off beyond leaves Lambda of the plain form where that is positive
    for constants in (MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD):
        for nu in (0.1, 0.7, 1.5, 2.5):
            t, g = 1 / nu, 4 / 3 * nu - constants.level + constants.grazing / nu
            mills = [math.sqrt(math.pi / 2) * erfcx(q / math.sqrt(2)) for q in (nu, *(g / k - nu for k in CRAIG))]
            near = sum(1 - (g / k - nu) * m for k, m in zip(CRAIG, mills[1:], strict=True))
            plain = math.exp(-nu * nu / 2) / math.sqrt(2 * math.pi) * (t - mills[0] - t / 4 * near)
            assert ray(f64(t), f64(1.0), constants).masking.item() == pytest.approx(plain, rel=2e-6)


def smith_masking(theta, slope):
    """Lambda by the error function: Smith 1967 for Gaussian slopes."""
    t = slope * math.tan(theta)
    nu = 1 / (math.sqrt(2) * t)
    return (math.exp(-nu * nu) / (nu * math.sqrt(math.pi)) - math.erfc(nu)) / 2


@pytest.mark.parametrize("theta", [0.3, 1.0, 1.45])
def test_without_occlusion_the_masking_is_smiths(theta):
    for slope in (0.2, 0.9):
        got = ray(f64(slope * math.tan(theta)), f64(0.0), SMOOTH_HEIGHTFIELD).masking
        assert got.item() == pytest.approx(smith_masking(theta, slope), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("theta_i", "theta_r", "dphi"), [(0.3, 1.1, 0.7), (1.35, 1.2, 2.5), (1.0, 0.2, 3.1), (1.4, 0.9, 1.6)]
)
@pytest.mark.parametrize("slope", [0.3, 0.9])
def test_smith_by_a_dense_grid(theta_i, theta_r, dphi, slope):
    xi = np.linspace(-7, 7, 4001)
    x, y = xi[:, None], xi[None, :]
    lit = np.maximum(1 + slope * math.tan(theta_i) * x, 0)
    seen = np.maximum(1 + slope * math.tan(theta_r) * (x * math.cos(dphi) + y * math.sin(dphi)), 0)
    mass = np.exp(-(x * x + y * y) / 2) / np.sqrt(1 + slope * slope * (x * x + y * y))
    mean = (mass * lit * seen).sum() * (xi[1] - xi[0]) ** 2 / (2 * math.pi)
    expected = mean / math.pi / (1 + smith_masking(theta_i, slope) + smith_masking(theta_r, slope))
    frame = slope_frame(cosines(theta_i, theta_r, dphi), f64(slope))
    got = direct_light(frame, f64(0.0), UNCORRELATED, Quadrature(40, 30, 6.5))
    assert got.item() == pytest.approx(expected, rel=1e-5)


def test_two_rays_in_one_mask_once_and_apart_like_smith():
    first, second = f64([0.3, 2.0, 0.0]), f64([0.5, 0.1, 0.0])
    assert_close(joint_masking(first, second, f64(1.0)), first + second, rtol=1e-14, atol=1e-15)
    assert_close(joint_masking(first, second, f64(0.0)), torch.maximum(first, second), rtol=1e-14, atol=1e-15)
    matrix = torch.tensor([[0.3, 0.6 * math.sqrt(0.15)], [0.6 * math.sqrt(0.15), 0.5]], dtype=F64)
    largest = torch.linalg.eigvalsh(matrix)[-1]
    assert_close(joint_masking(f64(0.3), f64(0.5), f64(0.6)), largest, rtol=1e-14, atol=0)
    steep, flat = (ray(f64(t), f64(1.0), SMOOTH_HEIGHTFIELD) for t in (3.0, 0.5))
    assert independence(steep, flat, f64(0.0), SMOOTH_HEIGHTFIELD) == 0
    apart = [independence(steep, flat, f64(h), SMOOTH_HEIGHTFIELD).item() for h in (0.1, 0.5, 1.0)]
    assert apart == sorted(apart)
    assert apart[-1] < 1


@pytest.mark.parametrize("slope", [0.1, 0.67, 1.2])
def test_unbalanced_bounces_keep_all_light(slope):
    # Smith's surface of white facets, f_1 by the slope integral and the others by invariance
    nodes = polar_nodes(20, f64(slope))
    modes = _smith_modes(f64(slope), nodes, 150)[:, 0].sum(0)
    once = _direct_albedo(f64(slope), f64(0.0), UNCORRELATED, Quadrature(20, 14, 5.5), nodes)
    total = once + (modes * (nodes.solid_angle * nodes.cos)).sum(-1)
    assert (total - 1).abs().max() < 1e-4


@pytest.mark.parametrize(("sigma", "orders", "bar"), [(10, 14, 2e-5), (40, 14, 2e-5), (60, 24, 1e-3)])
def test_balanced_bounces_return_all_light(sigma, orders, bar):
    slope = rms_slope_from_sigma(f64(math.radians(sigma)))
    nodes = polar_nodes(14, slope)
    for occlusion in (0.0, 1.0, 1.6):
        settings = (slope, f64(occlusion), SMOOTH_HEIGHTFIELD, QUADRATURES[240])
        modes = bounce_modes(*settings, polar=14, orders=orders)[:, 0].sum(0)
        total = _direct_albedo(*settings, nodes) + (modes * (nodes.solid_angle * nodes.cos)).sum(-1)
        assert (total - 1).abs().max() < bar


def test_bounces_are_reciprocal():
    modes = bounce_modes(f64(0.5), f64(1.0), SMOOTH_HEIGHTFIELD, QUADRATURES[160], polar=6, orders=4)
    assert_close(modes, modes.mT, rtol=1e-12, atol=1e-15)


# Printed in the sheet: rms slopes to their last digit.
@pytest.mark.parametrize(
    ("degrees", "slope"),
    [(5, 0.0880), (10, 0.1807), (20, 0.3975), (30, 0.6700), (40, 0.9326), (45, 1.0402), (60, 1.2689), (90, 1.482)],
)
def test_rms_slope_of_sigma(degrees, slope):
    sigma = f64(math.radians(degrees))
    assert rms_slope_from_sigma(sigma).item() == pytest.approx(slope, abs=6e-5)
    assert sigma_from_rms_slope(rms_slope_from_sigma(sigma)).item() == pytest.approx(sigma.item(), rel=1e-12)


def test_equal_mean_square_angles_by_dense_sums():
    for sigma in (0.05, 0.5, 1.5):
        slope = rms_slope_from_sigma(f64(sigma)).item()
        theta = (np.arange(400_000) + 0.5) * (math.pi / 2 / 400_000)
        mass = np.exp(-((theta / sigma) ** 2) / 2) * np.sin(theta)
        r = (np.arange(400_000) + 0.5) * (12 / 400_000)
        squares = (r * np.exp(-r * r / 2) * np.arctan(slope * r) ** 2).sum() * (12 / 400_000)
        assert squares == pytest.approx((mass * theta**2).sum() / mass.sum(), rel=1e-8)


def test_conversions_are_smooth_from_zero_on():
    sigma = f64([0.0, 1e-9, 0.3, 1.2]).requires_grad_()
    assert rms_slope_from_sigma(sigma)[0] == 0
    (slope,) = torch.autograd.grad(rms_slope_from_sigma(sigma).sum(), sigma)
    assert_close(slope[:2], f64([1.0, 1.0]), rtol=1e-9, atol=0)
    inside = sigma[2:].detach().requires_grad_()
    assert torch.autograd.gradcheck(rms_slope_from_sigma, inside, check_forward_ad=True, atol=1e-7)
    assert torch.autograd.gradgradcheck(rms_slope_from_sigma, inside, atol=1e-6)
    assert_close(rms_slope_from_beckmann_alpha(f64(0.5)), f64(0.5 / math.sqrt(2)), rtol=1e-15, atol=0)


def test_conversions_refuse_what_has_no_counterpart():
    with pytest.raises(ValueError, match=r"sigma_from_rms_slope: rms_slope must lie in \[0, 1\.482\]"):
        sigma_from_rms_slope(f64(1.483))
    with pytest.raises(ValueError, match=r"rms_slope_from_sigma: sigma must lie in \[0, 1\.571\] rad"):
        rms_slope_from_sigma(f64(-0.1))
