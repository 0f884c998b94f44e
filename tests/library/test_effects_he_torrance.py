"""What may be left out of the He-Torrance model: any of its parts but the last."""

import pytest
import torch
from torch.testing import assert_close

from torchbrdf import EFFECTS, HeTorrance, fixed, options, simulated
from torchbrdf.testing import random_directions

PART_OF = {
    "specular spike": "specular",
    "directional diffuse": "directional_diffuse",
    "uniform diffuse": "uniform_diffuse",
}


def surface(**parts):
    return HeTorrance(
        sigma0=torch.tensor(0.1), tau=torch.tensor(1.5), wavelength=fixed(torch.tensor([0.65, 0.55])),
        eta=torch.tensor([1.4, 1.5]), diffuse=fixed(0.2), solid_angle=0.3, **parts,
    )  # fmt: skip


def test_each_part_is_an_effect():
    model = surface()
    assert simulated(model) == tuple(PART_OF)
    assert set(PART_OF) <= set(EFFECTS)
    directions = random_directions(50, generator=torch.Generator().manual_seed(0))
    whole = model.components(*directions)
    for effect, found in options(model).items():
        (option,) = found
        assert option.skips == (effect,)
        left = option.model.components(*directions)
        assert set(left) == set(whole) - {PART_OF[effect]}
        for name, part in left.items():
            assert_close(part, whole[name], rtol=1e-6, atol=0)


def test_parameters_stay_trainable_or_held():
    model = surface()
    for found in options(model).values():
        for option in found:
            stand_in = option.model
            assert isinstance(stand_in, HeTorrance)
            assert {name for name, _ in stand_in.named_parameters()} == {name for name, _ in model.named_parameters()}
            assert stand_in.solid_angle == model.solid_angle


@pytest.mark.parametrize("left_out", ["specular", "directional_diffuse", "uniform_diffuse"])
def test_the_last_part_stays(left_out):
    model = surface(**{left_out: False})
    assert model.parts == tuple(name for name in HeTorrance.PARTS if name != left_out)
    for found in options(model).values():
        (option,) = found
        assert isinstance(option.model, HeTorrance)
        assert len(option.model.parts) == 1
        assert options(option.model) == {}
    assert len(options(model)) == 2
