"""Reliefs: rays and shadows against closed forms."""

import math

import pytest
import torch
from helpers.surfaces import masked, towards

from inverse.scene.maps import from_depth
from inverse.shapes.height_field import HeightField
from inverse.transport.shadows import Shadows

D = torch.float64


def grid(size):
    row, column = torch.meshgrid(*2 * (torch.arange(size, dtype=D),), indexing="ij")
    return column, -row


@pytest.mark.parametrize("dtype", [torch.float32, D])
def test_shadow_of_a_dome_in_a_depth_map(dtype):
    """A half sphere on a flat ground: shadowed where the ray passes the centre within the radius."""
    size, radius = 161, 30.0
    x, y = grid(size)
    centre = torch.tensor([60.0, -80.0, -200.0], dtype=D)
    dome = (radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2).clamp(min=0).sqrt()
    surface = from_depth((200 - dome).to(dtype))
    points, normals = masked(surface)
    direction = towards(-65, 0)
    to_centre = centre - points.double()
    beside = (to_centre - (to_centre @ direction)[:, None] * direction).norm(dim=-1)
    ground = to_centre[:, :2].norm(dim=-1) > radius + 2
    sure = ground & ((beside - radius).abs() > 1)
    clear = Shadows(surface.solid, points, normals).clear(direction.to(dtype))
    assert torch.equal(~clear[sure], (beside < radius)[sure] & (to_centre @ direction > 0)[sure])
    assert (~clear[sure]).sum() > 300
    top = to_centre[:, :2].norm(dim=-1) < 0.8 * radius
    assert clear[top].all()  # a dome hides nothing from itself


@pytest.mark.parametrize("dtype", [torch.float32, D])
@pytest.mark.parametrize("angles", [(60, 0), (20, 60), (-75, 30)])
def test_bowl_in_closed_form(angles, dtype):
    """z = k (x^2 + y^2) is met again at t = (z' - 2 k x x' - 2 k y y')/(k (x'^2 + y'^2)), if inside the image."""
    size, k = 121, 1 / 120
    x, y = grid(size)
    middle = torch.tensor([60.0, -60.0], dtype=D)
    surface = from_depth((500 - k * ((x - middle[0]) ** 2 + (y - middle[1]) ** 2)).to(dtype))
    points, normals = masked(surface)
    direction, own = towards(*angles), points[:, :2].double() - middle
    rate = direction[2] - 2 * k * own @ direction[:2]
    end = own + (rate / (k * direction[:2].square().sum()))[:, None] * direction[:2]
    border = end.abs().amax(-1)
    sure = ((border - 60).abs() > 0.5) & (rate.abs() > 0.02)
    clear = Shadows(surface.solid, points, normals).clear(direction.to(dtype))
    assert torch.equal(~clear[sure], ((rate > 0) & (border < 60))[sure])
    assert sure.double().mean() > 0.9
    assert (~clear).sum() > 500


def test_relief_is_met_from_the_front():
    x, y = grid(41)
    heights = 0.3 * x + 0.1 * y
    relief = HeightField(heights)
    origin = torch.tensor([[10.25, -7.5, 100.0], [33.0, -39.75, 50.0], [50.0, -3.0, 9.0]], dtype=D)
    distance, normal = relief.meet(origin, torch.tensor([0.0, 0, -1], dtype=D))
    expected = origin[:, 2] - 0.3 * origin[:, 0] - 0.1 * origin[:, 1]
    torch.testing.assert_close(distance[:2], expected[:2], atol=1e-9, rtol=0)
    assert distance[2] == math.inf
    n = torch.tensor([-0.3, -0.1, 1.0], dtype=D)
    torch.testing.assert_close(normal[:2], (n / n.norm()).expand(2, 3))


def test_unknown_parts_of_a_depth_map_hide_nothing():
    heights = torch.zeros(31, 61, dtype=D)
    heights[:, 28:33] = 20.0
    at, up = torch.tensor([[15.0, -15.0, 0.0]], dtype=D), torch.tensor([[0.0, 0, 1]], dtype=D)
    assert not Shadows(HeightField(heights), at, up).clear(towards(60, 0)).any()
    heights[:, 28:33] = torch.nan
    assert Shadows(HeightField(heights), at, up).clear(towards(60, 0)).all()
    with pytest.raises(ValueError, match=r"HeightField.heights must be \(rows, columns\)"):
        HeightField(torch.full((3, 3), torch.nan))


@pytest.mark.parametrize("size", [(70, 150), (9, 90)])
@pytest.mark.parametrize("distance", [math.inf, 30.0])
def test_shadows_are_those_of_rays_that_try_every_pixel(size, distance):
    for seed in range(2):
        g = torch.Generator().manual_seed(seed)
        heights = torch.randn(size, dtype=D, generator=g).cumsum(1)
        if seed % 2:
            heights[torch.rand(size, generator=g) < 0.05] = torch.nan
        at = torch.rand(200, 3, dtype=D, generator=g) * torch.tensor([size[1] - 1.0, 1.0 - size[0], 0], dtype=D)
        origin = (
            at + torch.tensor([0.0, 0, 1], dtype=D) * heights[-at[:, 1].round().long(), at[:, 0].round().long(), None]
        )
        origin = origin[origin.isfinite().all(-1)]
        direction = torch.nn.functional.normalize(torch.randn(origin.shape, dtype=D, generator=g), dim=-1)
        reach = torch.rand(len(origin), dtype=D, generator=g) * distance
        relief = HeightField(heights)
        blocked = relief.blocks(origin, direction, reach)
        assert torch.equal(blocked, relief.hit(origin, direction) < reach)
        assert blocked.any()
        assert not blocked.all()
