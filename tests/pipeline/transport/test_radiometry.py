"""Solid angles, irradiance and exitance against the radiometry of the course notes."""

import json
import math
from pathlib import Path

import pytest
import torch

from inverse import (
    Distant,
    Environment,
    Point,
    exitance,
    irradiance,
    plane,
    solid_angle_of_band,
    solid_angle_of_cone,
    solid_angle_of_patch,
    sphere,
)
from torchbrdf import Lambert, ModifiedPhong

D = torch.float64
GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "other_models.json").read_text())["radiometry"]


def vector(*values):
    return torch.tensor(values, dtype=D)


def number(value):
    return torch.tensor(value, dtype=D)


def lambert(albedo):
    return Lambert(albedo=number(albedo))


@pytest.fixture
def spot():
    """A plane of one pixel, at the origin, facing the camera."""
    return plane(1, 1, dtype=D)


def test_point_source(spot):
    found = irradiance(spot, (Point(vector(1, 2, 3), 5.0),))
    assert found.item() == pytest.approx(GOLDEN["point I=5 pos=(1,2,3) p=0 n=z"], rel=1e-14)
    assert irradiance(spot, (Point(vector(1, 2, -3), 5.0),)).item() == GOLDEN["point behind"] == 0


def test_solid_angles():
    band = solid_angle_of_band((0.2, 0.9), (-0.3, 1.1))
    assert band == pytest.approx(GOLDEN["solid angle (13) t 0.2..0.9 p -0.3..1.1"], rel=1e-14)
    assert solid_angle_of_band((0, 0.4), (0, 2 * math.pi)) == pytest.approx(solid_angle_of_cone(0.4), rel=1e-14)
    assert solid_angle_of_cone(1e-9) == pytest.approx(math.pi * 1e-18, rel=1e-12)
    # a ring of patches seen from the centre of their sphere fills the band
    assert solid_angle_of_patch(0.01, 0.5, 2.0) == pytest.approx(0.00125)
    assert Environment(torch.ones(6, 10, 1)).solid_angles().sum().item() * 10 == pytest.approx(4 * math.pi)


def test_exitance_is_albedo_times_irradiance():
    surface = sphere(5, 5, dtype=D)
    lights = (Point(vector(2, 1, 3), 4.0), Distant.from_angle(20))
    torch.testing.assert_close(
        exitance(lambert(0.6), surface, lights), 0.6 * irradiance(surface, lights), rtol=1e-12, atol=0
    )
    model = ModifiedPhong(diffuse=number(0.3), specular=number(0.4), exponent=number(6.0))
    face = plane(1, 1, normal=(0.6, 0, 0.8), dtype=D)
    light = (Distant(vector(0, 0, 1)),)
    wanted = model.directional_albedo(number(0.8), nodes=48) * 0.8
    torch.testing.assert_close(exitance(model, face, light, nodes=12)[0], wanted, rtol=1e-4, atol=0)
