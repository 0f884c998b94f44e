"""Coordinates of the fitted heightfield against what they mean, with angles and vectors."""

import math

import numpy as np
import pytest
import torch
from helpers.heightfields import F64, cosines, f64
from scipy.special import erfc
from torch.testing import assert_close

from torchbrdf import SMOOTH_HEIGHTFIELD
from torchbrdf.models.heightfield.coordinates import coordinates, slope_squared
from torchbrdf.models.heightfield.fast import _FIT
from torchbrdf.models.heightfield.roughness import rms_slope_from_sigma


def test_slope_of_the_fit():
    sigma = torch.linspace(0.0, math.pi / 2, 200, dtype=F64)
    assert_close(slope_squared(sigma, _FIT.slope).sqrt(), rms_slope_from_sigma(sigma), rtol=5e-4, atol=1e-15)


def by_angles(theta_i, theta_r, delta, slope):
    """The seven coordinates to a factor each, and (1 + L_i)(1 + L_r)/(1 + D), of p = s tan(theta) in the plane."""
    t = slope * np.tan([theta_i, theta_r])
    p, q = t[0] * np.array([1.0, 0.0]), t[1] * np.array([math.cos(delta), math.sin(delta)])
    area = 1 + t * t
    # Smith's Lambda; D is the larger eigenvalue of both with what they have in common between them
    light, view = t * np.exp(-1 / (2 * t * t)) / math.sqrt(2 * math.pi) - erfc(1 / (math.sqrt(2) * t)) / 2
    z = math.sin(delta / 2) * (SMOOTH_HEIGHTFIELD.turn + SMOOTH_HEIGHTFIELD.grazing_turn / math.sqrt((t**-2.0).sum()))
    between = z / (1 + z) * math.sqrt(light * view)
    joint = np.linalg.eigvalsh([[light, between], [between, view]])[-1]
    features = (
        np.log(area).sum(),
        np.log(area).prod() / (1 + np.log(area).sum()),
        math.log(1 + (p + q) @ (p + q)),
        math.log(1 + (p - q) @ (p - q)),
        p @ q / math.sqrt(area.prod()),
        (light + view - joint) / (1 + light + view),
        slope**2 / (1 + slope**2),
    )
    return np.array(features), (1 + light) * (1 + view) / (1 + joint)


def test_coordinates_are_what_their_names_say():
    rng = np.random.default_rng(4)
    ratios = []
    for _ in range(50):
        theta_i, theta_r = rng.uniform(0.5, 1.5, 2)
        delta, slope = rng.uniform(0.1, math.pi), rng.uniform(0.4, 1.4)  # below, nothing is hidden
        c = cosines(theta_i, theta_r, delta)
        got = coordinates(c.light, c.view, c.phase, c.azimuth_sine, f64(slope**2))
        expected, masked = by_angles(theta_i, theta_r, delta, slope)
        assert got.masked.item() == pytest.approx(masked, rel=1e-7)
        assert got.share.item() == pytest.approx(expected[-1], rel=1e-14)
        ratios.append(got.features.flatten().numpy() / expected)
    factors = np.median(ratios, axis=0)
    assert (factors > 0.1).all()
    np.testing.assert_allclose(ratios, np.broadcast_to(factors, (50, 7)), rtol=1e-6)


def test_smooth_surfaces_and_the_normal_have_no_coordinates_to_speak_of():
    # without roughness all of them vanish; along the normal the azimuth does not matter
    c = cosines(0.7, 1.1, 2.0)
    smooth = coordinates(c.light, c.view, c.phase, c.azimuth_sine, f64(0.0))
    assert_close(smooth.features, torch.zeros(7, dtype=F64), rtol=0, atol=1e-30)
    assert smooth.masked == 1
    first, second = (
        coordinates(c.light, c.view, c.phase, c.azimuth_sine, f64(0.5))
        for c in (cosines(0.0, 1.1, 0.0), cosines(0.0, 1.1, 2.0))
    )
    assert_close(first.features, second.features, rtol=1e-9, atol=1e-9)
