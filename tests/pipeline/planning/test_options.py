"""What a scene could do without: by geometry, by size, and not at all."""

import math

import torch
from helpers.planned_scenes import FRONT, OBLIQUE, UP, clay

from inverse import Cuboid, Disc, Distant, Environment, Point, Scene, from_normals, orthographic, plan, sphere, vase
from torchbrdf import Lambert, OrenNayar


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


def test_cuboid_stands_alone():
    """A box is convex: nothing falls on it and nothing bounces, though its faces meet at edges."""
    found = plan(Scene(orthographic(Cuboid((0.5, 0.5, 0.5), 30.0), 32, 32, samples=2), [OBLIQUE]), Lambert(), 0.01)
    assert not found.simulates("cast shadows")
    assert not found.simulates("light between parts")
    assert math.isfinite(found.error)
