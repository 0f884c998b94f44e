"""Plans measured by the sigma that a fit would find."""

from dataclasses import replace

import pytest
import torch
from helpers.planned_scenes import FRONT, OBLIQUE, SENSOR, clay

from inverse import Distant, Scene, everything, fit, plan, plane, render, sphere
from torchbrdf import FastRoughSurface, HeTorrance, OrenNayar, RoughSurface, TorranceSparrow, fixed


@pytest.mark.parametrize("sigma", [0.1, 0.6])
def test_plan_of_sigma_keeps_the_answer(sigma):
    """Photographs with everything on, fitted as planned: the bias is within the asked share of the standard error."""
    scene = Scene(sphere(48, 48, samples=2), [FRONT, Distant.from_angle(50)], SENSOR)
    truth = clay(0.7, sigma)
    found = plan(scene, truth, 1.0, of="sigma")
    photographs = SENSOR.exposure * render(everything(scene), truth).detach()
    result = found.fit(photographs)
    assert result.plan is found
    noisy = SENSOR.expose(render(everything(scene), truth), torch.Generator().manual_seed(0)).detach()
    error = fit(scene, noisy, clay(0.6, sigma)).standard_error["sigma"]
    assert abs(float(result.parameters["sigma"]) - sigma) < 1.0 * float(error)
    # the limit is that share of the standard error a fit reports
    assert found.limit == pytest.approx(float(error), rel=0.25)


def test_plan_of_sigma_keeps_the_sigma_of_every_part():
    """Two parts, each with a sigma, and a weight that says the same as an albedo."""
    scene = Scene(sphere(32, 32, samples=2), [FRONT, OBLIQUE], SENSOR)
    model = 1.0 * OrenNayar(albedo=0.5, sigma=0.4) + 0.1 * TorranceSparrow(sigma=0.3)
    found = plan(scene, model, 1.0, of="sigma")
    sizes = {effect.name: effect.size for effect in found.effects}
    assert sizes["part 1"] >= 0.4 - 1e-6
    assert sizes["part 2"] >= 0.3 - 1e-6
    assert sizes["roughness of part 1"] >= 0.4 - 1e-6
    assert found.simulates("part 1")
    assert found.simulates("part 2")


def test_plan_of_sigma_where_all_else_is_known():
    scene = Scene(sphere(32, 32), [FRONT, OBLIQUE], SENSOR)
    found = plan(scene, OrenNayar(albedo=fixed(0.5), sigma=0.4), 1.0, of="sigma")
    assert next(k.size for k in found.effects if k.name == "roughness") == pytest.approx(0.4)


def test_one_image_of_a_plane_tells_no_sigma():
    with pytest.raises(ValueError, match="do not determine sigma"):
        plan(Scene(plane(12, 12), [OBLIQUE], SENSOR), OrenNayar(albedo=0.5, sigma=0.4), 1.0, of="sigma")


def test_plan_of_sigma_drops_more_when_there_is_more_noise():
    scene = Scene(sphere(48, 48), [FRONT, Distant.from_angle(50)], SENSOR)
    loud = replace(scene, sensor=replace(SENSOR, read_noise=10.0))
    kinds = [type(plan(k, clay(0.7, 0.3), 0.5, of="sigma").model) for k in (scene, loud)]
    assert kinds[0] in (RoughSurface, FastRoughSurface)
    assert kinds[1] not in (RoughSurface, FastRoughSurface)


def test_a_length_called_sigma_is_no_angle():
    """sigma0 of He-Torrance is a height: there is no roughness angle to plan for."""
    scene = Scene(sphere(16, 16), [FRONT, OBLIQUE], SENSOR)
    with pytest.raises(ValueError, match="needs a model with a trained sigma; found HeTorrance"):
        plan(scene, HeTorrance(sigma0=0.2, tau=2.0, wavelength=0.5, eta=1.5, diffuse=0.3), 1.0, of="sigma")
