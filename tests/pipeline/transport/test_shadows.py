"""Cast shadows against closed forms and against marching along rays from the definition of the shape."""

import math

import numpy as np
import pytest
import torch
from helpers.surfaces import masked, towards

from inverse import Distant, Group, Plane, Point, Revolution, Sphere, cuboid, cylinder, sphere, vase
from inverse.scene.surface import vase_profile
from inverse.transport.shadows import Shadows

D = torch.float64


def marched(points, normals, direction, steps=1500):
    """True where a ray, tried at many distances, comes inside the vase: nothing but its profile is used."""
    profile = vase_profile()
    blocked = np.zeros(len(points), dtype=bool)
    start, along = (points + 1e-6 * normals).numpy(), direction.numpy()
    for t in np.linspace(0, 2.4, steps)[1:]:
        x, y, z = (start + t * along).T
        radius = np.nan_to_num(profile(y))  # NaN beyond the ends
        blocked |= x * x + z * z < radius * radius
    return torch.from_numpy(blocked & (normals @ direction > 0).numpy())


@pytest.mark.parametrize(("azimuth", "elevation"), [(20, 60), (0, 75), (-60, 45), (10, -70)])
def test_vase_in_raised_light_as_marched(azimuth, elevation):
    solid, (points, normals) = vase(8, 8).solid, masked(vase(96, 96, dtype=D))
    direction = towards(azimuth, elevation)
    shadow, expected = ~Shadows(solid, points, normals).clear(direction), marched(points, normals, direction)
    assert expected.sum() > 20
    # the marching misses dips shorter than its steps: a few points at the shadow's edge
    assert (shadow & ~expected).sum() <= 0.002 * len(points)
    assert not (expected & ~shadow).any()


@pytest.mark.parametrize("azimuth", [0, 20, 75, 150])
def test_level_light_casts_no_shadow_on_the_vase(azimuth):
    solid, (points, normals) = vase(8, 8).solid, masked(vase(64, 64, dtype=D))
    assert not marched(points, normals, towards(azimuth, 0)).any()
    assert Shadows(solid, points, normals).clear(towards(azimuth, 0)).all()


def test_both_precisions_agree():
    one, other = (masked(vase(128, 128, dtype=k)) for k in (torch.float32, D))
    solid = vase(8, 8).solid
    for angles in [(20, 60), (-70, 50), (0, -60)]:
        direction = towards(*angles)
        assert torch.equal(Shadows(solid, *one).clear(direction.float()), Shadows(solid, *other).clear(direction))


@pytest.mark.parametrize("dtype", [torch.float32, D])
def test_no_speckles_on_convex_shapes(dtype):
    long = Revolution(lambda y: 0.5 * np.sqrt(1 - y * y), lambda y: -0.5 * y / np.sqrt(1 - y * y), -0.99, 0.99)
    for surface in (sphere(64, 64, dtype=dtype), cylinder(64, 64, dtype=dtype), cuboid(64, 64, pitch=20, dtype=dtype)):
        points, normals = masked(surface)
        for angles in [(0, 0), (80, 5), (100, 40), (30, 89), (-60, -30)]:
            assert Shadows(surface.solid, points, normals).clear(towards(*angles).to(dtype)).all()
    points = long.patches(1600).points
    normals = long.normal(points).to(dtype)
    for angles in [(0, 0), (80, 5), (100, 40), (30, 89), (-60, -30)]:
        assert Shadows(long, points.to(dtype), normals).clear(towards(*angles).to(dtype)).all()


RADIUS, ABOVE = 0.25, 0.4
SCENE = Group((Sphere(RADIUS, (0.0, ABOVE, 0.0)), Plane((0.0, 1.0, 0.0))))


def floor(size=121, reach=1.5):
    x, z = torch.meshgrid(*2 * (torch.linspace(-reach, reach, size, dtype=D),), indexing="ij")
    points = torch.stack((x, 0 * x, z), -1).flatten(0, 1)
    return points, torch.tensor([0.0, 1, 0], dtype=D).expand(points.shape)


def test_shadow_of_a_sphere_on_a_plane_is_an_ellipse():
    """Centre at c - l c_y/l_y, half axes R/l_y along the light and R across."""
    points, normals = floor()
    direction = towards(30, 35)
    level = direction[[0, 2]] / direction[[0, 2]].norm()
    offset = points[:, [0, 2]] + direction[[0, 2]] * ABOVE / direction[1]
    along, across = offset @ level, offset[:, 0] * level[1] - offset[:, 1] * level[0]
    form = (along * direction[1] / RADIUS) ** 2 + (across / RADIUS) ** 2
    sure = (form - 1).abs() > 1e-3
    clear = Shadows(SCENE, points, normals).clear(direction)
    assert torch.equal(clear[sure], form[sure] > 1)
    assert (~clear).sum().item() * (3 / 120) ** 2 == pytest.approx(math.pi * RADIUS**2 / direction[1].item(), rel=0.02)


def test_shadow_of_a_lamp_is_a_cone():
    points, normals = floor()
    for position in ([0.4, 1.0, 0.3], [0.0, 0.66, 0.0]):
        lamp = Point(torch.tensor(position, dtype=D))
        to_centre = torch.tensor([0.0, ABOVE, 0.0], dtype=D) - lamp.position
        arrival = next(lamp.arrivals(points))
        cosine = -(arrival.direction @ to_centre) / to_centre.norm()
        edge = math.sqrt(1 - (RADIUS / to_centre.norm().item()) ** 2)
        clear = Shadows(SCENE, points, normals).clear(arrival.direction, lamp.distance(points))
        sure = (cosine - edge).abs() > 1e-5
        assert torch.equal(clear[sure], cosine[sure] < edge)
        assert not clear.all()


def test_lamp_in_front_of_the_occluder_casts_no_shadow():
    points, normals = floor()
    lamp = Point(torch.tensor([0.02, 0.1, 0.0], dtype=D))  # between the sphere and the floor
    arrival = next(lamp.arrivals(points))
    assert Shadows(SCENE, points, normals).clear(arrival.direction, lamp.distance(points)).all()
    assert not Shadows(SCENE, points, normals).clear(arrival.direction).all()
    assert Distant.from_angle(0).distance(points) is None
