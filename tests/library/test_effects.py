"""Stand-ins: what they keep of a material, what they say they leave out, and that they do."""

import pytest
import torch
from helpers.two_channels import D, number

from torchbrdf import BRDF, GGX, AnisotropicGGX, AnisotropicRoughSurface, Lambert, Oriented, RoughSurface, simulated
from torchbrdf.testing import random_directions


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


def test_models_without_stand_ins():
    for model in (Lambert(), Perfectly()):
        assert model.stand_ins() == {}
        assert simulated(model) == ()


class Perfectly(BRDF):
    """Somebody's own model that says nothing of stand-ins."""

    def evaluate_components(self, cosines):
        return {"all": cosines.light[..., None] / torch.pi}
