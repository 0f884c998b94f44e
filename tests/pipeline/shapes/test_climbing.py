"""Bounds of profiles leave out nothing: against every chord of the profile, one by one."""

import math

import numpy as np
import pytest
import torch

from inverse import Revolution
from inverse.shapes import lifted

D = torch.float64


def wavy(seed: int, steps: int) -> Revolution:
    """A random profile of three waves, with grooves and lips."""
    rng = np.random.default_rng(seed)
    height, phase, wave = rng.normal(size=3) * 0.12, rng.uniform(0, 6, 3), np.array([3.0, 6.0, 11.0])

    def radius(y):
        return 0.05 + np.abs(0.6 + (height * np.sin(np.multiply.outer(y, wave) + phase)).sum(-1))

    return Revolution(radius, lambda y: 0 * y, -1.0, 0.8, steps=steps)


def dips(solid, origin, direction, reach):
    """How deep rays come below the profile (ray,): r^2 of the chord less the squared distance from the axis, at 40
    points of each stretch that a ray has beside a chord."""
    y, dy = origin[:, 1], direction[:, 1]
    nodes = np.linspace(solid.low, solid.high, solid.steps + 1)
    ends = np.stack((y, (y + np.minimum(reach, 10.0) * dy)))
    deepest = np.full(len(origin), -np.inf)
    for ray in range(len(origin)):
        low, high = np.sort(ends[:, ray]).clip(solid.low, solid.high)
        if low == high:
            continue
        corners = np.concatenate(([low], nodes[(nodes > low) & (nodes < high)], [high]))
        heights = (corners[:-1, None] + np.diff(corners)[:, None] * np.linspace(0, 1, 40)).ravel()
        t = (heights - y[ray]) / dy[ray]
        beside = origin[ray] + t[:, None] * direction[ray]
        squared = np.interp(heights, corners, solid.radius(corners) ** 2)
        deepest[ray] = (squared - beside[:, 0] ** 2 - beside[:, 2] ** 2).max()
    return deepest


@pytest.mark.parametrize("steps", [256, 5])
@pytest.mark.parametrize("distance", [math.inf, 0.9])
def test_rays_are_blocked_where_they_dip_below_a_chord(steps, distance):
    for seed in range(4):
        solid, g = wavy(seed, steps), torch.Generator().manual_seed(seed)
        wall = solid.patches(400)
        pick = torch.randint(len(wall.points), (300,), generator=g)
        away = 1 + 0.3 * torch.rand(300, 1, dtype=D, generator=g) * torch.tensor([1.0, 0.0, 1.0], dtype=D)
        origin = lifted(wall.points[pick], wall.normals[pick]) * away
        direction = torch.nn.functional.normalize(torch.randn(300, 3, dtype=D, generator=g), dim=-1)
        reach = torch.full((300,), distance, dtype=D) * torch.rand(300, dtype=D, generator=g)
        depth = torch.from_numpy(dips(solid, origin.numpy(), direction.numpy(), reach.numpy()))
        blocked = solid.blocks(origin, direction, reach)
        sure = depth.abs() > 1e-6
        assert torch.equal(blocked[sure], depth[sure] > 0)
        assert sure.double().mean() > 0.9
        assert 30 < blocked.sum() < 270


def test_a_direction_for_all_is_one_for_each():
    solid = wavy(4, 64)
    wall = solid.patches(900)
    start, g = lifted(wall.points, wall.normals), torch.Generator().manual_seed(0)
    for direction in torch.nn.functional.normalize(torch.randn(6, 3, dtype=D, generator=g), dim=-1):
        shared = solid.blocks(start, direction)
        each = torch.stack([solid.blocks(k, direction) for k in start[::150]])
        assert torch.equal(shared[::150], each)
        assert torch.equal(shared, solid.blocks(start, direction.expand(start.shape)))
