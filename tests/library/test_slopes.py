"""Slope distributions: shares, moments and samples of the Gaussian and of others."""

import math

import numpy as np
import pytest
import torch
from helpers.planes import f64, random_plane

from torchbrdf import gaussian_weights, sample_slope, shared_slopes, tabulated_weights
from torchbrdf.models.oren_nayar.azimuth import direct_mean
from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.slopes import gaussian_density, gaussian_moments

F64 = torch.float64


@pytest.mark.parametrize(("count", "largest", "rms"), [(16, 2e-2, 1e-3), (48, 5e-4, 5e-5)])
@pytest.mark.parametrize("degrees", [2.0, 3.5, 5.0, 10.0, 20.0, 40.0, 70.0, 90.0])
def test_shared_slopes_meet_their_bars(count, largest, rms, degrees):
    plane = random_plane(400)
    (sigma,) = f64(math.radians(degrees))
    angle = torch.tensor(shared_slopes(count), dtype=F64)
    images = direct_mean(SlopePlane(*(field[:, None] for field in plane)), cos_slope=angle.cos(), tan_slope=angle.tan())
    error = (images * gaussian_weights(sigma, nodes=count)).sum(-1) / converged(plane, sigma, order=4).direct - 1
    assert error.abs().max() < largest
    assert error.square().mean().sqrt() < rms


def test_gaussian_moments_against_dense_sum():
    for sigma in (0.01, 0.2, 0.9, 0.5 * math.pi):
        x, weight = np.polynomial.legendre.leggauss(2000)
        theta = 0.25 * math.pi * (x + 1) * min(1.0, 14 * sigma)
        mass = 0.25 * math.pi * min(1.0, 14 * sigma) * weight * np.exp(-0.5 * (theta / sigma) ** 2) * np.sin(theta)
        total, second = gaussian_moments(f64(sigma)[0])
        assert total.item() * sigma**2 == pytest.approx(mass.sum(), rel=1e-12)
        assert second.item() * sigma**2 == pytest.approx((mass * theta**2).sum() / mass.sum(), rel=1e-12)


def test_other_distributions():
    angle = torch.tensor(shared_slopes(24), dtype=F64)
    (sigma,) = f64(0.5)
    torch.testing.assert_close(
        tabulated_weights(torch.exp(-0.5 * (angle[1:] / sigma) ** 2), nodes=24),
        gaussian_weights(sigma, nodes=24),
        rtol=1e-6,
        atol=1e-9,
    )


def test_samples_follow_the_distribution():
    u = torch.linspace(0, 1 - 1e-6, 101, dtype=F64)
    x, weight = gauss_legendre(64, u)
    for sigma in f64(0.02, 0.4, 1.5):
        angle = sample_slope(u, sigma)
        below = angle * (weight * gaussian_density(angle[:, None] * x, sigma)).sum(-1)
        torch.testing.assert_close(below, u, rtol=0, atol=1e-12)
