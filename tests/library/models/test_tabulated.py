"""Measured reflectance in a table: its angles, its interpolation, what it refuses."""

import math

import pytest
import torch
from helpers.probes import doubles, few, held
from torch.testing import assert_close

from torchbrdf import GGX, Cosines, Lambert, TabulatedBRDF, rusinkiewicz_angles


def test_rusinkiewicz_angles_are_those_of_rotated_vectors():
    normal, light, view = few()
    h = torch.nn.functional.normalize(light + view, dim=-1)
    x = torch.nn.functional.normalize(h * (h * normal).sum(-1, keepdim=True) - normal, dim=-1)
    y = torch.linalg.cross(h, x)
    phi = torch.atan2((light * y).sum(-1), (light * x).sum(-1)).abs()
    expected = ((normal * h).sum(-1).acos(), (light * h).sum(-1).acos(), torch.minimum(phi, math.pi - phi))
    for got, value in zip(rusinkiewicz_angles(Cosines.of(normal, light, view)), expected, strict=True):
        assert_close(got, value, rtol=0, atol=1e-7)


def test_tabulated_is_linear_in_its_angles():
    nodes = (6, 5, 4)
    for power in (1.0, 2.0):
        axes = [torch.linspace(0, 1, n, dtype=torch.float64) for n in nodes]
        th, td, pd = torch.meshgrid(
            *(a**p * math.pi / 2 for a, p in zip(axes, (power, 1, 1), strict=True)), indexing="ij"
        )
        values = torch.stack((0.2 + th, 1 + 2 * td + 0.5 * pd), -1)
        got = TabulatedBRDF(values, half_power=power)(*few())
        h, d, p = rusinkiewicz_angles(Cosines.of(*few()))
        assert_close(got, torch.stack((0.2 + h, 1 + 2 * d + 0.5 * p), -1), rtol=1e-12, atol=0)


def test_tabulated_converges_to_its_model():
    brdf = GGX(alpha=held(0.4))
    directions = few(500, 60.0)
    errors = [
        (TabulatedBRDF.of(brdf, nodes=(n, n, n // 2))(*directions) - brdf(*directions)).abs().mean() for n in (20, 40)
    ]
    assert errors[1] < errors[0] / 2.5
    assert_close(TabulatedBRDF.of(Lambert(albedo=held(0.5)), nodes=(2, 2, 1)).values.max(), doubles(0.5 / math.pi))


@pytest.mark.parametrize(
    ("values", "error", "match"),
    [
        (torch.ones(3, 3, 3), ValueError, "shape"),
        (torch.ones(1, 3, 3, 1), ValueError, "theta_h >= 2"),
        (-torch.ones(2, 2, 2, 1), ValueError, "8 of 8 are not"),
        (torch.full((2, 2, 2, 1), math.nan), ValueError, "not negative"),
        (torch.ones(2, 2, 2, 1).half(), TypeError, "float16"),
    ],
)
def test_tabulated_refuses(values, error, match):
    with pytest.raises(error, match=match):
        TabulatedBRDF(values)
    with pytest.raises(ValueError, match="half_power must be positive"):
        TabulatedBRDF(torch.ones(2, 2, 2, 1), half_power=0.0)
