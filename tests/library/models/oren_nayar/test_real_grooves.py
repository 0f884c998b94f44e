"""Real grooves, traced. Each comparison allows 4.5 standard errors: with 24 of them the false-alarm rate is below
2e-4.
"""

import math

import numpy as np
import pytest
import torch
from helpers.groove_tracer import trace

from torchbrdf import RoughSurface, UnidirectionalVCavities, fixed

PATHS = 200_000
ALBEDO = 0.9
UP = np.array([0.0, 0.0, 1.0])


def number(value):
    return torch.tensor(value, dtype=torch.float64)


def vector(theta, phi):
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def check(traced, direct, two, higher):
    """1, 2 and all bounces against their expectations."""
    totals = (traced[:, 0], traced[:, :2].sum(1), traced.sum(1))
    for values, expected in zip(totals, (direct, direct + two, direct + two + higher), strict=True):
        error = values.std() / math.sqrt(values.size)
        assert abs(values.mean() - expected) < 4.5 * error + 1e-9, (values.mean(), expected, error)


@pytest.mark.parametrize(
    ("slope", "light", "view"),
    [
        (0.5, (1.2, 0.0), (1.3, 0.3)),
        (0.9, (0.9, 2.8), (1.0, 0.2)),
        (1.2, (0.3, 0.5), (0.8, 2.0)),
        (1.35, (0.2, 0.1), (0.1, 2.0)),
    ],
)
def test_aligned_grooves(slope, light, view):
    rng = np.random.default_rng(1)
    light, view = vector(*light), vector(*view)
    traced = trace(light, view, np.full(PATHS, slope), np.zeros(PATHS), albedo=ALBEDO, bounces=60, rng=rng)
    grooves = UnidirectionalVCavities(albedo=fixed(number(ALBEDO)), slope=fixed(number(slope)), bounces="all", modes=16)
    found = grooves.components(*(torch.from_numpy(v) for v in (UP, light, view)), tangent=torch.eye(3).double()[0])
    check(traced, *(part.item() for part in found.values()))


@pytest.mark.parametrize("sigma", [0.35, 0.9])
@pytest.mark.parametrize(("light", "view"), [((1.2, 0.0), (1.25, 0.4)), ((1.0, 0.0), (1.3, 2.7))])
def test_gaussian_slopes(sigma, light, view):
    rng = np.random.default_rng(2)
    slope = rng.uniform(0, 0.5 * math.pi, 60 * PATHS // 4)
    slope = slope[rng.uniform(size=slope.size) * sigma < np.exp(-0.5 * (slope / sigma) ** 2) * np.sin(slope)][
        : PATHS // 2
    ]
    light, view = vector(*light), vector(*view)
    traced = trace(light, view, slope, rng.uniform(0, 2 * math.pi, slope.size), albedo=ALBEDO, bounces=60, rng=rng)
    surface = RoughSurface(
        albedo=fixed(number(ALBEDO)), sigma=number(sigma), nodes=32, order=12, bounces="all", modes=12
    )
    found = surface.components(*(torch.from_numpy(v) for v in (UP, light, view)))
    check(traced, *(part.item() for part in found.values()))
