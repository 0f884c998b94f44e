"""Boxes and the starts of rays, by trying many points along each ray and by the rounding of float32."""

import pytest
import torch
from helpers.rays import rays

from inverse.shapes.rays import box, lifted, slab

D = torch.float64
SIZES = torch.tensor([0.9, 0.5, 1.4], dtype=D)


def some_along_the_axes(count):
    """Rays of which every third runs along an axis, so that two coordinates never change."""
    origin, direction = rays(count, seed=3)
    axes = torch.eye(3, dtype=D).repeat(count // 9 + 1, 1)[: len(direction[::3])]
    aside = 0.6 * origin[::3] / origin[::3].norm(dim=-1, keepdim=True) * (1 - axes) * 2
    origin[::3], direction[::3] = aside - 5 * axes, axes
    return origin, direction


@pytest.mark.parametrize("backwards", [1, -1])
def test_a_point_is_inside_between_entry_and_exit(backwards):
    """By the definition alone: |coordinate| < size at distances along the ray, before it and behind."""
    origin, direction = some_along_the_axes(300)
    direction = backwards * direction
    enter, leave = box(origin, direction, SIZES)
    distance = torch.linspace(-8, 8, 3001, dtype=D)[:, None]
    points = origin + distance[..., None] * direction
    inside = (points.abs() < SIZES).all(-1)
    sure = ((distance - enter).abs() > 1e-9) & ((distance - leave).abs() > 1e-9)
    assert torch.equal(inside[sure], ((enter < distance) & (distance < leave))[sure])
    assert 50 < int(inside.any(0).sum()) < 290


def test_a_parallel_ray_is_between_the_walls_for_ever_or_never():
    start, along = torch.tensor([0.2, -0.3, 0.3, 2.0], dtype=D), torch.zeros(4, dtype=D)
    enter, leave = slab(start, along, 0.3)
    assert (enter < leave).tolist() == [True, False, False, False]
    assert (enter[0].item(), leave[0].item()) == (-torch.inf, torch.inf)


@pytest.mark.parametrize("far", [1.0, 1e3])
def test_rays_start_outside_whatever_the_points_are_stored_in(far):
    """Points of a unit ball far from the origin: float32 moves them by up to 6e-8 of their coordinates."""
    generator = torch.Generator().manual_seed(0)
    normals = torch.nn.functional.normalize(torch.randn(2000, 3, dtype=D, generator=generator), dim=-1)
    centre = torch.tensor([far, -far, 0.5 * far], dtype=D)
    for points in (centre + normals, (centre + normals).float()):
        start = lifted(points, normals.to(points.dtype))
        assert start.dtype == D
        above = (start - centre).norm(dim=-1) - 1
        assert above.min() > 0
        assert above.max() < 3e-5 * (far + 1)
