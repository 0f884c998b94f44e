"""The iteration ends at the minimum, from afar, with unknowns of every pixel, or says that it did not."""

import math

import pytest
import torch
from helpers.photographs import LIGHTS, clay, photographed, scene_and_photographs

from inverse import Distant, Scene, Sensor, fit, sphere, vase
from torchbrdf import OrenNayar, QualitativeOrenNayar

D = torch.float64


def test_sigma_and_albedo_of_every_pixel():
    lights = [Distant.from_angle(a) for a in (-50, -25, 0, 25, 50)]
    scene = Scene(sphere(24, 24, dtype=D), lights, Sensor(exposure=1.5))
    points = int(scene.surface.mask.sum())
    generator = torch.Generator().manual_seed(0)
    truth = QualitativeOrenNayar(
        albedo=0.3 + 0.5 * torch.rand(points, 1, dtype=D, generator=generator),
        sigma=0.2 + 0.6 * torch.rand(points, dtype=D, generator=generator),
    )
    start = QualitativeOrenNayar(albedo=torch.full((points, 1), 0.5), sigma=torch.full((points,), 0.4))
    found = fit(scene, photographed(scene, truth), start)
    central = scene.surface.normals[scene.surface.mask][:, 2] > 0.6  # well seen under all lights
    torch.testing.assert_close(found.parameters["sigma"][central], truth.sigma.detach()[central], rtol=1e-4, atol=0)


def test_out_of_steps_is_a_status():
    scene = Scene(vase(32, 32, dtype=D), LIGHTS, Sensor(exposure=3.0))
    found = fit(scene, photographed(scene, clay()), OrenNayar(), max_steps=1)
    assert found.status == "out of steps"


def test_every_random_start_ends_at_the_optimum_or_says_it_did_not():
    surface = sphere(24, 24, dtype=D)
    scene, photographs = scene_and_photographs([0, 20], surface=surface, sigma=0.7)
    best = fit(scene, photographs, OrenNayar()).residual_rms
    generator = torch.Generator().manual_seed(0)
    for _ in range(30):
        albedo, share = torch.rand(2, generator=generator, dtype=D) * 0.98 + 0.01
        found = fit(scene, photographs, OrenNayar(albedo=albedo, sigma=share * math.pi / 2))
        assert found.residual_rms == pytest.approx(best, rel=1e-6)
        assert found.status == "converged"


@pytest.mark.parametrize("exposure", [60.0, 300.0])
def test_a_start_far_too_bright_does_not_stop_early(exposure):
    surface = sphere(96, 96)
    scene, photographs = scene_and_photographs(
        [0, 20], surface=surface, noise=1e-3, albedo=2.1 / exposure, exposure=exposure
    )
    found = fit(scene, photographs.float(), OrenNayar(), valid=photographs[..., 0] > 0.02)
    assert abs(found.parameters["sigma"].item() - 0.5) < 4 * found.standard_error["sigma"].item()
