"""Surfaces from depth and normal maps against the shapes the maps were made of."""

import pytest
import torch

from inverse.scene.maps import from_depth, from_normals
from inverse.shapes.height_field import HeightField

D = torch.float64


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
    ],
)
def test_bad_maps(make_bad, message):
    with pytest.raises(ValueError, match=message):
        make_bad()


def test_who_knows_its_solid():
    depth = torch.full((9, 9), 5.0)
    assert isinstance(from_depth(depth).solid, HeightField)
    assert from_depth(depth, torch.eye(3)).solid is None
