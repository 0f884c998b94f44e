"""What a pixel of a camera shows, against projection, closed forms and each other."""

import math

import pytest
import torch

from inverse import Sphere, cuboid, cylinder, perspective, pinhole, sphere, vase

D = torch.float64


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


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pinhole(4, 4, field_of_view=180), r"field_of_view must lie in \(0, 180\) degrees; found 180"),
        (lambda: pinhole(0, 4), "height and width must be whole numbers of at least 1; found 0 and 4"),
        (lambda: pinhole(4, 4, distance=-1.0), "distance must be positive and finite"),
        (lambda: perspective(Sphere(0.5, (5.0, 0, 0)), pinhole(4, 4)), "mask is empty"),
    ],
)
def test_bad_cameras(make, message):
    with pytest.raises(ValueError, match=message):
        make()
