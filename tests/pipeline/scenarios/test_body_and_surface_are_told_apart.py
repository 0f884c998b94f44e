"""Body and surface together: the paper's samples with a forward lobe are recovered from photographs."""

import math

import pytest
import torch

from inverse import Distant, Scene, Sensor, fit, render, sphere
from torchbrdf import OrenNayar, Perfect, TorranceSparrow, WeightedSum, fixed

DOUBLE = torch.float64
SAMPLES = {"foam D": (20, 0.80, 0.019), "cotton towel E": (42, 0.75, 0.085), "wood shavings F": (26, 0.70, 0.043)}


@pytest.mark.parametrize("sample", SAMPLES)
def test_sigma_rho_and_the_surface_share_are_recovered(sample):
    degrees, rho, share = SAMPLES[sample]
    lights = [Distant.from_angle(angle) for angle in (-60, 20, 85)]
    scene = Scene(sphere(32, 32, dtype=DOUBLE), lights, Sensor(exposure=2.0))
    sigma, albedo = (fixed(torch.tensor(k, dtype=DOUBLE)) for k in (math.radians(degrees), rho))
    surface = {"fresnel": Perfect(), "normalised": False}
    truth = WeightedSum([OrenNayar(albedo=albedo, sigma=sigma), TorranceSparrow(sigma=sigma, **surface)], [1.0, share])
    photographs = scene.sensor.expose(render(scene, truth))
    start = WeightedSum([OrenNayar(albedo=0.5, sigma=0.4), TorranceSparrow(sigma=0.4, **surface)], [1.0, 0.05])
    found = fit(scene, photographs, start)
    assert found.status == "converged"
    body, gloss = found.parameters["weights"].tolist()
    assert gloss / body == pytest.approx(share, rel=1e-4)
    assert found.parameters["parts.0.albedo"].item() == pytest.approx(rho, rel=1e-4)
    for name in ("parts.0.sigma", "parts.1.sigma"):
        assert math.degrees(found.parameters[name].item()) == pytest.approx(degrees, rel=1e-4)
