"""Solids of revolution against profiles whose hits and shadows have a closed form."""

import numpy as np
import pytest
import torch
from helpers.rays import rays
from helpers.surfaces import towards

from inverse import Revolution
from inverse.transport.shadows import Shadows

D = torch.float64
# an ellipsoid of half axes 0.4, 0.8, 0.4: a profile whose hits have a closed form
ELLIPSOID = Revolution(
    lambda y: 0.4 * np.sqrt(np.maximum(1 - (y / 0.8) ** 2, 0)),
    lambda y: -0.4 * (y / 0.64) / np.sqrt(np.maximum(1 - (y / 0.8) ** 2, 1e-12)),
    -0.8,
    0.8,
)


def test_revolution_against_the_closed_form_of_an_ellipsoid():
    origin, direction = rays(500, seed=2)
    distance, normal = ELLIPSOID.meet(origin, direction)
    squeeze = torch.tensor([0.4, 0.8, 0.4], dtype=D)
    o, d = origin / squeeze, direction / squeeze
    a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
    root = b * b - a * c
    clear = root.abs() > 0.05  # a grazing ray may pass between two steps
    wanted = torch.where(root > 0, (-b - root.clamp(min=0).sqrt()) / a, torch.inf)
    torch.testing.assert_close(distance[clear], wanted[clear], rtol=0, atol=1e-10)
    met = clear & (root > 0)
    gradient = torch.nn.functional.normalize((origin + wanted[:, None] * direction)[met] / squeeze**2, dim=-1)
    torch.testing.assert_close(normal[met], gradient, rtol=0, atol=1e-7)


def hyperboloid(a=0.3, b=0.8, high=0.9):
    """x^2 + z^2 = a^2 + b y^2 between two heights: concave along its height, and its rays are closed forms."""
    return Revolution(lambda y: np.sqrt(a * a + b * y * y), lambda y: b * y / np.sqrt(a * a + b * y * y), -high, high)


@pytest.mark.parametrize("dtype", [torch.float32, D])
@pytest.mark.parametrize("elevation", [-80, -60, 35, 50, 65, 85])
def test_concave_solid_of_revolution_in_closed_form(elevation, dtype):
    """x^2 + z^2 - b y^2 - a^2 is 0 at the point and once more along its ray: there it enters, if between the ends."""
    a, b, high = 0.3, 0.8, 0.9
    solid = hyperboloid(a, b, high)
    y, turn = torch.linspace(-0.89, 0.89, 90, dtype=D), torch.linspace(0, 6.2, 70, dtype=D)
    y, turn = y.repeat_interleave(70), turn.repeat(90)
    r = (a * a + b * y * y).sqrt()
    points = torch.stack((r * turn.sin(), y, r * turn.cos()), -1)
    normals = points * torch.tensor([1.0, -b, 1.0], dtype=D)
    normals = normals / normals.norm(dim=-1, keepdim=True)
    direction = towards(25, elevation)
    metric = torch.tensor([1.0, -b, 1.0], dtype=D)
    first, second = 2 * (points * metric) @ direction, (direction * direction) @ metric
    again = -first / second
    height = points[:, 1] + again * direction[1]
    expected = (first > 0) & (again > 0) & (height.abs() < high)
    sure = ((height.abs() - high).abs() > 2e-3) & (first.abs() > 1e-3)
    clear = Shadows(solid, points.to(dtype), normals.to(dtype)).clear(direction.to(dtype))
    assert torch.equal(~clear[sure], expected[sure])
    assert sure.double().mean() > 0.95
    if abs(elevation) > 45:  # steeper than the cone b y^2 that it approaches
        assert expected.sum() > 50
