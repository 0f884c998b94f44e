"""A plan says what it leaves out, and renders and fits what it keeps."""

import json

import pytest
import torch
from helpers.planned_scenes import FRONT, OBLIQUE, SCENES, UP, clay

from inverse import Distant, Scene, Sensor, plan, render, sphere, vase
from torchbrdf import GGX, Lambert, OrenNayar, RoughSurface, WeightedSum, fixed

SCENE_EFFECTS = {
    "cast shadows", "light between parts", "distance fall-off", "perspective view", "extent of the source",
    "detail of the environment", "ambient light", "pixel footprint", "attached shadow", "point-spread function",
    "noise", "quantisation", "polarisation",
}  # fmt: skip
MATERIAL_EFFECTS = {
    "roughness", "interreflection in cavities", "third and later bounces", "C3 term", "exact integral over slopes",
    "all slopes of the model", "Fresnel variation", "anisotropy",
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_nothing_is_skipped_without_a_name_and_a_reason(name):
    scene, model = SCENES[name]()
    found = plan(scene, model, 0.01, pixels=60)
    names = [effect.name for effect in found.effects]
    assert len(names) == len(set(names))
    assert set(names) >= SCENE_EFFECTS
    for effect in MATERIAL_EFFECTS:
        assert any(k == effect or k.startswith(f"{effect} of part") for k in names), effect
    printed = str(found)
    for effect in found.effects:
        assert effect.reason
        assert f"\n{effect.name} " in printed
    assert set(found.skipped()) == {k.name for k in found.effects if not k.simulate}
    told = json.loads(found.to_json())
    assert [k["name"] for k in told["effects"]] == names
    assert told["error"] == found.error


def test_gradients_follow_the_plan():
    """d(mean radiance)/d sigma through the planned rendering against a central difference of it."""
    scene = Scene(vase(24, 24, samples=2, dtype=torch.float64), [Distant(UP.double())])
    model = RoughSurface(albedo=torch.tensor(0.7).double(), sigma=torch.tensor(0.5).double(), bounces="all", nodes=6)
    found = plan(scene, model, 0.02)
    stand_in = found.model
    found.render().mean().backward()
    raw = stand_in.raw_sigma
    slope = raw.grad.item()
    step, values = 1e-4, []
    for sign in (1, -1):
        with torch.no_grad():
            raw += sign * step
            values.append(found.render().mean().item())
            raw -= sign * step
    assert slope == pytest.approx((values[0] - values[1]) / (2 * step), rel=1e-5)


def test_parts_keep_their_names_in_a_fit():
    scene = Scene(sphere(32, 32), [FRONT, OBLIQUE])
    model = WeightedSum([GGX(alpha=0.5), OrenNayar(albedo=fixed(0.7), sigma=0.5)], [1e-4, 1.0])
    found = plan(scene, model, 0.01)
    assert found.skipped()[0] != "part 2"
    assert not found.simulates("part 1")
    result = found.fit(render(scene, model).detach())
    assert float(result.parameters["parts.1.sigma"]) == pytest.approx(0.5, abs=0.01)
    assert "parts.0.sigma" not in result.parameters


def test_a_plan_follows_the_sensor():
    scene = Scene(sphere(24, 24), [OBLIQUE], Sensor(exposure=2.0))
    photographs = 2 * render(scene, Lambert(albedo=0.4)).detach()
    result = plan(scene, Lambert(albedo=0.7), 0.1).fit(photographs)
    assert float(result.parameters["albedo"]) == pytest.approx(0.4, rel=1e-5)


def test_fit_with_a_plan_may_take_another_model():
    scene = Scene(sphere(32, 32), [FRONT, OBLIQUE])
    found = plan(scene, clay(), 0.01)
    photographs = render(scene, OrenNayar(albedo=0.5, sigma=0.4)).detach()
    result = found.fit(photographs, OrenNayar(albedo=0.3, sigma=0.2))
    assert float(result.parameters["sigma"]) == pytest.approx(0.4, rel=1e-4)
