"""The table of the rough surface against the surface itself, between the sites."""

import math

import pytest
import torch
from helpers.coarse_tables import COARSE_ROUGH
from torch.testing import assert_close

from torchbrdf import (
    Cosines,
    InterpolatedRoughSurface,
    Lambert,
    RoughSurface,
    TableGrid,
    fixed,
    interpolated_rough_surface,
)
from torchbrdf.accuracy import converged
from torchbrdf.testing import random_directions

F64 = torch.float64


def f64(value):
    return torch.tensor(value, dtype=F64)


def cosines(count, seed, low=0.0, high=85.0):
    """Directions of which the more grazing one is between two angles [degree]."""
    c = Cosines.of(
        *random_directions(
            count, dtype=F64, max_angle=math.radians(high), generator=torch.Generator().manual_seed(seed)
        )
    )
    inside = c.alpha < math.cos(math.radians(low))
    return Cosines.from_products(c.light[inside], c.view[inside], c.phase[inside])


@pytest.mark.parametrize(("degrees", "rho"), [(3.7, 0.9), (17.0, 0.35), (43.0, 0.85)])
def test_a_coarse_table_is_close(degrees, rho):
    c, albedo, sigma = cosines(300, 1), f64(rho), f64(math.radians(degrees))
    with torch.no_grad():
        exact = RoughSurface(albedo=albedo, sigma=sigma, nodes=48, order=6, bounces="all").evaluate(c)
        error = (interpolated_rough_surface(c, albedo=albedo, sigma=sigma, grid=COARSE_ROUGH) - exact) * math.pi / rho
    assert error.square().mean().sqrt() < 2e-3
    assert error.abs().max() < 2e-2


@pytest.mark.slow
@pytest.mark.parametrize(("low", "high", "typical", "largest"), [(0, 85, 3e-4, 2e-3), (85, 89, 1e-3, 1e-2)])
def test_the_default_table_against_the_slow_reference(low, high, typical, largest):
    c = cosines(400, 2, low, high)
    draw = torch.rand(2, len(c.light), dtype=F64, generator=torch.Generator().manual_seed(3))
    albedo, sigma = (0.1 + 0.85 * draw[0])[:, None], torch.deg2rad(2 + 58 * draw[1])
    exact = converged(c, albedo=albedo, sigma=sigma)
    error = (interpolated_rough_surface(c, albedo=albedo, sigma=sigma) - exact) * math.pi / albedo
    assert error.square().mean().sqrt() < typical
    assert error.abs().max() < largest


@pytest.mark.slow
@pytest.mark.parametrize("high", [85, 89.9, 89.999])
def test_the_default_table_is_positive(high):
    c, albedos = cosines(5000, 7, high - 5, high), f64([0.05, 0.5, 1.0])
    for degrees in (0.5, 2, 10, 30, 60, 89):
        assert (interpolated_rough_surface(c, albedo=albedos, sigma=f64(math.radians(degrees))) > 0).all()


@pytest.mark.slow
def test_white_furnace_of_the_default_table():
    angles = torch.linspace(0, 85, 18, dtype=F64).deg2rad()
    for degrees in (2, 10, 30, 60):
        brdf = InterpolatedRoughSurface(albedo=fixed(f64(1.0)), sigma=fixed(f64(math.radians(degrees))))
        assert (brdf.directional_albedo(angles.cos(), nodes=64) - 1).abs().max() < 1.5e-3


def test_derivatives_by_the_material_are_those_of_the_surface():
    c, step = cosines(60, 4), 1e-4

    def exact(albedo, sigma):
        with torch.no_grad():
            brdf = RoughSurface(albedo=f64(albedo), sigma=f64(sigma), nodes=24, order=6, bounces="all")
            return brdf.evaluate(c).sum()

    expected = torch.stack(
        (exact(0.8 + step, 0.5) - exact(0.8 - step, 0.5), exact(0.8, 0.5 + step) - exact(0.8, 0.5 - step))
    ) / (2 * step)
    albedo, sigma = (f64(v).requires_grad_() for v in (0.8, 0.5))
    value = interpolated_rough_surface(c, albedo=albedo, sigma=sigma, grid=COARSE_ROUGH).sum()
    assert_close(torch.stack(torch.autograd.grad(value, (albedo, sigma))), expected, rtol=3e-2, atol=0)


def test_without_roughness_it_is_lambert():
    for dtype in (torch.float32, F64):
        directions = random_directions(200, dtype=dtype, generator=torch.Generator().manual_seed(0))
        albedo = torch.tensor([0.2, 0.9], dtype=dtype)
        smooth = InterpolatedRoughSurface(albedo=albedo, sigma=fixed(torch.zeros((), dtype=dtype)), grid=COARSE_ROUGH)
        rtol = 4 * torch.finfo(dtype).eps
        assert_close(smooth(*directions), Lambert(albedo=albedo)(*directions), rtol=rtol, atol=0)


def test_beyond_the_table_it_is_held():
    sigma, albedo = f64(0.5), f64(0.7)
    far, farther = (
        interpolated_rough_surface(
            Cosines.from_products(f64(cosine), f64(0.5), f64(0.1)), albedo=albedo, sigma=sigma, grid=COARSE_ROUGH
        )
        for cosine in (8.7e-4, 1e-9)
    )
    assert_close(far, farther, rtol=1e-2, atol=0)


def test_module_and_function_agree():
    albedo, sigma = torch.tensor([0.3, 0.6], dtype=F64), f64(0.4)
    c = cosines(30, 5)
    module = InterpolatedRoughSurface(albedo=albedo, sigma=sigma, grid=COARSE_ROUGH)
    expected = interpolated_rough_surface(c, albedo=albedo, sigma=sigma, grid=COARSE_ROUGH)
    assert_close(module.evaluate(c).detach(), expected)
    assert list(module.evaluate_components(c)) == ["all_bounces"]


def test_stand_ins_are_the_ladder_below():
    choices = [o.choice for o in InterpolatedRoughSurface(grid=COARSE_ROUGH).stand_ins()["rung"]]
    assert choices[0] == "Lambert"
    assert choices[-1] == "fast, all bounces"


@pytest.mark.slow
def test_compiles():
    brdf = InterpolatedRoughSurface(albedo=0.5, sigma=0.4, grid=COARSE_ROUGH)
    directions = random_directions(16)
    compiled = torch.compile(brdf, fullgraph=True, backend="aot_eager")
    assert_close(compiled(*directions), brdf(*directions), rtol=1e-5, atol=1e-6)


def test_wrong_input():
    c = cosines(4, 6)
    good = {"albedo": f64(0.5), "sigma": f64(0.3), "grid": COARSE_ROUGH}
    with pytest.raises(ValueError, match="interpolated_rough_surface: albedo must lie in"):
        interpolated_rough_surface(c, **good | {"albedo": f64(1.5)})
    with pytest.raises(ValueError, match="interpolated_rough_surface: sigma must lie in"):
        interpolated_rough_surface(c, **good | {"sigma": f64(2.0)})
    few = TableGrid(5, 12, 8, 12, 7, 12)
    with pytest.raises(ValueError, match="InterpolatedRoughSurface: grid needs at least 6 sites"):
        InterpolatedRoughSurface(grid=few)
