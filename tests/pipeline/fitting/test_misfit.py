"""A fit to spoilt photographs warns, and one to photographs with the stated noise does not."""

import pytest
import torch

from inverse import Distant, Scene, Sensor, fit, render, sphere
from torchbrdf import Lambert

DOUBLE = torch.float64
ANGLES = (-35.0, 0.0, 20.0, 45.0)
SCENE = Scene(
    sphere(20, 20, dtype=DOUBLE),
    [Distant.from_angle(angle) for angle in ANGLES],
    Sensor(exposure=3.0, read_noise=0.005, full_well=20000.0),
)
TRUTH = Lambert(albedo=torch.tensor(0.6, dtype=DOUBLE))
CLEAN = render(SCENE, TRUTH).detach()


def photographed(seed):
    return SCENE.sensor.expose(CLEAN, torch.Generator().manual_seed(seed))


def test_clean_photographs_are_not_suspected():
    """Three questions of 1 in 1000 each: more than 2 alarms in 60 fits come by chance once in 1000 times."""
    alarms = sum(bool(fit(SCENE, photographed(seed), TRUTH).warnings) for seed in range(60))
    assert alarms <= 2


def spoilt(how):
    photographs = photographed(0)
    if how == "swapped":
        return photographs[[1, 0, 2, 3]]
    if how == "shifted":
        return torch.cat((photographs[:3], photographs[3:].roll(1, 2)))
    if how == "saturated":
        return photographs.clamp(max=0.4)
    dead = torch.rand(photographs.shape[:3], generator=torch.Generator().manual_seed(1)) < 0.3
    return photographs.masked_fill(dead[..., None], 0.0)


@pytest.mark.parametrize("how", ["swapped", "shifted", "saturated", "30 % dead"])
def test_spoilt_photographs_are(how):
    result = fit(SCENE, spoilt(how), TRUTH)
    assert "times as wide as the sensor's noise" in result.warnings[0]
    assert "with warnings" in str(result)
    assert result.to_json()["warnings"] == list(result.warnings)


def test_the_image_that_stands_out_is_named():
    (warning,) = [note for note in fit(SCENE, spoilt("shifted"), TRUTH).warnings if "image" in note]
    assert warning.split(" (")[0] == "image 3"


def test_a_sensor_without_noise_says_nothing():
    scene = Scene(SCENE.surface, SCENE.lights, Sensor(exposure=3.0))
    assert fit(scene, spoilt("swapped"), TRUTH).warnings == ()
