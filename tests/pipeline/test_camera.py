"""Rays, solids and cameras: what a pixel shows, against projection, closed forms and each other."""

import math

import numpy as np
import pytest
import torch

from inverse import (
    Cuboid,
    Cylinder,
    Distant,
    Group,
    Plane,
    Revolution,
    Scene,
    Sphere,
    cuboid,
    cylinder,
    fit,
    orthographic,
    perspective,
    pinhole,
    render,
    sphere,
    vase,
)  # fmt: skip
from torchbrdf import OrenNayar

D = torch.float64
# an ellipsoid of half axes 0.4, 0.8, 0.4: a profile whose hits have a closed form
ELLIPSOID = Revolution(
    lambda y: 0.4 * np.sqrt(np.maximum(1 - (y / 0.8) ** 2, 0)),
    lambda y: -0.4 * (y / 0.64) / np.sqrt(np.maximum(1 - (y / 0.8) ** 2, 1e-12)),
    -0.8,
    0.8,
)
SOLIDS = {
    "sphere": Sphere(0.7, (0.1, -0.2, 0.3)),
    "cylinder": Cylinder(0.5, 0.6),
    "cuboid": Cuboid((0.4, 0.5, 0.3), 30.0, 20.0),
    "vase": vase(8, 8).solid,
    "group": Group((Sphere(0.3, (-0.4, 0, 0)), Cuboid((0.2, 0.2, 0.2), 10.0))),
}


def rays(count, seed=0):
    """From a sphere of radius 4 towards points near the origin."""
    generator = torch.Generator().manual_seed(seed)
    origin = 4 * torch.nn.functional.normalize(torch.randn(count, 3, dtype=D, generator=generator), dim=-1)
    target = 0.6 * torch.randn(count, 3, dtype=D, generator=generator)
    return origin, torch.nn.functional.normalize(target - origin, dim=-1)


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


def test_plane_is_hit_from_above_only():
    plane = Plane((0.0, 2.0, 0.0), (0.0, -0.5, 0.0))
    origin = torch.tensor([[0, 1, 0], [0, -1, 0], [0, 1, 0]], dtype=D)
    direction = torch.tensor([[0.6, -0.8, 0], [0, 1, 0], [0.6, 0.8, 0]], dtype=D)
    assert plane.hit(origin, direction).tolist() == [pytest.approx(1.5 / 0.8), math.inf, math.inf]


@pytest.mark.parametrize("make", [sphere, cylinder, vase, cuboid])
def test_a_telephoto_camera_sees_the_orthographic_image(make):
    flat = make(24, 20, dtype=D)
    far = perspective(flat.solid, pinhole(24, 20, field_of_view=0.01), dtype=D)
    both = flat.mask & far.mask
    assert (flat.mask != far.mask).sum() <= 2
    assert (flat.normals - far.normals)[both].norm(dim=-1).median() < 1e-3
    assert (flat.points - far.points)[both].norm(dim=-1).median() < 1e-3


@pytest.mark.parametrize("samples", [1, 3])
def test_points_project_onto_their_pixels(samples):
    """kornia's own projection of what each pixel shows gives that pixel back."""
    camera = pinhole(18, 14, field_of_view=50)
    surface = perspective(Sphere(0.8), camera, samples=samples, dtype=D)
    projected = camera.project(surface.points[surface.mask])
    rows, columns = surface.mask.nonzero().unbind(-1)
    wanted = (torch.stack((columns, rows), -1).to(D) + 0.5) / samples - 0.5
    torch.testing.assert_close(projected, wanted, rtol=0, atol=1e-9)
    away = torch.tensor([0, 0, 1 / math.tan(math.radians(25))], dtype=D) - surface.points[surface.mask]
    torch.testing.assert_close(surface.view[surface.mask], away / away.norm(dim=-1, keepdim=True))
    torch.testing.assert_close(surface.points[surface.mask].norm(dim=-1), torch.full_like(projected[:, 0], 0.8))


def test_perspective_shows_less_of_a_sphere():
    """From a distance d a sphere of radius r shows the cap within acos(r/d) and the silhouette asin(r/d)."""
    surface = perspective(Sphere(0.5), pinhole(200, 200, field_of_view=60, distance=2.0), dtype=D)
    cap = surface.points[surface.mask][:, 2].min().item()
    assert 0.125 < cap < 0.125 + 0.04  # the edge of the cap lies between two pixels
    half_width = surface.mask.any(0).sum().item() / 200 * math.tan(math.radians(30))
    assert half_width == pytest.approx(math.tan(math.asin(0.25)), abs=0.006)


def test_orthographic_group_shows_the_nearer_solid():
    group = Group((Sphere(0.5), Plane((0.0, 0.0, 1.0), (0.0, 0.0, -0.5))))
    surface = orthographic(group, 41, 41, dtype=D)
    assert surface.mask.all()
    assert surface.points[20, 20, 2].item() == pytest.approx(0.5, abs=1e-3)
    assert surface.points[0, 0, 2].item() == pytest.approx(-0.5)
    assert surface.normals[0, 0].tolist() == [0, 0, 1]


def test_fit_through_a_pinhole():
    surface = perspective(vase(8, 8).solid, pinhole(40, 40, field_of_view=40), dtype=D)
    scene = Scene(surface, [Distant.from_angle(0), Distant.from_angle(30)])
    truth = OrenNayar(albedo=torch.tensor(0.7, dtype=D), sigma=torch.tensor(0.6, dtype=D))
    result = fit(scene, render(scene, truth).detach(), OrenNayar(albedo=0.4, sigma=0.3))
    assert result.parameters["sigma"].item() == pytest.approx(0.6, rel=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pinhole(4, 4, field_of_view=180), r"field_of_view must lie in \(0, 180\) degrees; found 180"),
        (lambda: pinhole(0, 4), "height and width must be whole numbers of at least 1; found 0 and 4"),
        (lambda: pinhole(4, 4, distance=-1.0), "distance must be positive and finite"),
        (lambda: perspective(Sphere(0.5, (5.0, 0, 0)), pinhole(4, 4)), "mask is empty"),
        (lambda: Sphere(-1.0), r"Sphere\.radius must be positive and finite; found -1"),
        (lambda: Cylinder(1.0, 0.0), r"Cylinder\.radius and half_height"),
        (lambda: Cuboid((1.0, 0.0, 1.0)), r"Cuboid\.half_sizes must be positive"),
        (lambda: Plane((0.0, 0.0, 0.0)), r"Plane\.normal_vector must be finite and not 0"),
        (lambda: Group(()), r"Group\.solids must hold at least one"),
    ],
)
def test_bad_cameras_and_solids(make, message):
    with pytest.raises(ValueError, match=message):
        make()
