"""Patches make up the surface of their solid."""

import math

import numpy as np
import pytest
import torch

from inverse import Cuboid, Cylinder, Plane, Sphere, vase
from inverse.scene.surface import vase_profile

D = torch.float64


def test_patches_have_the_surface_of_their_solid():
    y = np.linspace(-0.92, 0.92, 20001)
    r = vase_profile()(y)
    wall = 2 * math.pi * r * np.sqrt(1 + vase_profile()(y, 1) ** 2)
    whole = ((wall[1:] + wall[:-1]) / 2 * np.diff(y)).sum() + math.pi * (r[0] ** 2 + r[-1] ** 2)
    for solid, expected, within in (
        (Sphere(0.5), math.pi, 1e-9),
        (Cylinder(0.5, 0.3), 1.1 * math.pi, 1e-9),
        (Cuboid((0.5, 0.2, 0.3), 20.0, 10.0), 8 * (0.1 + 0.06 + 0.15), 1e-9),
        (vase(8, 8).solid, whole, 5e-3),  # frustums of 22 rings
    ):
        points, normals, areas = solid.patches(500)
        assert areas.sum().item() == pytest.approx(expected, rel=within)
        torch.testing.assert_close(solid.normal(points), normals)
        assert 300 < len(points) < 800
        # closed surfaces: their normals add up to nothing
        assert (areas[:, None] * normals).sum(0).abs().max() < 5e-3 * expected


def test_a_plane_takes_part_far_out():
    """In a disc of 1000 half sizes under the middle of what stands on it."""
    above = Sphere(0.5).patches(2000).points
    points, normals, areas = Plane((0.0, 0.6, 0.8), (0.0, 1.0, 0.0)).patches_near(above, 300)
    assert areas.sum().item() == pytest.approx(math.pi * 500**2, rel=0.01)
    assert ((points - torch.tensor([0.0, 1.0, 0.0], dtype=D)) @ normals[0]).abs().max() < 1e-9
    middle = 0.6 * normals[0]  # the plane's point nearest to the sphere's centre
    distances = (points - middle).norm(dim=-1)
    assert distances.min() < 0.2
    # all patches but the last reach half way between the last two
    reached = (distances[-1] + distances[-2]).item() / 2
    assert areas[:-1].sum().item() == pytest.approx(math.pi * reached**2, rel=0.02)
