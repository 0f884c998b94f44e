"""Error bars from refitting see what the formal error cannot."""

import pytest
import torch
from helpers.photographs import clay, photographed, scene_and_photographs

from inverse import Distant, Scene, Sensor, bootstrap, fit, plane, sphere
from torchbrdf import OrenNayar

D = torch.float64


def test_bootstrap_sees_a_light_that_is_wrong():
    # one of four lights is 5 degrees off: the formal error ignores it, the bootstrap does not
    angles = (-40, -10, 20, 50)
    surface = sphere(32, 32, dtype=D)
    photographs = photographed(Scene(surface, [Distant.from_angle(a) for a in angles], Sensor(exposure=1.5)), clay())
    believed = Scene(surface, [Distant.from_angle(a) for a in (-40, -10, 20, 55)], Sensor(exposure=1.5))
    found = fit(believed, photographs, OrenNayar())
    spread = bootstrap(believed, photographs, OrenNayar(), samples=20)
    assert spread["sigma"] > 2 * found.standard_error["sigma"]
    with pytest.raises(ValueError, match="at least 2 samples"):
        bootstrap(believed, photographs, OrenNayar(), samples=1)
    with pytest.raises(ValueError, match="at least 3; found 2"):
        bootstrap(Scene(surface, believed.lights[:2]), photographs[:2], OrenNayar(), samples=3)


def test_bootstrap_refuses_to_average_what_no_refit_determined():
    surface = plane(12, 12, dtype=D)
    scene, photographs = scene_and_photographs([0, 0, 0], surface=surface, exposure=2.0)
    with pytest.raises(ValueError, match="only 0 of 4 bootstrap refits"):
        bootstrap(scene, photographs, OrenNayar(), samples=4)
