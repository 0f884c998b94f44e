"""Models fitted to measured reflectance: known parameters come back, real paints are glossy."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from inverse import FitError, Measurements, fit_measurements, read_gonioreflectometer, weighted_reflectance
from torchbrdf import (
    GGX,
    AnisotropicGGX,
    Cosines,
    FastRoughSurface,
    Lambert,
    OrenNayar,
    RoughSurface,
    Schlick,
    WeightedSum,
    fixed,
)

DOUBLE = torch.float64
CORNELL = Path(__file__).parents[4] / "shared" / "data" / "cornell_brdf"


def directions(count=300, steepest=1.35, seed=3):
    """Measurements without values: light and view at random angles [rad] from the normal."""
    generator = torch.Generator().manual_seed(seed)
    theta, phi = torch.rand(2, 2, count, generator=generator, dtype=DOUBLE) * torch.tensor([[[steepest]], [[6.28]]])
    light, view = torch.stack((theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()), -1)
    return Measurements(light, view, light.new_zeros(count, 1), torch.tensor([550.0]))


def measured(model, where, noise=0.0, seed=0):
    """What the model says there, with noise [1/sr] in f_r cos(light) cos(view)."""
    values = model.to(DOUBLE)(torch.tensor([0.0, 0, 1], dtype=DOUBLE), where.light, where.view,
                              tangent=torch.tensor([1.0, 0, 0], dtype=DOUBLE)).detach()  # fmt: skip
    drawn = torch.randn(values.shape, generator=torch.Generator().manual_seed(seed), dtype=DOUBLE)
    return replace(where, values=values + noise * drawn / (where.light[:, 2:] * where.view[:, 2:]))


def over(body, gloss):
    """Their sum, each as bright as its own parameters say."""
    both = body + gloss
    both.weights = fixed(torch.ones(2))
    return both


def test_a_rough_diffuse_material_comes_back_with_its_error():
    truth = OrenNayar(albedo=torch.tensor([0.7, 0.4]), sigma=0.5)
    noisy = measured(truth, directions(), noise=2e-3)
    found = fit_measurements(noisy, OrenNayar(albedo=torch.tensor([0.5, 0.5]), sigma=0.2))
    assert found.status == "converged"
    assert found.samples == 600
    assert found.residual_rms == pytest.approx(2e-3, rel=0.1)
    for name, value in (("albedo", [0.7, 0.4]), ("sigma", 0.5)):
        pull = (found.parameters[name] - torch.tensor(value, dtype=DOUBLE)) / found.standard_error[name]
        assert (pull.abs() < 4).all()
    assert (found.standard_error["albedo"] < 0.01).all()
    assert "1/sr, 600 samples" in str(found)


@pytest.mark.parametrize("knee", [math.inf, 0.01])
def test_a_glossy_mixture_comes_back(knee):
    def paint(albedo, alpha, f0):
        return over(Lambert(albedo=torch.full((3,), albedo)), GGX(alpha=alpha, fresnel=Schlick(f0=f0)))

    data = measured(paint(0.2, 0.15, 0.06), directions(1500))
    found = fit_measurements(data, paint(0.5, 0.3, 0.1), knee=knee)
    assert found.status == "converged"
    assert_close(found.parameters["parts.0.albedo"], torch.full((3,), 0.2, dtype=DOUBLE), rtol=1e-6, atol=0)
    assert found.parameters["parts.1.alpha"].item() == pytest.approx(0.15, rel=1e-6)
    assert found.parameters["parts.1.fresnel.f0"].item() == pytest.approx(0.06, rel=1e-6)


def test_the_x_axis_is_the_tangent():
    where = directions(1500, steepest=0.8)
    found = fit_measurements(measured(AnisotropicGGX(alpha_x=0.5, alpha_y=0.2), where), AnisotropicGGX())
    assert found.parameters["alpha_x"].item() == pytest.approx(0.5, rel=1e-3)
    assert found.parameters["alpha_y"].item() == pytest.approx(0.2, rel=1e-3)


def test_a_model_linear_in_its_images_is_fitted_like_any_other():
    where = directions(60)
    data = measured(RoughSurface(albedo=0.6, sigma=0.6, nodes=4, bounces=1), where)
    found = fit_measurements(data, RoughSurface(albedo=0.3, sigma=0.3, nodes=4, bounces=1))
    assert found.parameters["sigma"].item() == pytest.approx(0.6, abs=1e-6)
    fast = fit_measurements(data, FastRoughSurface(albedo=0.3, sigma=0.3))
    assert fast.residual_rms > 100 * found.residual_rms


def test_what_the_data_cannot_tell_is_said():
    data = measured(Lambert(albedo=0.5), directions(50))
    doubled = fit_measurements(data, WeightedSum([Lambert(albedo=0.4)], [1.0]))
    assert doubled.status == "not identified"
    assert "the data cannot tell" in doubled.reason
    noisy = measured(Lambert(albedo=0.5), directions(50), noise=0.01)
    smooth = fit_measurements(noisy, OrenNayar(albedo=0.4, sigma=0.3))
    assert smooth.status == "at bound"
    few = fit_measurements(measured(GGX(), directions(50)), GGX(alpha=0.7), max_steps=1, starts=2)
    assert few.status == "out of steps"


def test_pairs_below_the_horizon_do_not_count():
    data = measured(OrenNayar(albedo=0.6, sigma=0.4), directions(40))
    light, values = data.light.clone(), data.values.clone()
    light[:5, 2], values[:5] = 0.0, 7.0
    found = fit_measurements(replace(data, light=light, values=values), OrenNayar())
    assert found.samples == 35
    assert found.parameters["sigma"].item() == pytest.approx(0.4, abs=1e-6)


def test_weighted_reflectance_is_linear_below_its_knee_and_logarithmic_above():
    cosines = Cosines.from_products(*torch.tensor([[0.5, 0.5, -0.1], [0.8, 0.8, 0.5], [0.4, 0.4, 0.0]], dtype=DOUBLE))
    values = torch.tensor([[1e-4], [1e4], [3.0]], dtype=DOUBLE)
    assert weighted_reflectance(cosines, values)[:, 0].tolist() == pytest.approx([4e-5, 4e3, 0.0])
    small, large, below = weighted_reflectance(cosines, values, 0.01)[:, 0].tolist()
    assert small == pytest.approx(4e-5, rel=1e-5)
    assert large == pytest.approx(0.01 * np.log(2 * 4e3 / 0.01), rel=1e-10)
    assert below == 0


def test_refusals():
    data = measured(Lambert(albedo=0.5), directions(10))
    with pytest.raises(TypeError, match="model must be a BRDF"):
        fit_measurements(data, "Lambert")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="knee must be above 0"):
        fit_measurements(data, Lambert(), knee=0.0)
    with pytest.raises(ValueError, match="1 wavelengths, and the model 2"):
        fit_measurements(data, Lambert(albedo=torch.tensor([0.5, 0.5])))
    with pytest.raises(ValueError, match="1 entries not finite"):
        fit_measurements(
            replace(data, values=data.values.clone().index_fill_(0, torch.tensor(3), torch.nan)), Lambert()
        )
    with pytest.raises(ValueError, match=r"\(sample, wavelength\) with 10 samples; found shape \(9, 1\)"):
        fit_measurements(replace(data, values=data.values[:9]), Lambert())
    with pytest.raises(ValueError, match="all samples share"):
        fit_measurements(data, Lambert(albedo=torch.full((10, 1), 0.5)))
    with pytest.raises(ValueError, match="none of 10 has light and view"):
        fit_measurements(replace(data, light=-data.light), Lambert())
    with pytest.raises(ValueError, match="nothing to fit"):
        fit_measurements(data, Lambert(albedo=fixed(0.5)))
    with pytest.raises(FitError, match="diverged"):
        fit_measurements(replace(data, values=data.values * 1e200), Lambert())


@pytest.mark.skipif(not CORNELL.is_dir(), reason="the measured paints are not at hand")
def test_paint_is_glossy():
    paint = read_gonioreflectometer(CORNELL / "garnet_red.brdf")
    data = replace(paint, values=paint.values[:, [5, 15, 28]])
    body = {"albedo": torch.tensor([0.1, 0.1, 0.3])}
    matte = fit_measurements(data, OrenNayar(**body), knee=0.01)
    glossy = fit_measurements(data, over(Lambert(**body), GGX(fresnel=Schlick(f0=0.05))), knee=0.01, starts=2)
    assert glossy.status == "at bound"  # the red paint's body reflects no blue
    assert "parts.0.albedo[0]" in glossy.reason
    assert glossy.residual_rms < 0.5 * matte.residual_rms
