"""Plans ask the material what it could do without: anybody's own, parts of sums, and what only a stand-in offers."""

import copy

import pytest
import torch

from inverse import Distant, Scene, plan, render, sphere
from torchbrdf import BRDF, EON, GGX, HeTorrance, Lambert, Option, WeightedSum, fixed, simulated
from torchbrdf.effects import EffectOfPart
from torchbrdf.parameters import ALBEDO, WEIGHT, Constrained

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
