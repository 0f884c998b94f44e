"""Stand-ins: what they keep of a material, what they say they leave out, and that they do."""

import pytest
import torch

import torchbrdf
from torchbrdf import (
    BRDF,
    EFFECTS,
    EON,
    GGX,
    AnisotropicGGX,
    AnisotropicRoughSurface,
    Beckmann,
    ConstantFresnel,
    Dielectric,
    FastRoughSurface,
    Lambert,
    OrenNayar,
    Oriented,
    Perfect,
    RoughSurface,
    TorranceSparrow,
    WeightedSum,
    fixed,
    simulated,
)  # fmt: skip
from torchbrdf.testing import random_directions

D = torch.float64


def number(value):
    return torch.tensor(value, dtype=D)


def material(kind, **more):
    return kind(albedo=torch.tensor([0.7, 0.4], dtype=D), sigma=number(0.5), **more)


LADDERS = {
    "exact": lambda: material(RoughSurface, bounces="all"),
    "exact, two bounces": lambda: material(RoughSurface),
    "exact, one bounce": lambda: material(RoughSurface, bounces=1, nodes=6),
    "fast": lambda: material(FastRoughSurface),
    "functional": lambda: material(OrenNayar),
    "functional, direct": lambda: material(OrenNayar, interreflection=False),
}


@pytest.mark.parametrize("name", LADDERS)
def test_rungs_leave_out_less_and_less_of_the_same_material(name):
    model = LADDERS[name]()
    rungs = model.stand_ins()["rung"]
    assert set(simulated(model)) <= set(EFFECTS)
    assert rungs[0].skips == simulated(model)
    for rung in rungs:
        assert rung.skips
        assert torch.equal(rung.model.albedo, model.albedo)
        assert isinstance(rung.model, Lambert) or torch.equal(rung.model.sigma, model.sigma)
    assert len({rung.choice for rung in rungs}) == len(rungs)


def test_what_each_rung_says_it_leaves_out_is_what_it_leaves_out():
    """Two bounces differ from all by the later ones alone; without C3 a functional form is 0 there; and so on."""
    model = material(RoughSurface, bounces="all")
    found = {k.choice: k for k in model.stand_ins()["rung"]}
    directions = random_directions(50, dtype=D, generator=torch.Generator().manual_seed(0))
    parts = model.components(*directions)
    two = found["exact, K = 16, 2 bounces"]
    assert two.skips == ("third and later bounces",)
    torch.testing.assert_close(two.model(*directions) + parts["higher"], model(*directions), rtol=1e-12, atol=1e-15)
    one = found["exact, K = 16, 1 bounce"]
    assert set(one.skips) == {"interreflection in cavities", "third and later bounces"}
    torch.testing.assert_close(one.model(*directions), parts["direct"], rtol=1e-12, atol=1e-15)


def test_c3_acts_across_the_plane_of_incidence_alone():
    whole, without = material(OrenNayar), material(OrenNayar, c3=False)
    up = torch.tensor([0.0, 0, 1], dtype=D)
    light = torch.tensor([0.8, 0, 0.6], dtype=D)
    along, across = torch.tensor([0.6, 0, 0.8], dtype=D), torch.tensor([0, 0.6, 0.8], dtype=D)
    torch.testing.assert_close(whole(up, light, along), without(up, light, along), rtol=1e-14, atol=0)
    # (27) at dphi = 90 deg: C3 tan((a + b)/2) with C3 = 0.125 s (4 a b/pi^2)^2
    a, b = torch.acos(light[2]), torch.acos(across[2])
    c3 = 0.125 * 0.25 / (0.25 + 0.09) * (4 * a * b / torch.pi**2) ** 2 * torch.tan((a + b) / 2)
    difference = whole(up, light, across) - without(up, light, across)
    torch.testing.assert_close(difference, whole.albedo / torch.pi * c3, rtol=1e-7, atol=0)


def test_what_is_held_stays_held():
    model = RoughSurface(albedo=fixed(number(0.5)), sigma=number(0.4))
    for rung in model.stand_ins()["rung"]:
        names = {name for name, _ in rung.model.named_parameters()}
        assert names == (set() if isinstance(rung.model, Lambert) else {"raw_sigma"})


def test_parts_of_a_sum():
    model = WeightedSum([material(OrenNayar), GGX(alpha=number(0.3), fresnel=Dielectric(eta=number(1.5)))], [0.9, 0.2])
    groups = model.stand_ins()
    assert list(groups) == ["rung of part 1", "Fresnel variation of part 2", "part 1", "part 2"]
    directions = random_directions(20, dtype=D, generator=torch.Generator().manual_seed(1))
    alone = groups["part 2"][0].model
    assert [type(part) for part in alone.parts] == [OrenNayar]
    torch.testing.assert_close(alone(*directions), 0.9 * material(OrenNayar)(*directions))
    assert set(alone.stand_ins()) == {"rung of part 1"}  # the last part stays
    model = WeightedSum(list(model.parts), fixed(number([0.9, 0.2])))
    assert not [name for name, _ in model.stand_ins()["part 2"][0].model.named_parameters() if "weights" in name]
    assert simulated(model, by_part=False)[-3:] == ("Fresnel variation", "part 1", "part 2")


def test_parts_that_stay_keep_their_names():
    model = WeightedSum([GGX(alpha=number(0.3)), material(OrenNayar), EON(albedo=number([0.3]))], [0.1, 0.9, 0.3])
    (dropped,) = model.stand_ins()["part 1"]
    assert [type(part) for part in dropped.model.parts] == [OrenNayar, EON]
    groups = dropped.model.stand_ins()
    assert list(groups) == ["rung of part 2", "rung of part 3", "part 2", "part 3"]
    assert groups["part 2"][0].skips[:2] == ("part 2", "roughness of part 2")
    assert dropped.renamed == {
        "parts.0.albedo": "parts.1.albedo",
        "parts.0.sigma": "parts.1.sigma",
        "parts.1.albedo": "parts.2.albedo",
        "parts.1.roughness": "parts.2.roughness",
    }
    for stand_in, given in dropped.renamed.items():
        assert torch.equal(value(dropped.model, stand_in), value(model, given))
    inner = WeightedSum([Lambert(albedo=number(0.2)), model], [1.0, 1.0])
    (dropped,) = inner.stand_ins()["part 1 of part 2"]
    assert dropped.skips[0] == "part 1 of part 2"
    assert dropped.renamed["parts.1.parts.0.sigma"] == "parts.1.parts.1.sigma"
    assert "roughness" in simulated(inner, by_part=False)


def value(model, path):
    *modules, last = path.split(".")
    return getattr(model.get_submodule(".".join(modules)), last)


def test_constant_reflectance_is_that_of_normal_incidence():
    up = torch.tensor([0.0, 0, 1], dtype=D)
    glass = Dielectric(eta=number(1.5))
    lobes = (GGX(alpha=number(0.3)), Beckmann(alpha=number(0.3)), TorranceSparrow(sigma=number(0.3), fresnel=glass))
    for lobe in lobes:
        flat = lobe.stand_ins()["Fresnel variation"][0].model
        assert isinstance(flat.fresnel, ConstantFresnel)
        torch.testing.assert_close(flat(up, up, up), lobe(up, up, up), rtol=1e-6, atol=0)
        side = torch.tensor([0.96, 0, 0.28], dtype=D)
        mirrored = torch.tensor([-0.96, 0, 0.28], dtype=D)
        assert (flat(up, side, mirrored) < 0.7 * lobe(up, side, mirrored)).all()
    assert "Fresnel variation" not in TorranceSparrow(fresnel=Perfect()).stand_ins()


def test_anisotropic_models_have_an_isotropic_one():
    brushed = Oriented(AnisotropicGGX(alpha_x=number(0.4), alpha_y=number(0.4)), torch.tensor([1.0, 0, 0.3], dtype=D))
    rounded = brushed.stand_ins()["anisotropy"][0].model
    assert isinstance(rounded, GGX)
    directions = random_directions(20, dtype=D, generator=torch.Generator().manual_seed(2))
    torch.testing.assert_close(rounded(*directions), brushed(*directions))
    grooves = AnisotropicRoughSurface(albedo=number(0.5), sigma_x=number(0.3), sigma_y=number(0.4))
    stand_in = grooves.stand_ins()["anisotropy"][0].model
    assert isinstance(stand_in, RoughSurface)
    assert stand_in.sigma.item() == pytest.approx(0.5**0.5 * 0.5)


def test_turned_stand_ins_know_their_former_names():
    """Bare where they have no grain, turned where they have."""
    brushed = AnisotropicGGX(alpha_x=number(0.2), alpha_y=number(0.4), fresnel=Dielectric(eta=number(1.5)))
    model = Oriented(brushed, torch.tensor([1.0, 0, 0.3], dtype=D))
    (rounded,) = model.stand_ins()["anisotropy"]
    assert rounded.renamed == {"fresnel.eta": "brdf.fresnel.eta"}
    (flat,) = model.stand_ins()["Fresnel variation"]
    assert isinstance(flat.model, Oriented)
    assert flat.renamed == {}
    pair = 0.3 * brushed + 0.7 * GGX(alpha=number(0.1))
    (dropped,) = Oriented(pair, model.direction).stand_ins()["part 1"]
    assert dropped.renamed == {
        "parts.0.alpha": "brdf.parts.1.alpha",
        "parts.0.fresnel.f0": "brdf.parts.1.fresnel.f0",
        "weights": "brdf.weights",
    }
    (dropped,) = Oriented(pair, model.direction).stand_ins()["part 2"]
    assert dropped.renamed == {}


def test_eon_without_its_returned_light_is_fujii():
    eon = EON(albedo=number([0.7, 0.4]), roughness=fixed(number(0.6)))
    smooth, fujii = eon.stand_ins()["rung"]
    directions = random_directions(50, dtype=D, generator=torch.Generator().manual_seed(3))
    assert smooth.skips == ("roughness", "interreflection in cavities")
    torch.testing.assert_close(smooth.model(*directions), Lambert(albedo=eon.albedo.detach())(*directions))
    assert fujii.skips == ("interreflection in cavities",)
    torch.testing.assert_close(fujii.model(*directions), eon.components(*directions)["direct"])
    assert [name for name, _ in fujii.model.named_parameters()] == ["raw_albedo"]
    assert [k.choice for k in fujii.model.stand_ins()["rung"]] == ["Lambert"]


def test_an_interreflection_alone_has_no_stand_in():
    assert material(OrenNayar, direct=False).stand_ins() == {}


def test_models_without_stand_ins():
    for model in (Lambert(), Perfectly()):
        assert model.stand_ins() == {}
        assert simulated(model) == ()


class Perfectly(BRDF):
    """Somebody's own model that says nothing of stand-ins."""

    def evaluate_components(self, cosines):
        return {"all": cosines.light[..., None] / torch.pi}


def test_options_is_an_old_name():
    with pytest.warns(DeprecationWarning, match="stand_ins"):
        options = torchbrdf.options
    assert list(options(material(OrenNayar))) == ["rung"]


@pytest.mark.parametrize(("name", "what"), [("sampling_laws", "assert_weights"), ("accuracy_series", "series_ladder")])
def test_modules_that_moved_are_found_under_their_old_names(name, what):
    with pytest.warns(DeprecationWarning, match="is now part of"):
        assert callable(getattr(getattr(torchbrdf, name), what))
