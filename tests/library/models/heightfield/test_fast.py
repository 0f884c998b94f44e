"""The fitted heightfield against the reference it is fitted to, on points the fit has not seen."""

import math

import pytest
import torch
from helpers.heightfields import F64, all_azimuths, cosines, f64, held, rms, traced, vectors, weights
from torch.testing import assert_close

from torchbrdf import (
    FastGaussianHeightfield,
    GaussianHeightfield,
    Lambert,
    fast_gaussian_heightfield,
    fixed,
    gaussian_heightfield,
)
from torchbrdf.models.heightfield.fast import heightfield_fields
from torchbrdf.models.network import BYTES_AT_A_TIME
from torchbrdf.testing import random_directions

ALBEDOS = f64([0.1, 0.3, 0.5, 0.7, 0.9, 0.95])


def random_angles(count, seed, low, high):
    generator = torch.Generator().manual_seed(seed)
    draw = torch.rand(3, count, dtype=F64, generator=generator)
    larger = torch.deg2rad(low + (high - low) * draw[0])
    return larger, larger * draw[1], math.pi * draw[2]


@pytest.mark.parametrize("degrees", [2, 8, 15, 27, 45, 60])
@pytest.mark.parametrize(("low", "high", "typical", "largest"), [(0, 85, 0.004, 0.03), (85, 89, 0.02, math.inf)])
def test_close_to_the_reference(degrees, low, high, typical, largest):
    c = cosines(*random_angles(600, degrees, low, high))
    sigma = f64(math.radians(degrees))
    exact = gaussian_heightfield(c, albedo=ALBEDOS, sigma=sigma, occlusion=f64(1.0))
    error = fast_gaussian_heightfield(c, albedo=ALBEDOS, sigma=sigma) / exact - 1
    assert rms(error) < typical
    assert error.abs().max() < largest


@pytest.mark.parametrize("name", ["t12_0.3", "t12_0.67", "t12_1"])
def test_close_to_traced_surfaces(name):
    slope, directions, truth = traced(name)
    sigma = GaussianHeightfield.from_rms_slope(held(slope)).sigma
    f = fast_gaussian_heightfield(directions, albedo=f64(0.9), sigma=sigma)[..., 0]
    assert rms(all_azimuths(f / truth["full_0.9"] - 1)) < 0.009


@pytest.mark.parametrize("degrees", [1, 5, 10, 20, 30, 45, 60])
def test_white_furnace(degrees):
    brdf = FastGaussianHeightfield(albedo=held(1.0), sigma=held(math.radians(degrees)))
    angles = torch.linspace(0, 85, 18, dtype=F64).deg2rad()
    assert (brdf.directional_albedo(angles.cos(), nodes=64) - 1).abs().max() < 0.003


def test_without_roughness_it_is_lambert():
    for dtype in (torch.float32, torch.float64):
        directions = random_directions(500, dtype=dtype, generator=torch.Generator().manual_seed(0))
        albedo = torch.tensor([0.2, 0.9], dtype=dtype)
        smooth = FastGaussianHeightfield(albedo=fixed(albedo), sigma=fixed(torch.zeros((), dtype=dtype)))
        assert_close(
            smooth(*directions),
            Lambert(albedo=fixed(albedo))(*directions),
            rtol=3e-7 if dtype == torch.float32 else 1e-15,
            atol=0,
        )


def test_even_in_sigma_where_it_starts():
    c = cosines(*random_angles(50, 1, 0, 80))
    sigma = torch.zeros((), dtype=F64, requires_grad=True)
    f = fast_gaussian_heightfield(c, albedo=f64(0.8), sigma=sigma)
    assert torch.autograd.grad(f.sum(), sigma)[0] == 0


def test_light_along_the_normal_knows_no_azimuth():
    turns = torch.linspace(0, 2 * math.pi, 25, dtype=F64)
    brdf = FastGaussianHeightfield(albedo=held(0.8), sigma=held(0.7))
    upright = brdf(*vectors(0.0, 1.2, turns))
    assert_close(upright, upright[:1].expand_as(upright), rtol=1e-12, atol=0)
    assert_close(brdf(*vectors(1e-6, 1.2, turns)), upright, rtol=2e-6, atol=0)


def test_above_zero_and_bounded_up_to_the_horizon():
    grazing = f64([89.0, 89.9, 89.99, 89.9999]).deg2rad()
    light, view, dphi, sigma = torch.meshgrid(
        grazing,
        torch.cat((f64([0.0, 1.0]), grazing)),
        f64([0.0, 0.3, 2.0, math.pi]),
        f64([0.02, 0.4, 1.0, 1.57]),
        indexing="ij",
    )
    for dtype in (torch.float32, torch.float64):
        directions = [v.to(dtype) for v in vectors(light, view, dphi)]
        brdf = FastGaussianHeightfield(albedo=fixed(torch.ones((), dtype=dtype)), sigma=fixed(sigma.to(dtype)))
        f = brdf(*directions, normalize=True)[..., 0]
        assert (f > 0).all()
        assert (f * directions[2][..., 2] < 1).all()


def test_pieces_change_nothing():
    # more pixels than are worked on at a time, each with its sigma and albedo, and their gradients
    count = BYTES_AT_A_TIME // 8 + 100
    generator = torch.Generator().manual_seed(2)
    directions = random_directions(count, dtype=F64, generator=generator)
    sigma = (1.5 * torch.rand(count, dtype=F64, generator=generator)).requires_grad_()
    c = GaussianHeightfield().cosines(*directions)
    whole = heightfield_fields(c, sigma)
    some = heightfield_fields(GaussianHeightfield().cosines(*(v[-50:] for v in directions)), sigma[-50:])
    for a, b in zip(whole, some, strict=True):
        assert_close(a[-50:], b, rtol=1e-12, atol=1e-15)
    (slope,) = torch.autograd.grad(whole.direct.sum(), sigma)
    (part,) = torch.autograd.grad(some.direct.sum(), sigma)
    assert_close(slope[-50:], part[-50:], rtol=1e-10, atol=1e-13)


def test_parts_and_fields():
    directions = random_directions(30, dtype=F64, generator=torch.Generator().manual_seed(3))
    brdf = FastGaussianHeightfield(albedo=held([0.3, 0.9]), sigma=held(0.6))
    parts = brdf.components(*directions)
    assert list(parts) == ["direct", "two_bounce", "higher"]
    exact = GaussianHeightfield(albedo=held([0.3, 0.9]), sigma=held(0.6)).components(*directions)
    whole = sum(exact.values())
    for name, part in parts.items():
        assert ((part - exact[name]) / whole).abs().max() < 0.02


def test_what_is_refused():
    c = cosines(0.1, 0.2, 0.3)
    with pytest.raises(ValueError, match=r"fast_gaussian_heightfield: albedo must lie in \[0, 1\]"):
        fast_gaussian_heightfield(c, albedo=f64(1.2), sigma=f64(0.3))
    with pytest.raises(ValueError, match=r"fast_gaussian_heightfield: sigma must lie in \[0, 1\.571\] rad"):
        fast_gaussian_heightfield(c, albedo=f64(0.2), sigma=f64(1.6))


@pytest.mark.parametrize("sigma", [5, 10, 20, 40, 60, 85])
def test_weights_are_bounded_and_nearly_equal(sigma):
    # the cosine alone: variance 0.7 of the squared mean and weights of 19 times the mean at 60 deg of roughness
    brdf = FastGaussianHeightfield(albedo=held(0.9), sigma=held(math.radians(sigma)))
    for degrees in (0, 45, 75, 85, 89):
        w = weights(brdf, degrees, 20_000)
        assert w.var() < 0.05 * w.mean() ** 2
        assert w.max() < 2.5 * w.mean()
