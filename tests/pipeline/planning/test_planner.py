"""Plans: what they leave out does not matter, of scenes and of anybody's own materials."""

import copy

import pytest
import torch
from helpers.planned_scenes import FRONT, OBLIQUE, SCENES, SENSOR, clay

from inverse import Distant, Scene, everything, plan, render, sphere
from torchbrdf import (
    BRDF,
    EON,
    GGX,
    FastRoughSurface,
    HeTorrance,
    Lambert,
    Option,
    OrenNayar,
    RoughSurface,
    WeightedSum,
    fixed,
    simulated,
)
from torchbrdf.effects import EffectOfPart
from torchbrdf.parameters import ALBEDO, WEIGHT, Constrained


def largest_error(scene, model, found):
    with torch.no_grad():
        full = render(everything(scene), model)
        return float((found.render() - full).abs().max() / full.max())


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
    script = Path(__file__).parents[3] / "examples" / "benchmarks" / "plans.py"
    runpy.run_path(str(script), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    shares = [float(line.split("largest error ")[1].split()[0]) for line in lines]
    assert len(shares) == 3
    assert max(shares) < 1


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


SCENE = Scene(sphere(24, 24), [Distant.from_angle(20)])


class Velvet(BRDF):
    """Lambert with a sheen, which it says it could do without."""

    albedo: Constrained = Constrained(ALBEDO)
    sheen: Constrained = Constrained(WEIGHT)

    def __init__(self, albedo, sheen):
        super().__init__()
        self.albedo, self.sheen = albedo, sheen

    def evaluate_components(self, cosines):
        edge = ((1 - cosines.light) * (1 - cosines.view))[..., None]
        return {"body": torch.atleast_1d(self.albedo) / torch.pi + 0 * edge, "sheen": self.sheen * edge}

    def stand_ins(self):
        plain = Option("no sheen", ("sheen",), 1.0 * Lambert(albedo=self.albedo.detach()), {"parts.0.albedo": "albedo"})
        return {"sheen": [plain]}


def test_a_model_of_your_own_is_planned():
    faint, strong = (plan(SCENE, Velvet(0.6, sheen), 0.01) for sheen in (1e-4, 0.5))
    assert not faint.simulates("sheen")
    assert isinstance(faint.model, WeightedSum)
    assert faint.names == {"parts.0.albedo": "albedo"}
    assert strong.simulates("sheen")
    assert isinstance(strong.model, Velvet)
    assert "nothing of it that Velvet could leave out" in str(strong)
    in_a_sum = plan(SCENE, 0.5 * Lambert(albedo=0.5) + 0.5 * Velvet(0.6, 1e-4), 0.01)
    assert not in_a_sum.simulates("sheen of part 2")
    assert in_a_sum.names == {"parts.1.parts.0.albedo": "parts.1.albedo"}


def test_names_are_followed_through_several_stand_ins():
    """Two parts go, the third is replaced: what is left of it is still called parts.2.albedo."""
    shiny = GGX(alpha=0.4)
    model = WeightedSum([shiny, shiny, EON(albedo=0.4, roughness=fixed(0.0))], fixed(torch.tensor([1e-5, 1e-5, 1.0])))
    found = plan(SCENE, model, 0.01)
    assert [type(part) for part in found.model.parts] == [Lambert]
    assert found.names == {"parts.0.albedo": "parts.2.albedo"}
    result = found.fit(render(SCENE, model).detach())
    assert float(result.parameters["parts.2.albedo"]) == pytest.approx(0.4, rel=1e-3)


@pytest.mark.filterwarnings("ignore:HeTorrance.tau")
def test_facets_stand_in_for_waves():
    """On a surface of heights of many wavelengths, and on no other."""
    up_close = {"wavelength": fixed(0.5), "eta": 1.5, "diffuse": fixed(0.3)}
    coarse = plan(SCENE, HeTorrance(sigma0=20.0, tau=100.0, **up_close), 0.01)
    assert not coarse.simulates("wave optics")
    assert not coarse.model.wave_optics
    assert [name for name, _ in coarse.model.named_parameters()] == ["raw_eta"]
    fine = plan(SCENE, HeTorrance(sigma0=0.1, tau=0.5, **up_close), 0.01)
    assert fine.simulates("wave optics")
    assert fine.model.wave_optics


def test_what_only_a_stand_in_could_leave_out_has_a_row_as_well():
    class Doubled(Velvet):
        def stand_ins(self):
            return {"doubling": [Option("once", ("doubling",), Velvet(self.albedo.detach(), self.sheen.detach()))]}

    found = plan(SCENE, Doubled(0.6, 1e-4), 0.01)
    rows = {effect.name: effect for effect in found.effects}
    assert not rows["doubling"].simulate
    assert not rows["sheen"].simulate
    assert rows["sheen"].reason == "small enough; instead: no sheen"


def test_effects_of_parts_know_their_kind():
    name = EffectOfPart(EffectOfPart("roughness", "part 1"), "part 2")
    assert name == "roughness of part 1 of part 2"
    assert name.kind == copy.deepcopy(name).kind == "roughness"
    assert simulated(0.5 * Lambert() + 0.5 * EON(), by_part=False)[:2] == ("roughness", "interreflection in cavities")
