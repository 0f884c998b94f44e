"""Heightfields state their stand-ins; the planner takes them; the ladder against them says how good each rung is."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from inverse import Distant, Scene, plan, sphere
from torchbrdf import (
    EFFECTS,
    Cosines,
    FastGaussianHeightfield,
    GaussianHeightfield,
    Lambert,
    effects,
    fixed,
    sigma_from_rms_slope,
    simulated,
)
from torchbrdf.accuracy import (
    DIFFUSE_RUNGS,
    heightfield_reference,
    reference,
    relative_errors,
)
from torchbrdf.testing import random_directions

D = torch.float64
DATA = Path(__file__).parents[2] / "data"
ALL = ("roughness", "interreflection in cavities", "third and later bounces", "occlusion near by")


def number(value):
    return torch.tensor(value, dtype=D)


def heightfield(**settings):
    given = {"occlusion": fixed(number(1.0)), "nodes": 240, "polar_nodes": 6, "table_orders": 4}
    return GaussianHeightfield(albedo=number([0.7, 0.4]), sigma=fixed(number(0.5)), **given | settings)


def directions(count, seed=0):
    return random_directions(count, dtype=D, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("settings", [{}, {"bounces": 2}, {"bounces": 3, "nodes": 160}, {"occlusion": number(0.8)}])
def test_rungs_leave_out_less_and_less_of_the_same_material(settings):
    model = heightfield(**settings)
    rungs = model.stand_ins()["rung"]
    assert set(simulated(model)) <= set(EFFECTS)
    assert rungs[0].skips == simulated(model)
    assert len({rung.choice for rung in rungs}) == len(rungs)
    for rung in rungs:
        assert rung.skips
        assert torch.equal(rung.model.albedo, model.albedo)
        assert isinstance(rung.model, Lambert) or torch.equal(rung.model.sigma, model.sigma)
        assert "raw_sigma" not in dict(rung.model.named_parameters())  # what is held stays held
        if isinstance(rung.model, GaussianHeightfield):
            assert torch.equal(rung.model.occlusion, model.occlusion)
            assert rung.model.settings.size == model.settings.size


def test_reference_then_fit_then_lambert():
    rungs = heightfield().stand_ins()["rung"]
    smooth, fit, *integrals = rungs
    assert isinstance(smooth.model, Lambert)
    assert isinstance(fit.model, FastGaussianHeightfield)
    assert fit.skips == ("exact integral over slopes", "all slopes of the model")
    assert {type(k.model) for k in integrals} == {GaussianHeightfield}
    assert [k.choice for k in fit.model.stand_ins()["rung"]] == ["Lambert"]
    assert simulated(fit.model) == ALL


def test_what_each_rung_says_it_leaves_out_is_what_it_leaves_out():
    model = heightfield()
    rungs = {k.choice: k for k in model.stand_ins()["rung"]}
    parts, given = model.components(*directions(50)), directions(50)
    two = rungs["heightfield, 240 nodes, 2 bounces"]
    assert two.skips == ("third and later bounces",)
    torch.testing.assert_close(two.model(*given) + parts["higher"], model(*given), rtol=1e-12, atol=1e-15)
    one = rungs["heightfield, 240 nodes, 1 bounce"]
    assert set(one.skips) == {"interreflection in cavities", "third and later bounces"}
    torch.testing.assert_close(one.model(*given), parts["direct"], rtol=1e-12, atol=1e-15)
    coarse = rungs["heightfield, 160 nodes, all bounces"]
    assert coarse.skips == ("all slopes of the model",)
    torch.testing.assert_close(coarse.model(*given), model(*given), rtol=3e-3, atol=0)


def test_without_occlusion_near_by_it_is_smiths_surface():
    (smith,) = heightfield().stand_ins()["occlusion near by"]
    assert smith.skips == (effects.OCCLUSION_NEAR_BY,)
    plain = heightfield(occlusion=fixed(number(0.0)))
    torch.testing.assert_close(smith.model(*directions(50)), plain(*directions(50)), rtol=1e-12, atol=0)
    assert "occlusion near by" not in plain.stand_ins()
    assert "occlusion near by" not in simulated(plain)
    # the fit has an occlusion that Smith's surface lacks: it stands in for no Smith surface
    assert not any(isinstance(k.model, FastGaussianHeightfield) for k in plain.stand_ins()["rung"])
    assert plain.stand_ins()["rung"][0].skips == simulated(plain)


def test_planner_takes_the_cheapest_rung_that_is_close():
    scene = Scene(sphere(24, 24), [Distant.from_angle(40)])
    model = GaussianHeightfield(albedo=0.6, sigma=0.5, nodes=160, polar_nodes=6, table_orders=4)
    loose, tight = (plan(scene, model, tolerance, pixels=100) for tolerance in (0.05, 1e-5))
    assert isinstance(loose.model, FastGaussianHeightfield)
    assert isinstance(tight.model, GaussianHeightfield)
    rows = {effect.name: effect for effect in tight.effects}
    assert rows["occlusion near by"].simulate
    assert rows["occlusion near by"].size > 1e-3


def traced(name):
    """Directions and path-traced reflectance (10, 10, 9) at rho = 0.9, the weight of each azimuth, and sigma."""
    with np.load(DATA / "heightfield_traced.npz") as file:
        theta, truth = (torch.from_numpy(file[key]).double() for key in ("theta", f"{name}_full_0.9"))
        sigma = sigma_from_rms_slope(number(float(file[f"{name}_s"])))
    light, view, azimuth = torch.meshgrid(theta, theta, torch.arange(9, dtype=D) * (torch.pi / 8), indexing="ij")
    phase = light.cos() * view.cos() + light.sin() * view.sin() * azimuth.cos()
    weight = torch.tensor([1.0] + 7 * [2.0] + [1.0], dtype=D) / 16  # of 0 .. 180 degrees, for the whole circle
    return Cosines.from_products(light.cos(), view.cos(), phase), truth, weight, sigma


@pytest.mark.parametrize(
    ("name", "grooves", "fitted"), [("t12_0.3", 0.062, 0.004), ("t12_0.67", 0.118, 0.008), ("t12_1", 0.119, 0.009)]
)
def test_rungs_against_traced_surfaces(name, grooves, fitted):
    """The figures of docs/accuracy.md: the ladder against our own reference tells what path tracing tells."""
    cosines, truth, weight, sigma = traced(name)

    def error(rung):
        with torch.no_grad():
            miss = rung.build(number(0.9), sigma).evaluate(cosines)[..., 0] / truth - 1
        return (miss.square() * weight).sum(-1).mean().sqrt().item()

    errors = {rung.name: error(rung) for rung in DIFFUSE_RUNGS}
    assert errors["exact V-cavities"] == pytest.approx(grooves, abs=0.002)
    assert errors["fast V-cavities"] == pytest.approx(grooves, abs=0.004)
    assert errors["fast heightfield"] < fitted
    assert errors["heightfield, 240 nodes"] < fitted
    assert 0.012 < errors["Smith"] < 0.018
    assert 0.08 < errors["EON"] < errors["Fujii"] < 0.18


def test_each_truth_is_close_to_its_own_rungs_alone():
    cosines = Cosines.of(*directions(150, seed=3))
    grooves, heights = (
        relative_errors(DIFFUSE_RUNGS, [math.radians(30)], [0.7], cosines, against=truth)
        for truth in (reference, heightfield_reference)
    )
    assert len(grooves) == len(DIFFUSE_RUNGS)  # no name twice
    for name in ("fast V-cavities", "exact V-cavities"):
        assert grooves[name][1] < 0.01
        assert heights[name][1] > 0.05
    for name in ("fast heightfield", "heightfield, 160 nodes", "heightfield, 240 nodes"):
        assert heights[name][1] < 0.002
        assert grooves[name][1] > 0.05
    assert heights["heightfield, 240 nodes"][1] < heights["heightfield, 160 nodes"][1] < heights["Smith"][1]
