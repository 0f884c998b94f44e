"""Stand-ins: what they keep of a material, what they say they leave out, and that they do."""

import pytest
import torch

from torchbrdf import (
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
    QualitativeOrenNayar,
    RoughSurface,
    TorranceSparrow,
    WeightedSum,
    compact,
    fixed,
    options,
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
    rungs = options(model)["rung"]
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
    found = {k.choice: k for k in options(model)["rung"]}
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
    for rung in options(model)["rung"]:
        names = {name for name, _ in rung.model.named_parameters()}
        assert names == (set() if isinstance(rung.model, Lambert) else {"raw_sigma"})


def test_parts_of_a_sum():
    model = WeightedSum([material(OrenNayar), GGX(alpha=number(0.3), fresnel=Dielectric(eta=number(1.5)))], [0.9, 0.2])
    groups = options(model)
    assert set(groups) == {"part 1", "rung of part 1", "part 2", "Fresnel variation of part 2"}
    directions = random_directions(20, dtype=D, generator=torch.Generator().manual_seed(1))
    dropped = groups["part 2"][0].model
    assert [type(part) for part in dropped.parts] == [OrenNayar, Lambert]
    alone, places = compact(dropped)
    assert places == (0,)
    assert [type(part) for part in alone.parts] == [OrenNayar]
    torch.testing.assert_close(alone(*directions), 0.9 * material(OrenNayar)(*directions))
    torch.testing.assert_close(dropped(*directions), alone(*directions))
    assert set(options(dropped)) == {"rung of part 1"}  # the last part stays
    model = WeightedSum(list(model.parts), fixed(number([0.9, 0.2])))
    assert not [name for name, _ in options(model)["part 2"][0].model.named_parameters() if "weights" in name]


def test_constant_reflectance_is_that_of_normal_incidence():
    up = torch.tensor([0.0, 0, 1], dtype=D)
    glass = Dielectric(eta=number(1.5))
    lobes = (GGX(alpha=number(0.3)), Beckmann(alpha=number(0.3)), TorranceSparrow(sigma=number(0.3), fresnel=glass))
    for lobe in lobes:
        flat = options(lobe)["Fresnel variation"][0].model
        assert isinstance(flat.fresnel, ConstantFresnel)
        torch.testing.assert_close(flat(up, up, up), lobe(up, up, up), rtol=1e-6, atol=0)
        side = torch.tensor([0.96, 0, 0.28], dtype=D)
        mirrored = torch.tensor([-0.96, 0, 0.28], dtype=D)
        assert (flat(up, side, mirrored) < 0.7 * lobe(up, side, mirrored)).all()
    assert "Fresnel variation" not in options(TorranceSparrow(fresnel=Perfect()))


def test_anisotropic_models_have_an_isotropic_one():
    brushed = Oriented(AnisotropicGGX(alpha_x=number(0.4), alpha_y=number(0.4)), torch.tensor([1.0, 0, 0.3], dtype=D))
    rounded = options(brushed)["anisotropy"][0].model
    assert isinstance(rounded, GGX)
    directions = random_directions(20, dtype=D, generator=torch.Generator().manual_seed(2))
    torch.testing.assert_close(rounded(*directions), brushed(*directions))
    grooves = AnisotropicRoughSurface(albedo=number(0.5), sigma_x=number(0.3), sigma_y=number(0.4))
    stand_in = options(grooves)["anisotropy"][0].model
    assert isinstance(stand_in, RoughSurface)
    assert stand_in.sigma.item() == pytest.approx(0.5**0.5 * 0.5)


def test_models_without_stand_ins():
    for model in (Lambert(), EON(), QualitativeOrenNayar()):
        assert options(model) == {}
        assert simulated(model) == ()
        assert compact(model) == (model, ())
