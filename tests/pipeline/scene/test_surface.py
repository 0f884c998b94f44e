"""Normals, points and coverage of every shape against analytic, autograd and finite-difference ones."""

import math

import pytest
import torch

from inverse import Group, Plane, Sphere, cuboid, cylinder, orthographic, side_by_side, sphere
from inverse.scene.surface import Surface, pixel_average, pixel_grid, plane, revolution, vase, vase_profile

D = torch.float64
SURFACES = {
    "vase": lambda **k: vase(40, 30, **k),
    "sphere": lambda **k: sphere(40, 30, radius=0.7, centre=(0.1, -0.2), **k),
    "cylinder": lambda **k: cylinder(40, 30, **k),
    "plane": lambda **k: plane(40, 30, normal=(0.3, -0.2, 0.9), **k),
}


@pytest.fixture(params=SURFACES)
def make(request):
    return SURFACES[request.param]


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("dtype", [torch.float32, D])
def test_unit_normals_that_face_the_camera(make, samples, dtype):
    surface = make(samples=samples, dtype=dtype)
    assert surface.normals.dtype == dtype
    assert surface.resolution == (40, 30)
    assert surface.mask.shape == (40 * samples, 30 * samples)
    eps = torch.finfo(dtype).eps
    torch.testing.assert_close(
        surface.normals.norm(dim=-1), torch.ones_like(surface.mask, dtype=dtype), rtol=0, atol=4 * eps
    )
    assert (surface.normals[surface.mask][:, 2] >= 0).all()
    off = surface.normals[~surface.mask]
    assert (off == off.new_tensor([0.0, 0.0, 1.0])).all()


def test_normals_are_perpendicular_to_the_surface(make):
    """Central differences of the points, at a fine grid: tangents of the surface the points lie on."""
    surface = make(samples=16, dtype=D)
    points, normals, mask = surface.points, surface.normals, surface.mask
    across = points[1:-1, 2:] - points[1:-1, :-2]
    along = points[2:, 1:-1] - points[:-2, 1:-1]
    inside = mask[1:-1, 1:-1] & mask[1:-1, 2:] & mask[1:-1, :-2] & mask[2:, 1:-1] & mask[:-2, 1:-1]
    n = normals[1:-1, 1:-1]
    inside &= n[..., 2] > 0.5  # the error, pitch^2/6 times the third derivative, grows as cos^-5 towards the limb
    assert inside.sum() > 0.3 * mask.sum()
    by_differences = torch.linalg.cross(across, along.neg())  # right x up = towards the camera
    by_differences = by_differences / by_differences.norm(dim=-1, keepdim=True)
    assert (by_differences - n)[inside].abs().max() < 2e-3


def test_sphere_is_analytic():
    surface = sphere(50, 70, radius=0.8, centre=(0.2, 0.1), dtype=D)
    x, y = pixel_grid(50, 70, dtype=D)
    nx, ny = (x - 0.2) / 0.8, (y - 0.1) / 0.8
    m = surface.mask
    assert torch.equal(m, nx**2 + ny**2 < 1)
    torch.testing.assert_close(surface.normals[m], torch.stack((nx, ny, (1 - nx**2 - ny**2).sqrt()), -1)[m])
    distance = (surface.points[m] - torch.tensor([0.2, 0.1, 0.0], dtype=D)).norm(dim=-1)
    torch.testing.assert_close(distance, torch.full_like(distance, 0.8))


def test_cylinder_is_analytic():
    surface = cylinder(50, 50, radius=0.6, half_height=0.5, dtype=D)
    x, y = pixel_grid(50, 50, dtype=D)
    m = surface.mask
    assert torch.equal(m, (x.abs() < 0.6) & (y.abs() < 0.5))
    angle = torch.asin(x[m] / 0.6)
    torch.testing.assert_close(surface.normals[m], torch.stack((angle.sin(), 0 * angle, angle.cos()), -1))


def test_plane_is_flat():
    n = torch.tensor([0.3, -0.2, 0.9], dtype=D)
    surface = plane(8, 12, normal=(0.3, -0.2, 0.9), dtype=D)
    assert surface.mask.all()
    torch.testing.assert_close(surface.normals, (n / n.norm()).expand(8, 12, 3))
    torch.testing.assert_close(surface.points @ n, torch.zeros(8, 12, dtype=D), atol=1e-15, rtol=0)


def test_vase_normals_are_the_gradient_of_its_implicit_form():
    """x^2 + z^2 = r(y)^2 with r by differences of the profile: no derivative of the spline is used."""
    surface = vase(60, 60, dtype=D)
    m = surface.mask
    x, y, z = surface.points[m].unbind(-1)
    profile = vase_profile()
    step = 1e-5
    inner = (y.abs() < 0.91).numpy()
    up, down = (torch.from_numpy(profile(y.numpy()[inner] + s)) for s in (step, -step))
    gradient = torch.stack((2 * x[inner], -(up**2 - down**2) / (2 * step), 2 * z[inner]), -1)
    expected = gradient / gradient.norm(dim=-1, keepdim=True)
    torch.testing.assert_close(surface.normals[m][inner], expected, atol=1e-7, rtol=0)
    torch.testing.assert_close(x**2 + z**2, torch.from_numpy(profile(y.numpy())) ** 2)


def test_revolution_of_a_circle_is_a_sphere():
    """Autograd gives the slope; the sphere gives the answer."""

    def radius(y):
        return (0.64 - torch.as_tensor(y) ** 2).clamp(min=0).sqrt().numpy()

    def slope(y):
        t = torch.as_tensor(y).clone().requires_grad_()
        (0.64 - t**2).clamp(min=1e-12).sqrt().sum().backward()
        return t.grad.numpy()

    turned, ball = revolution(radius, slope, 40, 40, dtype=D), sphere(40, 40, radius=0.8, dtype=D)
    assert torch.equal(turned.mask, ball.mask)
    torch.testing.assert_close(turned.normals, ball.normals, rtol=1e-9, atol=1e-9)


def test_vase_looks_like_a_vase():
    profile = vase_profile()
    foot, belly, neck, lip = (float(profile(y)) for y in (-0.9, -0.1, 0.72, 0.92))
    assert belly > 1.5 * foot > 1.5 * neck
    assert lip > neck
    mask = vase(128, 128).mask
    assert torch.equal(mask, mask.flip(1))
    rows = mask.any(1).nonzero()[:, 0]
    assert (rows.min() > 0, rows.max() < 127) == (True, True)
    assert mask[36].sum() < mask[100].sum()  # the neck is at the top of the image, so y is up


def test_y_is_up_and_x_to_the_right():
    x, y = pixel_grid(4, 6, dtype=D)
    torch.testing.assert_close(y[:, 0], torch.tensor([0.75, 0.25, -0.25, -0.75], dtype=D))
    torch.testing.assert_close(x[0], torch.tensor([-1.25, -0.75, -0.25, 0.25, 0.75, 1.25], dtype=D))
    normals = sphere(9, 9).normals
    assert normals[1, 4, 1] > 0.5
    assert normals[4, 7, 0] > 0.5


@pytest.mark.parametrize("samples", [2, 3, 5])
def test_supersampled_grid_averages_to_the_pixels(samples):
    fine = torch.stack(pixel_grid(4, 6, samples=samples, dtype=D), -1)
    torch.testing.assert_close(pixel_average(fine, samples), torch.stack(pixel_grid(4, 6, dtype=D), -1))


def test_coverage_approaches_the_disk():
    """Sum of coverages times the pixel's area -> pi r^2; the error of a binary rim falls with the samples."""
    area = math.pi * 0.8**2
    errors = [
        abs(sphere(30, 30, radius=0.8, samples=s).coverage().sum().item() * (2 / 30) ** 2 - area) for s in (1, 16)
    ]
    assert errors[1] < 1e-3
    assert errors[1] < errors[0]
    coverage = sphere(30, 30, radius=0.8, samples=4).coverage()
    assert (coverage.min(), coverage.max()) == (0, 1)
    assert ((coverage > 0) & (coverage < 1)).any()


@pytest.mark.parametrize(
    ("make_bad", "message"),
    [
        (lambda: plane(4, 4, normal=(0.0, 1.0, 0.0)), "face the camera"),
        (lambda: plane(4, 4, normal=(0.0, math.nan, 1.0)), "finite"),
        (lambda: sphere(4, 4, radius=0.01), "mask is empty"),
        (lambda: vase(0, 4), "height, width and samples must be whole numbers of at least 1; found 0, 4, 1"),
        (lambda: vase(4, 4, samples=0), "at least 1; found 4, 4, 0"),
        (lambda: surface_of(points=torch.zeros(4, 4, 2)), "trailing 3"),
        (lambda: surface_of(normals=torch.zeros(4, 3, 3)), "points and normals must be mask's shape"),
        (lambda: surface_of(samples=3), "samples must divide the array's"),
        (lambda: surface_of(mask=torch.zeros(4, 4, dtype=torch.bool)), "mask is empty"),
    ],
)
def test_bad_geometry(make_bad, message):
    with pytest.raises(ValueError, match=message):
        make_bad()


def surface_of(**changed):
    good = {
        "points": torch.zeros(4, 4, 3),
        "normals": torch.zeros(4, 4, 3),
        "mask": torch.ones(4, 4, dtype=torch.bool),
        "view": torch.tensor([0.0, 0, 1]),
        "samples": 2,
    }
    return Surface(**(good | changed))


def test_cube_turned_by_yaw_shows_two_faces():
    surface = cuboid(400, 400, yaw=30, dtype=D)
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
    surface = cuboid(64, 64, half_sizes=(0.6, 0.4, 0.3), yaw=yaw, pitch=pitch, dtype=D)
    points, normals = surface.points[surface.mask], surface.normals[surface.mask]
    distance = (points * normals).sum(-1)
    nearest = (distance[:, None] - torch.tensor([0.6, 0.4, 0.3], dtype=D)).abs().amin(1)
    assert nearest.max() < 1e-12
    assert (normals[:, 2] > 0).all()


def test_side_by_side_keeps_objects_apart_and_positions_right():
    ball, drum = sphere(50, 60, radius=0.7, dtype=D), cylinder(50, 80, dtype=D)
    both = side_by_side([ball, drum])
    assert both.resolution == (50, 140)
    # the middles of the windows stand 70 pixels apart
    centres = [both.points[:, k][both.mask[:, k]].mean(0)[0] for k in (slice(0, 60), slice(60, 140))]
    assert (centres[1] - centres[0]).item() == pytest.approx(70 * 2 / 50, abs=1e-9)
    x = both.points[0, :, 0]
    torch.testing.assert_close(x.diff(), torch.full((139,), 2 / 50, dtype=D))


def test_bad_solids():
    with pytest.raises(ValueError, match="half_sizes must be positive"):
        cuboid(8, 8, half_sizes=(0.5, 0.0, 0.5))
    with pytest.raises(ValueError, match=r"heights \[8, 16\]"):
        side_by_side([sphere(8, 8), sphere(16, 16)])


def test_orthographic_group_shows_the_nearer_solid():
    group = Group((Sphere(0.5), Plane((0.0, 0.0, 1.0), (0.0, 0.0, -0.5))))
    surface = orthographic(group, 41, 41, dtype=D)
    assert surface.mask.all()
    assert surface.points[20, 20, 2].item() == pytest.approx(0.5, abs=1e-3)
    assert surface.points[0, 0, 2].item() == pytest.approx(-0.5)
    assert surface.normals[0, 0].tolist() == [0, 0, 1]


def test_vases_of_every_size_are_one_solid():
    one, other = (vase(8, width, samples=k) for width, k in ((8, 1), (12, 2)))
    assert one.solid is other.solid
