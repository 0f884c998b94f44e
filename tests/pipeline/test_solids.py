"""Boxes and groups of objects, against what their corners and faces must be."""

import math

import pytest
import torch

from inverse import cuboid, cylinder, side_by_side, sphere

DOUBLE = torch.float64


def test_cube_turned_by_yaw_shows_two_faces():
    surface = cuboid(400, 400, yaw=30, dtype=DOUBLE)
    a = math.radians(30)
    faces = {(round(math.sin(a), 9), 0.0, round(math.cos(a), 9)), (round(-math.cos(a), 9), 0.0, round(math.sin(a), 9))}
    seen = {tuple(round(k, 9) + 0.0 for k in n) for n in surface.normals[surface.mask].tolist()}
    assert seen == faces
    # width and height of the silhouette: 2 (h cos + h sin) and 2 h
    columns = surface.mask.any(0).sum().item() * 2 / 400
    assert columns == pytest.approx(math.cos(a) + math.sin(a), abs=0.011)
    assert surface.mask.any(1).sum().item() * 2 / 400 == pytest.approx(1.0, abs=0.011)


@pytest.mark.parametrize(("yaw", "pitch"), [(0, 0), (25, 0), (-40, 20), (90, 0), (10, -35)])
def test_points_lie_on_the_faces_their_normals_say(yaw, pitch):
    surface = cuboid(64, 64, half_sizes=(0.6, 0.4, 0.3), yaw=yaw, pitch=pitch, dtype=DOUBLE)
    points, normals = surface.points[surface.mask], surface.normals[surface.mask]
    distance = (points * normals).sum(-1)
    nearest = (distance[:, None] - torch.tensor([0.6, 0.4, 0.3], dtype=DOUBLE)).abs().amin(1)
    assert nearest.max() < 1e-12
    assert (normals[:, 2] > 0).all()


def test_side_by_side_keeps_objects_apart_and_positions_right():
    ball, drum = sphere(50, 60, radius=0.7, dtype=DOUBLE), cylinder(50, 80, dtype=DOUBLE)
    both = side_by_side([ball, drum])
    assert both.resolution == (50, 140)
    # the middles of the windows stand 70 pixels apart
    centres = [both.points[:, k][both.mask[:, k]].mean(0)[0] for k in (slice(0, 60), slice(60, 140))]
    assert (centres[1] - centres[0]).item() == pytest.approx(70 * 2 / 50, abs=1e-9)
    x = both.points[0, :, 0]
    torch.testing.assert_close(x.diff(), torch.full((139,), 2 / 50, dtype=DOUBLE))


def test_bad_solids():
    with pytest.raises(ValueError, match="half_sizes must be positive"):
        cuboid(8, 8, half_sizes=(0.5, 0.0, 0.5))
    with pytest.raises(ValueError, match=r"heights \[8, 16\]"):
        side_by_side([sphere(8, 8), sphere(16, 16)])
