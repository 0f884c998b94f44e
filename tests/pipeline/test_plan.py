"""Plans: what they leave out does not matter, and they say so."""

import json
import math

import pytest
import torch

from inverse import (
    Ambient,
    Cuboid,
    Disc,
    Distant,
    Environment,
    Group,
    Plane,
    Point,
    Scene,
    Sensor,
    Sphere,
    cylinder,
    everything,
    from_normals,
    orthographic,
    perspective,
    pinhole,
    plan,
    plane,
    render,
    sphere,
    vase,
)  # fmt: skip
from torchbrdf import GGX, FastRoughSurface, Lambert, OrenNayar, RoughSurface, WeightedSum, fixed

SCENE_EFFECTS = {
    "cast shadows", "light between parts", "distance fall-off", "perspective view", "extent of the source",
    "detail of the environment", "ambient light", "pixel footprint", "attached shadow", "point-spread function",
    "noise", "quantisation", "polarisation",
}  # fmt: skip
MATERIAL_EFFECTS = {
    "roughness", "interreflection in cavities", "third and later bounces", "C3 term", "exact integral over slopes",
    "all slopes of the model", "Fresnel variation", "anisotropy",
}  # fmt: skip
FRONT, OBLIQUE = Distant.from_angle(0), Distant.from_angle(20)
UP = torch.tensor([0.5, 1.0, 1.0])


def clay(rho=0.7, sigma=0.6):
    return RoughSurface(albedo=rho, sigma=sigma, bounces="all", nodes=8)


def largest_error(scene, model, found):
    with torch.no_grad():
        full = render(everything(scene), model)
        return float((found.render() - full).abs().max() / full.max())


SCENES = {
    "sphere": lambda: (Scene(sphere(32, 32, samples=2), [FRONT]), clay()),
    "sphere, lamp nearby, gloss": lambda: (
        Scene(sphere(32, 32, samples=2), [Point(torch.tensor([1.0, 0.5, 3.0]), 9.0)]),
        1.0 * clay(0.5, 0.3) + 0.3 * GGX(alpha=0.4),
    ),
    "vase, two images": lambda: (Scene(vase(32, 32, samples=2), [FRONT, OBLIQUE]), clay()),
    "vase, raised light, ambient": lambda: (
        Scene(vase(32, 32, samples=2), [[Distant(UP), Ambient(0.02)]]),
        OrenNayar(albedo=0.6, sigma=0.4),
    ),
    "cylinder at 60 degrees": lambda: (Scene(cylinder(32, 32, samples=2), [Distant.from_angle(60)]), clay(0.9, 0.3)),
    "plane": lambda: (Scene(plane(16, 16), [Distant.from_angle(30)]), clay(0.9, 0.3)),
    "dark and smooth, through a pinhole": lambda: (
        Scene(perspective(Sphere(0.7), pinhole(32, 32, field_of_view=20), samples=2), [Point(40 * UP, 4000.0)]),
        clay(0.1, 0.05),
    ),
    "ball on a table in the sun": lambda: (
        Scene(
            orthographic(Group((Sphere(0.5), Plane((0.0, 0.9, 0.44), (0.0, -0.6, 0.0)))), 32, 32, samples=2),
            [Disc(UP, 0.02)],
        ),
        Lambert(albedo=0.5),
    ),
}


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001])
@pytest.mark.parametrize("name", SCENES)
def test_every_pixel_is_within_the_tolerance(name, tolerance):
    scene, model = SCENES[name]()
    found = plan(scene, model, tolerance)
    assert found.error <= tolerance / found.safety
    assert largest_error(scene, model, found) < tolerance


@pytest.mark.slow
def test_grid_of_scenes_is_within_the_tolerance(capsys, monkeypatch):
    """The study of `examples/benchmarks/plans.py`: scenes drawn from all shapes, lights, materials."""
    import runpy
    import sys
    from pathlib import Path

    monkeypatch.setattr(sys, "argv", ["plans.py", "--scenes", "24"])
    script = Path(__file__).parents[2] / "examples" / "benchmarks" / "plans.py"
    runpy.run_path(str(script), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    shares = [float(line.split("largest error ")[1].split()[0]) for line in lines]
    assert len(shares) == 3
    assert max(shares) < 1


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


def test_what_geometry_rules_out_is_not_tried():
    found = plan(Scene(sphere(24, 24), [FRONT]), clay(), 0.01)
    reasons = {effect.name: (effect.simulate, effect.size, effect.reason) for effect in found.effects}
    assert reasons["cast shadows"][:2] == (False, 0.0)
    assert "convex" in reasons["cast shadows"][2]
    assert "convex" in reasons["light between parts"][2]
    assert reasons["distance fall-off"][2] == "every light is distant"
    assert "orthographic" in reasons["perspective view"][2]
    assert reasons["pixel footprint"][2] == "one sample a pixel"
    level = plan(Scene(vase(24, 24), [FRONT, OBLIQUE]), clay(), 0.01)
    assert "disc" in next(k.reason for k in level.effects if k.name == "cast shadows")
    unknown = plan(Scene(from_normals(sphere(24, 24).normals, sphere(24, 24).mask), [FRONT]), clay(), 0.01)
    assert next(k for k in unknown.effects if k.name == "cast shadows").size is None
    assert not unknown.simulates("cast shadows")


def test_raised_light_needs_shadows_and_a_level_one_does_not():
    model = OrenNayar(albedo=0.3, sigma=0.3)
    raised = Distant(torch.tensor([0.2, 1.5, 0.6]))
    assert plan(Scene(vase(48, 48), [raised]), model, 0.01).simulates("cast shadows")
    assert not plan(Scene(vase(48, 48), [OBLIQUE]), model, 0.01).simulates("cast shadows")


def test_smooth_clay_is_lambert():
    found = plan(Scene(sphere(24, 24), [OBLIQUE]), RoughSurface(albedo=0.7, sigma=fixed(0.0)), 1e-4)
    assert isinstance(found.model, Lambert)
    assert found.error < 1e-6
    assert not found.simulates("roughness")


def test_the_cheapest_rung_that_is_close_enough_is_taken():
    scene = Scene(sphere(48, 48), [OBLIQUE])
    kinds = [type(plan(scene, clay(0.7, 0.7), tolerance).model) for tolerance in (0.9, 0.02, 1e-5)]
    assert kinds == [Lambert, FastRoughSurface, RoughSurface]


def test_a_faint_part_is_left_out():
    model = WeightedSum([OrenNayar(albedo=0.7, sigma=0.5), GGX(alpha=0.5)], [1.0, 1e-4])
    found = plan(Scene(sphere(32, 32), [OBLIQUE]), model, 0.01)
    assert not found.simulates("part 2")
    assert isinstance(found.model, WeightedSum)
    assert [type(part) for part in found.model.parts] == [OrenNayar]


def test_stand_in_holds_what_the_model_holds():
    model = RoughSurface(albedo=fixed(torch.tensor([0.5, 0.3])), sigma=0.4, bounces="all")
    stand_in = plan(Scene(sphere(24, 24), [OBLIQUE]), model, 0.02).model
    assert isinstance(stand_in, FastRoughSurface)
    assert [name for name, _ in stand_in.named_parameters()] == ["raw_sigma"]
    torch.testing.assert_close(stand_in.albedo, torch.tensor([0.5, 0.3]))
    torch.testing.assert_close(stand_in.sigma, torch.tensor(0.4))


def test_small_penumbra_and_far_lamp_are_left_out():
    surface = sphere(32, 32)
    soft = Scene(surface, [Disc(UP, 0.005)])
    far = Scene(surface, [Point(1000 * UP, 1e6)])
    whole = Scene(surface, [[FRONT, Environment(1e-5 * torch.ones(8, 16, 1))]])
    for scene, effect in ((soft, "extent of the source"), (far, "distance fall-off")):
        found = plan(scene, OrenNayar(albedo=0.7, sigma=0.5), 0.02)
        assert not found.simulates(effect)
        assert isinstance(found.scene.lights[0][0], Distant)
    assert not plan(whole, Lambert(albedo=0.5), 0.01).simulates("detail of the environment")


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


SENSOR = Sensor(exposure=3.0, read_noise=0.01)


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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: plan(Scene(sphere(8, 8), [FRONT]), clay(), 0.0),
            r"positive and finite \[share of the peak",
        ),
        (lambda: plan(Scene(sphere(8, 8), [FRONT]), clay(), 0.1, of="rho"), 'of must be "radiance" or "sigma"'),
        (
            lambda: plan(Scene(sphere(8, 8), [FRONT]), clay(), 0.1, safety=0.5),
            "at least 1 and finite; found 0.5",
        ),
        (lambda: plan(Scene(sphere(8, 8), [FRONT]), clay(), 0.1, pixels=0), "pixels must be a whole number"),
        (lambda: plan(Scene(sphere(8, 8), [FRONT]), clay(), 0.1, of="sigma"), "give the sensor its noise"),
        (
            lambda: plan(Scene(sphere(8, 8), [FRONT], SENSOR), Lambert(), 0.1, of="sigma"),
            "needs a model with a trained sigma; found Lambert",
        ),
        (lambda: plan(Scene(sphere(8, 8), [Distant.from_angle(180)]), Lambert(), 0.1), "the radiance is 0 everywhere"),
        (
            lambda: plan(Scene(sphere(8, 8), [FRONT]), Lambert(albedo=torch.full((9, 1), 0.5)), 0.1),
            "parameters per texel",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_cuboid_stands_alone():
    """A box is convex: nothing falls on it and nothing bounces, though its faces meet at edges."""
    found = plan(Scene(orthographic(Cuboid((0.5, 0.5, 0.5), 30.0), 32, 32, samples=2), [OBLIQUE]), Lambert(), 0.01)
    assert not found.simulates("cast shadows")
    assert not found.simulates("light between parts")
    assert math.isfinite(found.error)
