"""Surfaces and materials of two dtypes meet in the wider one, under every light, rendered and fitted."""

import pytest
import torch

from inverse import Ambient, Disc, Distant, Environment, Point, Rays, Scene, Sensor, fit, plane, render, sphere
from torchbrdf import Lambert

FLOATS = torch.float32, torch.float64
LIGHTS = {
    "distant": Distant.from_angle(20),
    "point": Point(torch.tensor([0.5, 0.5, 3.0]), 9.0),
    "disc": Disc(torch.tensor([0.2, 0.1, 1.0]), 0.3, rings=1),
    "environment": Environment(torch.full((2, 4, 1), 0.2)),
    "ambient": Ambient(0.3),
    "rays": Rays(torch.tensor([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]), torch.tensor([[0.5], [0.5]])),
}


@pytest.mark.parametrize("material", FLOATS, ids=str)
@pytest.mark.parametrize("surface", FLOATS, ids=str)
@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS.keys())
def test_mixed_dtypes_meet_in_the_wider(light, surface, material):
    scene = Scene(sphere(8, 8, dtype=surface), [light], Sensor(exposure=0.8))
    wide = torch.promote_types(surface, material)
    image = render(scene, Lambert(albedo=torch.tensor(0.7, dtype=material))).detach()
    assert image.dtype == wide
    exact = render(
        Scene(sphere(8, 8, dtype=torch.float64), [light]), Lambert(albedo=torch.tensor(0.7, dtype=torch.float64))
    ).detach()
    torch.testing.assert_close(image.double(), exact, rtol=1e-5, atol=1e-6)
    result = fit(scene, image * 0.8, Lambert(albedo=torch.tensor(0.5, dtype=material)))
    assert result.parameters["albedo"].dtype == wide
    assert result.parameters["albedo"].item() == pytest.approx(0.7, rel=1e-5)


def test_a_wider_material_on_a_plane_under_ambient_light():
    image = render(Scene(plane(5, 5), [Ambient(0.3)]), Lambert(albedo=torch.tensor(0.5, dtype=torch.float64)))
    torch.testing.assert_close(image, torch.full_like(image, 0.15))
