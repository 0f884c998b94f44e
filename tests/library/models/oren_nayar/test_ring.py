"""Coordinates of the fitted surface against what their names say, with angles and vectors on the disc."""

import math

import numpy as np
import pytest
import torch
from helpers.planes import f64
from numpy.polynomial import chebyshev as numpy_chebyshev
from torch.testing import assert_close

from torchbrdf import Cosines
from torchbrdf.models.oren_nayar.ring import (
    KAPPA,
    KNEE,
    LEVEL,
    Ring,
    chebyshev,
    chebyshev_slope,
    contract,
    knee,
    ring,
)

RNG = np.random.default_rng(3)
ANGLES = [*(RNG.uniform(0, (1.55, 1.55, math.pi)) for _ in range(20)), (0.0, 1.0, 0.0)]


def by_angles(theta_i, theta_r, delta, sigma):
    """The fields of `Ring`: each direction is a point of the disc, at w = u/sqrt(1 + u^2) with u = z tan(theta)."""
    z = KAPPA * sigma / math.sqrt(1 + (sigma / LEVEL) ** 2)
    u = z * np.tan([theta_i, theta_r])
    w = u / np.sqrt(1 + u * u)
    v = 1 / np.sqrt(1 + u * u)
    towards = np.array([[1.0, 0.0], [math.cos(delta), math.sin(delta)]])
    light, view = w[:, None] * towards
    first, second = (w**3 / v)[:, None] * towards  # of length T = w^3/v
    common = (np.linalg.norm(first) + np.linalg.norm(second) - np.linalg.norm(first - second)) / 2
    return (
        light @ view,
        (1 - v).sum(),
        (1 - v).prod(),
        np.linalg.norm(light - view),
        np.linalg.norm(light + view),
        common,
    )


@pytest.mark.parametrize("sigma", [0.05, 0.5, 1.4])
@pytest.mark.parametrize("angles", ANGLES)
def test_fields_are_what_they_are_called(angles, sigma):
    theta_i, theta_r, delta = angles
    light, view = math.cos(theta_i), math.cos(theta_r)
    phase = light * view + math.sin(theta_i) * math.sin(theta_r) * math.cos(delta)
    got = ring(Cosines.from_products(*f64(light, view, phase)), f64(sigma)[0])
    expected = by_angles(theta_i, theta_r, delta, sigma)
    for name, value, right in zip(Ring._fields, got, expected, strict=True):
        assert value.item() == pytest.approx(right, rel=1e-7, abs=1e-9), name


def test_all_are_zero_without_roughness_and_finite_at_the_horizon():
    light, view, phase = f64([0.5, 0.0, 1.0], [0.8, 1e-3, 1.0], [0.1, 0.2, 1.0])
    smooth = ring(Cosines.from_products(light[::2], view[::2], phase[::2]), torch.zeros((), dtype=torch.float64))
    assert all((field == 0).all() for field in smooth)
    rim = ring(Cosines.from_products(light[1], view[1], phase[1]), f64(0.7)[0])
    assert all(field.isfinite().all() for field in rim)


def test_series_in_the_roughness():
    sigma = torch.linspace(0, 1.5, 12, dtype=torch.float64)
    x = knee(sigma)
    assert_close(x, sigma**2 / (sigma**2 + KNEE**2))
    for degree, (value, slope) in enumerate(zip(chebyshev(x, 6), chebyshev_slope(x, 6), strict=True)):
        coefficients = [0.0] * degree + [1.0]
        y = 2 * x.numpy() - 1
        assert_close(value, torch.from_numpy(numpy_chebyshev.chebval(y, coefficients)))
        derivative = 2 * numpy_chebyshev.chebval(y, numpy_chebyshev.chebder(coefficients))
        assert_close(slope, torch.from_numpy(np.broadcast_to(derivative, y.shape).copy()))


def test_nested_sum_is_the_sum_of_its_terms():
    generator = torch.Generator().manual_seed(2)
    fields = Ring(*torch.rand(6, 10, dtype=torch.float64, generator=generator))
    terms = [
        ("1", 0, 0, 0),
        ("1", 2, 1, 0),
        ("1", 0, 3, 1),
        ("D", 1, 0, 0),
        ("P", 0, 0, 2),
        ("G", 3, 1, 1),
        ("G", 0, 0, 0),
    ]
    weights = torch.rand(len(terms), 10, dtype=torch.float64, generator=generator)
    factor = {"1": 1.0, "D": fields.apart, "P": fields.opposite, "G": fields.common}
    expected = sum(
        weight * factor[name] * fields.along**i * fields.depth**j * fields.both**k
        for (name, i, j, k), weight in zip(terms, weights, strict=True)
    )
    assert_close(contract(fields, terms, list(weights)), expected)
