"""Where rays meet solids, by walking along them from the definition of each shape."""

import math

import pytest
import torch
from helpers.rays import rays

from inverse import Cuboid, Cylinder, Group, Plane, Sphere, vase

D = torch.float64

SOLIDS = {
    "sphere": Sphere(0.7, (0.1, -0.2, 0.3)),
    "cylinder": Cylinder(0.5, 0.6),
    "cuboid": Cuboid((0.4, 0.5, 0.3), 30.0, 20.0),
    "vase": vase(8, 8).solid,
    "group": Group((Sphere(0.3, (-0.4, 0, 0)), Cuboid((0.2, 0.2, 0.2), 10.0))),
}


def inside(name, p):
    """Whether points are inside: written from the definition of each solid."""
    x, y, z = p.unbind(-1)
    if name == "sphere":
        return (x - 0.1) ** 2 + (y + 0.2) ** 2 + (z - 0.3) ** 2 < 0.49
    if name == "cylinder":
        return (torch.hypot(x, z) < 0.5) & (y.abs() < 0.6)
    if name == "vase":
        r = torch.as_tensor(SOLIDS["vase"].radius(y.numpy())).nan_to_num(0.0)
        return torch.hypot(x, z) < r
    if name == "group":
        box = Cuboid((0.2, 0.2, 0.2), 10.0)
        return ((x + 0.4) ** 2 + y**2 + z**2 < 0.09) | in_box(p, box)
    return in_box(p, SOLIDS["cuboid"])


def in_box(p, box):
    a, b = math.radians(box.yaw), math.radians(box.pitch)
    about_x = torch.tensor([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]], dtype=D)
    about_y = torch.tensor([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]], dtype=D)
    own = torch.linalg.solve(about_x @ about_y, p.T).T
    return (own.abs() < torch.tensor(box.half_sizes, dtype=D)).all(-1)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_hit_is_the_first_point_inside(name):
    """By walking along each ray in small steps: outside up to the hit, inside just behind it."""
    origin, direction = rays(300)
    distance, normal = SOLIDS[name].meet(origin, direction)
    steps = torch.linspace(0, 8, 4001, dtype=D)[:, None, None]
    walked = inside(name, (origin + steps * direction).reshape(-1, 3)).reshape(4001, -1)
    met = distance.isfinite()
    assert (walked.any(0) & ~met).sum() == 0
    assert 50 < met.sum() < 300
    # a ray may cut a corner between two steps: those that miss all steps stay within one of them
    first = torch.where(walked.any(0), walked.to(torch.uint8).argmax(0) * 0.002, torch.inf)
    assert (distance <= first + 1e-9).all()
    assert (first[met & walked.any(0)] - distance[met & walked.any(0)] <= 0.002 + 1e-9).all()
    # the normal faces the ray
    assert ((normal * direction).sum(-1)[met] <= 1e-9).all()
    torch.testing.assert_close(normal[met].norm(dim=-1), torch.ones(int(met.sum()), dtype=D))


@pytest.mark.parametrize("name", ["sphere", "cylinder", "cuboid", "vase"])
def test_normals_are_perpendicular_to_what_neighbouring_rays_hit(name):
    origin, direction = rays(200, seed=1)
    distance, normal = SOLIDS[name].meet(origin, direction)
    points = origin + distance[:, None] * direction
    for axis in torch.eye(3, dtype=D):
        other = origin + 1e-5 * axis
        moved = other + SOLIDS[name].hit(other, direction)[:, None] * direction
        difference = moved - points
        smooth = distance.isfinite() & (difference.norm(dim=-1) < 1e-4)  # not across an edge
        assert smooth.sum() > 20
        assert ((difference * normal).sum(-1)[smooth].abs() < 1e-8).float().mean() > 0.97


def test_plane_is_hit_from_above_only():
    plane = Plane((0.0, 2.0, 0.0), (0.0, -0.5, 0.0))
    origin = torch.tensor([[0, 1, 0], [0, -1, 0], [0, 1, 0]], dtype=D)
    direction = torch.tensor([[0.6, -0.8, 0], [0, 1, 0], [0.6, 0.8, 0]], dtype=D)
    assert plane.hit(origin, direction).tolist() == [pytest.approx(1.5 / 0.8), math.inf, math.inf]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sphere(-1.0), r"Sphere\.radius must be positive and finite; found -1"),
        (lambda: Cylinder(1.0, 0.0), r"Cylinder\.radius and half_height"),
        (lambda: Cuboid((1.0, 0.0, 1.0)), r"Cuboid\.half_sizes must be positive"),
        (lambda: Plane((0.0, 0.0, 0.0)), r"Plane\.normal_vector must be finite and not 0"),
        (lambda: Group(()), r"Group\.solids must hold at least one"),
    ],
)
def test_bad_solids(make, message):
    with pytest.raises(ValueError, match=message):
        make()
