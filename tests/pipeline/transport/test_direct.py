"""Light straight from the lights, less what the solid hides."""

import torch

from inverse import Distant, Group, Plane, Scene, Sphere, from_depth, render, vase
from inverse.shapes.form_factors import PairExchange
from inverse.transport.direct import direct_irradiance
from inverse.transport.shadows import Shadows
from torchbrdf import Lambert

D = torch.float64
RAISED = Distant(torch.tensor([0.3, 1.6, 0.6], dtype=D))


def number(value):
    return torch.tensor(value, dtype=D)


def test_a_shadow_takes_the_light_and_nothing_else():
    """Pixel by pixel: the image without shadows where the ray to the light is free, 0 where it is not."""
    surface = vase(48, 40, dtype=D)
    model = Lambert(albedo=number(0.6))
    lit, plain = (render(Scene(surface, [RAISED], shadows=k), model)[0, ..., 0] for k in (True, False))
    assert surface.solid is not None
    points, normals = surface.points[surface.mask], surface.normals[surface.mask]
    clear = Shadows(surface.solid, points, normals).clear(RAISED.direction)
    assert 20 < int((~clear).sum()) < len(clear) / 2
    assert torch.equal(lit[surface.mask], plain[surface.mask] * clear)


def test_a_relief_shadows_itself():
    """A dome of known height over a plane, from a depth map: a low light leaves a shadow behind it."""
    x = torch.arange(81, dtype=D) - 40
    height = (400 - x[:, None] ** 2 - x**2).clamp(min=0).sqrt()
    surface = from_depth(100 - height)
    light = Distant(torch.tensor([1.0, 0.0, 0.4], dtype=D))
    lit, plain = (render(Scene(surface, [light], shadows=k), Lambert())[0, ..., 0] for k in (True, False))
    assert lit[40, 8] == 0 < plain[40, 8]  # on the far side, within the shadow's 50 pixels
    assert lit[8, 40] == plain[8, 40] > 0


RADIUS, ABOVE = 0.3, 0.5
SCENE = Group((Sphere(RADIUS, (0.0, ABOVE, 0.0)), Plane((0.0, 1.0, 0.0))))


def test_shadows_fall_on_the_patches_too():
    exchange = PairExchange(SCENE, SCENE.patches(400))
    light = Distant(torch.tensor([0.0, 1.0, 0.0], dtype=D))
    received = direct_irradiance([light], *exchange.patches[:2], SCENE, 1 - exchange.share)[:, 0]
    points, normals, _ = exchange.patches
    below = (points[:, 1] == 0) & (points[:, [0, 2]].norm(dim=-1) < RADIUS)
    assert below.sum() > 3
    assert (received[below] == 0).all()
    open_ = (points[:, 1] == 0) & ~below
    assert (received[open_] == 1).all()
    on_ball = points[:, 1] > 0
    torch.testing.assert_close(received[on_ball], normals[on_ball, 1].clamp(min=0))
