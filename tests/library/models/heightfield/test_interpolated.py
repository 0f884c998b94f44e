"""The table of the heightfield against the heightfield, between the sites."""

import math

import pytest
import torch
from helpers.coarse_tables import COARSE_HEIGHTFIELD
from helpers.heightfields import F64, f64, rms
from torch.testing import assert_close

from torchbrdf import (
    Cosines,
    InterpolatedGaussianHeightfield,
    gaussian_heightfield,
    interpolated_gaussian_heightfield,
)
from torchbrdf.testing import random_directions

COARSE = {"nodes": 160, "grid": COARSE_HEIGHTFIELD}
ALBEDOS = f64([0.15, 0.5, 0.95])


def cosines(count, seed, low=0.0, high=85.0):
    """Directions of which the more grazing one is between two angles [degree]."""
    c = Cosines.of(
        *random_directions(
            count, dtype=F64, max_angle=math.radians(high), generator=torch.Generator().manual_seed(seed)
        )
    )
    inside = c.alpha < math.cos(math.radians(low))
    return Cosines.from_products(c.light[inside], c.view[inside], c.phase[inside])


def apart(c, degrees, **settings):
    """Table less reference, times pi/rho."""
    sigma = f64(math.radians(degrees))
    exact = gaussian_heightfield(c, albedo=ALBEDOS, sigma=sigma, occlusion=f64(1.0), nodes=384)
    return (interpolated_gaussian_heightfield(c, albedo=ALBEDOS, sigma=sigma, **settings) - exact) * math.pi / ALBEDOS


@pytest.mark.parametrize("degrees", [9.0, 37.0])
def test_a_coarse_table_is_close(degrees):
    error = apart(cosines(150, 1, high=80.0), degrees, **COARSE)
    assert rms(error) < 5e-3
    assert error.abs().max() < 3e-2


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [4.0, 13.0, 27.0, 47.0, 58.0])
@pytest.mark.parametrize(("low", "high", "typical", "largest"), [(0, 85, 1e-3, 1e-2), (85, 89, 3e-3, 3e-2)])
def test_the_default_table(degrees, low, high, typical, largest):
    error = apart(cosines(400, 2, low, high), degrees)
    assert rms(error) < typical
    assert error.abs().max() < largest


@pytest.mark.slow
@pytest.mark.parametrize(("low", "high", "least"), [(0, 89, 0.0), (89, 89.9, -0.05), (89.9, 89.999, -5.0)])
def test_how_far_the_default_table_turns_negative(low, high, least):
    generator = torch.Generator().manual_seed(7)
    alpha, share, dphi = torch.rand(3, 5000, dtype=F64, generator=generator)
    alpha = torch.deg2rad(low + (high - low) * alpha)
    beta = (alpha.cos() + (1 - alpha.cos()) * share).acos()
    phase = alpha.cos() * beta.cos() + alpha.sin() * beta.sin() * (math.pi * dphi).cos()
    c = Cosines.from_products(alpha.cos(), beta.cos(), phase)
    for degrees in (0.5, 2, 10, 30, 60, 90):
        f = interpolated_gaussian_heightfield(
            c, albedo=ALBEDOS, sigma=f64(math.radians(degrees)).clamp(max=math.pi / 2)
        )
        assert (f * math.pi / ALBEDOS).min() >= least


def test_module_and_function_agree():
    c, sigma = cosines(30, 5), f64(0.4)
    module = InterpolatedGaussianHeightfield(albedo=ALBEDOS, sigma=sigma, **COARSE)
    expected = interpolated_gaussian_heightfield(c, albedo=ALBEDOS, sigma=sigma, **COARSE)
    assert_close(module.evaluate(c).detach(), expected)


def test_stand_ins():
    choices = [o.choice for o in InterpolatedGaussianHeightfield(**COARSE).stand_ins()["rung"]]
    assert choices == ["Lambert", "fast heightfield"]
    # the fit knows occlusion 1 alone: to a surface without it, it is no simpler model
    smith = InterpolatedGaussianHeightfield(occlusion=0.0, **COARSE)
    assert [o.choice for o in smith.stand_ins()["rung"]] == ["Lambert"]


def test_wrong_input():
    c = cosines(4, 6)
    with pytest.raises(ValueError, match="interpolated_gaussian_heightfield: sigma must lie in"):
        interpolated_gaussian_heightfield(c, albedo=f64(0.5), sigma=f64(2.0), **COARSE)
    with pytest.raises(ValueError, match="occlusion must lie in"):
        InterpolatedGaussianHeightfield(occlusion=2.0, **COARSE)
    with pytest.raises(ValueError, match="nodes must be one of"):
        InterpolatedGaussianHeightfield(nodes=100, grid=COARSE_HEIGHTFIELD)
