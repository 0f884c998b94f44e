"""What parts send on to each other, as a camera sees it."""

import math

import pytest
import torch

from inverse import Ambient, Distant, Scene, render, vase
from inverse.transport.exchange import passed_on, white_sky_albedo
from inverse.transport.radiosity import bounced, sky_share
from inverse.transport.shadows import Shadows
from torchbrdf import Lambert, OrenNayar

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
    cosine = (normals @ RAISED.direction).clamp(min=0) * Shadows(solid, points, normals).clear(RAISED.direction)
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


def test_bounces_among_even_parts_are_a_geometric_series():
    """T_b = s^b: sum_b rho^(b + 1) s^b/pi = rho/pi rho s/(1 - rho s)."""
    rho, share = number([0.9, 0.5]), 0.6
    images = torch.stack([torch.full((4, 1), share**b, dtype=D) for b in range(1, 200)])
    wanted = rho / math.pi * rho * share / (1 - rho * share)
    torch.testing.assert_close(passed_on(rho, images), wanted.expand(4, 2), rtol=1e-12, atol=0)


def test_white_sky_albedo_is_what_a_uniform_sky_sends_back():
    """Against 1/pi int int f_r cos cos' dw dw' on a grid of polar angles and azimuths; of Lambert it is the albedo."""
    like = torch.zeros(1, dtype=D)
    torch.testing.assert_close(white_sky_albedo(Lambert(albedo=number([0.7, 0.2])), like), number([0.7, 0.2]))
    model = OrenNayar(albedo=number([0.8, 0.3]), sigma=number(0.6))
    z = (torch.arange(60, dtype=D) + 0.5) / 60
    azimuth = (torch.arange(90, dtype=D) + 0.5) * (math.pi / 90)
    sine = (1 - z * z).sqrt()
    views = torch.stack((sine, 0 * z, z), -1)
    lights = torch.stack((sine[:, None] * azimuth.cos(), sine[:, None] * azimuth.sin(), z[:, None].expand(60, 90)), -1)
    f = model(number([0.0, 0.0, 1.0]), lights[:, :, None], views).detach()
    wanted = 4 * math.pi * (f * z[:, None, None, None] * z[:, None]).mean((0, 1, 2))
    torch.testing.assert_close(white_sky_albedo(model, like), wanted, rtol=2e-3, atol=0)
