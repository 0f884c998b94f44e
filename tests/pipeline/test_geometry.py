"""Normals of every geometry against analytic, autograd and finite-difference ones."""

import math

import pytest
import torch

from inverse.scene.maps import from_depth, from_normals
from inverse.scene.surface import (
    Surface,
    cylinder,
    pixel_average,
    pixel_grid,
    plane,
    revolution,
    sphere,
    vase,
    vase_profile,
)

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


# --- depth maps --------------------------------------------------------------------------------------------


def disk(size, radius):
    row, column = torch.meshgrid(torch.arange(size, dtype=D), torch.arange(size, dtype=D), indexing="ij")
    return column - (size - 1) / 2, (size - 1) / 2 - row, radius


def test_orthographic_depth_of_a_sphere():
    x, y, r = disk(201, 90.0)
    z = (r**2 - x**2 - y**2).clamp(min=0).sqrt()
    depth = torch.where(z > 0, 500 - z, 0.0)
    surface = from_depth(depth)
    expected = torch.stack((x, y, z), -1) / r
    inside = surface.mask & (z > 0.5 * r)
    # kornia's differences over two pixels: slope error z'''/6 <= 3/(2 r^2) / cos^5 here
    torch.testing.assert_close(surface.normals[inside], expected[inside], atol=4e-3, rtol=0)
    assert surface.view.tolist() == [0, 0, 1]


def test_perspective_depth_of_a_sphere():
    """Rays of a pinhole meet a sphere in closed form."""
    size, focal, distance, radius = 201, 400.0, 10.0, 2.0
    u, v, _ = disk(size, 0)
    ray = torch.stack((u / focal, v / focal, -torch.ones_like(u)), -1)  # z towards the camera
    centre = torch.tensor([0.0, 0.0, -distance], dtype=D)
    a, b = (ray * ray).sum(-1), ray @ centre
    root = b**2 - a * (distance**2 - radius**2)
    t = (b - root.clamp(min=0).sqrt()) / a
    depth = torch.where(root > 0, t, torch.nan)
    middle = (size - 1) / 2
    matrix = torch.tensor([[focal, 0, middle], [0, focal, middle], [0, 0, 1]], dtype=D)
    surface = from_depth(depth, matrix)
    points = t[..., None] * ray
    normals = (points - centre) / radius
    view = -ray / ray.norm(dim=-1, keepdim=True)
    inside = surface.mask & ((normals * view).sum(-1) > 0.5)
    assert inside.sum() > 10000
    torch.testing.assert_close(surface.normals[inside], normals[inside], atol=5e-3, rtol=0)
    torch.testing.assert_close(surface.view[inside], view[inside], atol=1e-12, rtol=0)
    torch.testing.assert_close(surface.points[inside], points[inside], atol=1e-12, rtol=1e-12)


def test_depth_leaves_out_the_rim():
    depth = torch.zeros(9, 9)
    depth[2:7, 2:7] = 5.0
    expected = torch.zeros(9, 9, dtype=torch.bool)
    expected[3:6, 3:6] = True
    assert torch.equal(from_depth(depth).mask, expected)
    depth = torch.full((9, 9), 5.0)
    assert from_depth(depth).mask.sum() == 49
    mask = torch.zeros(9, 9, dtype=torch.bool)
    mask[2:7, 2:7] = True
    assert torch.equal(from_depth(depth, mask=mask).mask, expected)


# --- normal maps and refusals ------------------------------------------------------------------------------


def test_normal_map_is_scaled_and_masked():
    given = torch.zeros(3, 4, 3, dtype=D)
    given[1, 2] = torch.tensor([0.0, 3.0, 4.0])
    surface = from_normals(given)
    assert surface.mask.nonzero().tolist() == [[1, 2]]
    torch.testing.assert_close(surface.normals[1, 2], torch.tensor([0, 0.6, 0.8], dtype=D))
    with pytest.raises(ValueError, match="normals must be finite and non-zero on the object; 11 are not"):
        from_normals(given, torch.ones(3, 4, dtype=torch.bool))


@pytest.mark.parametrize(
    ("make_bad", "message"),
    [
        (
            lambda: from_normals(torch.zeros(3, 4)),
            r"normals must be floating-point of shape \(rows, columns, 3\); found torch.float32 \(3, 4\)",
        ),
        (lambda: from_normals(torch.zeros(3, 4, 3)), "mask is empty"),
        (lambda: from_depth(torch.zeros(3, 4, 1)), r"depth must have shape \(rows, columns\); found \(3, 4, 1\)"),
        (lambda: from_depth(torch.zeros(5, 5)), "mask is empty"),
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
