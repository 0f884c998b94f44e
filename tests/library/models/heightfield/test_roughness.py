"""Measures of roughness of heightfields and what they convert to."""

import math

import numpy as np
import pytest
import torch
from helpers.heightfields import f64
from torch.testing import assert_close

from torchbrdf import rms_slope_from_beckmann_alpha, rms_slope_from_sigma, sigma_from_rms_slope


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
