"""What parts send on to each other, as a camera sees it."""

import math

import pytest
import torch

from inverse import Ambient, Distant, Scene, render, vase
from inverse.transport.radiosity import bounced, sky_share
from inverse.transport.shadows import unshadowed
from torchbrdf import Lambert

D = torch.float64
RAISED = Distant(torch.tensor([0.3, 1.6, 0.6], dtype=D))


def number(value):
    return torch.tensor(value, dtype=D)


def test_light_between_parts_adds_its_bounces():
    """Lambert: rho/pi (E + rho T_1 + rho^2 T_2 + ...), with ambient light dimmed by what the solid hides."""
    surface = vase(32, 28, dtype=D)
    lights = (RAISED, Ambient(number([0.1, 0.3])))
    model = Lambert(albedo=number([0.9, 0.5]))
    found = render(Scene(surface, [lights], between_parts=True), model)[0][surface.mask]
    solid, points, normals = surface.solid, surface.points[surface.mask], surface.normals[surface.mask]
    assert solid is not None
    cosine = (normals @ RAISED.direction).clamp(min=0) * unshadowed(solid, points, normals, RAISED.direction)
    sky = sky_share(solid, points, normals)
    received = cosine[:, None] + math.pi * sky[:, None] * number([0.1, 0.3])
    rho = model.albedo
    for order, image in enumerate(bounced(solid, lights, points, normals), start=1):
        received = received + rho**order * image
    torch.testing.assert_close(found, rho / math.pi * received, rtol=1e-5, atol=1e-12)
    dark = render(Scene(surface, [lights]), model)[0][surface.mask]
    assert ((found - dark).abs().amax(-1) > 1e-3).any()


def test_per_texel_materials_exchange_no_light():
    surface = vase(16, 16, dtype=D)
    model = Lambert(albedo=torch.full((int(surface.mask.sum()), 1), 0.5, dtype=D))
    with pytest.raises(ValueError, match="light between parts needs one material"):
        render(Scene(surface, [RAISED], between_parts=True), model)
