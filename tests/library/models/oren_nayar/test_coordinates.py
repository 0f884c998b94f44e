"""Coordinates of the fitted surface against what their names say, with angles and vectors in the plane."""

import math

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from torchbrdf import Cosines
from torchbrdf.models.oren_nayar.coordinates import KAPPA, LEVEL, RETURN, coordinates, slope_squared

RNG = np.random.default_rng(3)
ANGLES = [*(RNG.uniform(0, (1.55, 1.55, math.pi)) for _ in range(20)), (0.0, 1.0, 0.0), (0.9, 0.9, 0.0)]


def cosines(theta_i: float, theta_r: float, delta: float, dtype: torch.dtype = torch.float64) -> Cosines:
    def unit(theta: float, phi: float) -> torch.Tensor:
        x = (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))
        return torch.tensor(x, dtype=dtype)

    return Cosines.of(unit(0.0, 0.0), unit(theta_i, 0.0), unit(theta_r, delta), normalize=True)


def at(c: Cosines, sigma: torch.Tensor):
    return coordinates(c.light, c.view, c.phase, c.azimuth_sine, slope_squared(sigma))


def by_angles(theta_i: float, theta_r: float, delta: float, sigma: float) -> tuple[np.ndarray, float, float]:
    """Coordinates, growth and share: each direction is a point at z tan(theta) in the plane."""
    z = KAPPA * sigma / math.sqrt(1 + (sigma / LEVEL) ** 2)
    t = z * np.tan([theta_i, theta_r])
    towards = np.array([[1.0, 0.0], [math.cos(delta), math.sin(delta)]])
    p, q = t[:, None] * towards
    shaded = t**4 / (1 + t * t) ** 1.5
    first, second = shaded[:, None] * towards
    common = shaded.sum() - np.linalg.norm(first - second)
    cosine = np.cos(np.arctan(t))
    features = (
        (1 - cosine).sum(),
        (1 - cosine).prod(),
        1 - math.cos(math.atan(np.linalg.norm(p + q))),
        1 - math.cos(math.atan(np.linalg.norm(p - q))),
        p @ q * cosine.prod(),
        common / (1 + shaded.sum()),
        math.sin(math.atan(z)) ** 2,
    )
    return np.array(features), 1 + RETURN * common, features[-1]


@pytest.mark.parametrize("sigma", [0.05, 0.5, 1.4])
@pytest.mark.parametrize("angles", ANGLES)
def test_coordinates_are_what_they_are_called(angles, sigma):
    found = at(cosines(*angles), torch.tensor(sigma, dtype=torch.float64))
    features, growth, share = by_angles(*angles, sigma)
    np.testing.assert_allclose(found.features, features, rtol=1e-7, atol=1e-9)
    assert found.growth.item() == pytest.approx(growth, rel=1e-7)
    assert found.share.item() == pytest.approx(share, rel=1e-14)


def test_all_are_zero_without_roughness(dtype):
    found = at(cosines(0.7, 1.1, 2.0, dtype), torch.zeros((), dtype=dtype))
    assert (found.features.abs() < 1e-17).all()
    assert found.growth == 1


def test_bounded_up_to_the_horizon(dtype):
    edge = torch.finfo(dtype).eps
    grazing = [[2 * edge, 2 * edge, 0.5], [2 * edge, 1e-3, 2 * edge], [1.0, -1.0, 0.2]]
    light, view, phase = torch.tensor(grazing, dtype=dtype)
    found = at(Cosines.from_products(light, view, phase), torch.full_like(light, 1.5))
    assert (found.features.abs() <= 2).all()
    assert found.growth.isfinite().all()


def test_cone_keeps_its_digits_in_float32():
    # The distance of light and view, one thousandth of a radian apart in azimuth: cosines alone know a tenth of it.
    sigma = torch.tensor(0.6)
    exact, growth, _ = by_angles(1.1, 1.1, 1e-3, 0.6)
    found = at(cosines(1.1, 1.1, 1e-3, torch.float32), sigma)
    tip, highest, _ = by_angles(1.1, 1.1, 0.0, 0.6)
    assert (found.growth.item() - highest) == pytest.approx(growth - highest, rel=2e-3)
    assert (found.features[5].item() - tip[5]) == pytest.approx(exact[5] - tip[5], rel=2e-3)


def test_one_cone_and_no_other_kink():
    # A kink leaves a second difference of the order of the step; a smooth function one of its square.
    step = 1e-4
    sigma = torch.tensor(0.8, dtype=torch.float64)
    for direction, kinked in (((1.0, 0.0), True), ((1.0, math.pi), False), ((0.4, 0.0), False), ((0.0, 1.0), False)):
        theta, delta = direction
        around = torch.stack([at(cosines(1.0, theta, delta + k * step), sigma).features for k in (-1, 0, 1)])
        bend = (around[0] - 2 * around[1] + around[2]).abs()
        assert (bend[5] > 0.1 * step) == kinked
        assert (bend[torch.arange(7) != 5] < 1e-6).all()
        assert kinked or bend[5] < 1e-6


def test_derivatives_exist_where_the_distances_vanish():
    cases = (((0.0, 0.0, 0.0), 0.7), ((0.8, 0.8, 0.0), 0.7), ((0.0, 0.9, 0.0), 0.7), ((0.5, 0.9, 1.0), 0.0))
    for angles, sigma in cases:
        c = cosines(*angles)
        given = [t.clone().requires_grad_() for t in (c.light, c.view, c.phase, c.azimuth_sine)]
        width = torch.tensor(sigma, dtype=torch.float64, requires_grad=True)
        total = coordinates(*given, slope_squared(width)).features.sum()
        first = torch.autograd.grad(total, (*given, width), create_graph=True)
        second = torch.autograd.grad(sum(first), (*given, width))
        assert all(t.isfinite() for t in (*first, *second))
        if sigma == 0:
            assert_close(first[-1], torch.zeros_like(width))
