"""Ladders of stand-ins: each rung leaves out less of the same material, and what it says."""

import pytest
import torch
from helpers.two_channels import D, material, number

from torchbrdf import EFFECTS, FastRoughSurface, Lambert, OrenNayar, RoughSurface, fixed, simulated
from torchbrdf.testing import random_directions

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


def test_what_is_held_stays_held():
    model = RoughSurface(albedo=fixed(number(0.5)), sigma=number(0.4))
    for rung in model.stand_ins()["rung"]:
        names = {name for name, _ in rung.model.named_parameters()}
        assert names == (set() if isinstance(rung.model, Lambert) else {"raw_sigma"})
