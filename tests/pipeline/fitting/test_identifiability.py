"""Error bars cover the truth, and the fit does not claim what the photographs do not say."""

import math

import pytest
import torch
from helpers.photographs import LIGHTS, clay, per_texel, photographed, scene_and_photographs
from scipy.stats import binom

from inverse import Distant, Scene, Sensor, fit, plane, render, sphere, vase
from torchbrdf import Lambert, OrenNayar, QualitativeOrenNayar, fixed

D = torch.float64


def test_stated_interval_covers_the_truth_as_often_as_it_says():
    # 68.3 % expected; 58..78 of 100 is missed by chance with the probability asserted here (per parameter)
    assert binom.cdf(57, 100, math.erf(1 / math.sqrt(2))) + binom.sf(78, 100, math.erf(1 / math.sqrt(2))) < 0.032
    scene = Scene(vase(48, 48, dtype=D), LIGHTS, Sensor(exposure=3.0, read_noise=0.01))
    clean = render(scene, clay()).detach()
    lit = clean[..., 0] > 0.02  # clear of the clipping at black
    covered = {"sigma": 0, "albedo": 0}
    for seed in range(100):
        noisy = scene.sensor.expose(clean, torch.Generator().manual_seed(seed))
        found = fit(scene, noisy, OrenNayar(), valid=lit)
        for name, truth in {"sigma": math.radians(40), "albedo": 0.7}.items():
            covered[name] += abs(found.parameters[name].item() - truth) < found.standard_error[name].item()
    assert all(58 <= count <= 78 for count in covered.values()), covered


def test_per_texel_albedo_with_one_sigma():
    lights = [Distant.from_angle(a) for a in (0, 20, -30, 45)]
    scene = Scene(sphere(24, 24, dtype=D), lights, Sensor(exposure=1.5))
    points = int(scene.surface.mask.sum())
    albedo = 0.3 + 0.5 * torch.rand(points, 2, dtype=D, generator=torch.Generator().manual_seed(0))
    photographs = photographed(scene, OrenNayar(albedo=albedo, sigma=torch.tensor(0.5, dtype=D)))
    noise = 1e-3 * torch.randn(photographs.shape, dtype=D, generator=torch.Generator().manual_seed(1))
    photographs = photographs + noise * scene.surface.mask[..., None]
    found = fit(scene, photographs, OrenNayar(albedo=torch.full((points, 2), 0.5), sigma=0.3))
    z = (found.parameters["albedo"] - albedo) / found.standard_error["albedo"]
    assert abs(found.parameters["sigma"].item() - 0.5) < 4 * found.standard_error["sigma"].item()
    # unit variance to 4 standard errors of a chi-square of this many values; neighbours share only sigma's error
    assert abs(z[z.isfinite()].square().mean().item() - 1) < 4 * math.sqrt(2 / z.isfinite().sum().item())
    # the same by dense linear algebra: the standard error of sigma from the full Jacobian
    assert found.standard_error["sigma"].item() == pytest.approx(
        _dense_sigma_error(scene, photographs, found), rel=1e-6
    )


def _dense_sigma_error(scene, photographs, found):
    model = found.model
    points = int(scene.surface.mask.sum())

    def predict(sigma, albedo):
        fresh = OrenNayar(albedo=fixed(albedo), sigma=fixed(sigma))
        return (render(scene, fresh) * scene.sensor.exposure)[:, scene.surface.mask]

    albedo, sigma = model.albedo.detach(), model.sigma.detach()
    step = 1e-6
    by_sigma = (predict(sigma + step, albedo) - predict(sigma - step, albedo)) / (2 * step)
    by_albedo = (predict(sigma, albedo + step) - predict(sigma, albedo - step)) / (2 * step)
    residual = (photographs[:, scene.surface.mask] - predict(sigma, albedo)).square().sum()
    information = by_sigma.square().sum() - ((by_sigma * by_albedo).sum(0).square() / by_albedo.square().sum(0)).sum()
    noise = residual / (by_sigma.numel() - 2 * points - 1)
    return (noise / information).sqrt().item()


def test_lambertian_object_has_no_confident_sigma():
    scene = Scene(sphere(48, 48, dtype=D), [Distant.from_angle(0)], Sensor(exposure=2.0, read_noise=0.01))
    photographs = photographed(scene, Lambert(albedo=0.7).double())
    clear = render(scene, Lambert(albedo=0.7).double())[..., 0] > 0.05  # noise clipped at black looks like roughness
    found = fit(scene, photographs, OrenNayar(), valid=clear)
    assert found.status == "at bound"
    assert "sigma" in found.reason
    assert "95 %" in found.reason


def test_flat_plate_lit_straight_on_cannot_tell_sigma_from_albedo():
    scene = Scene(plane(16, 16, dtype=D), [Distant.from_angle(0)], Sensor(exposure=2.0, read_noise=0.01))
    found = fit(scene, photographed(scene, clay()), OrenNayar())
    assert found.status == "not identified"
    assert "albedo from sigma" in found.reason
    assert "unknown" in found.estimate("sigma")


def test_noise_that_swamps_sigma_is_said():
    scene = Scene(sphere(16, 16, dtype=D), [Distant.from_angle(0)], Sensor(exposure=1.0, read_noise=0.2))
    found = fit(scene, photographed(scene, clay(albedo=0.5)) + 0.3, OrenNayar(), free_ambient=True)
    assert found.status in ("not identified", "at bound")


def test_an_unlit_object_says_nothing():
    scene, photographs = scene_and_photographs([180])
    found = fit(scene, photographs, OrenNayar())
    assert found.status == "not identified"
    assert "changes nothing" in found.reason
    assert not any(error.isfinite().any() for error in found.standard_error.values())


def test_an_image_left_out_says_nothing_of_its_exposure():
    scene, photographs = scene_and_photographs([0, 20, -30])
    valid = scene.surface.mask.repeat(3, 1, 1)
    valid[2] = False
    found = fit(scene, photographs, OrenNayar(), valid=valid, free_exposure=True)
    assert found.status == "not identified"
    assert "exposure[2]" in found.reason
    assert found.standard_error["exposure"].isfinite().tolist() == [True, False]


def test_texels_that_explain_everything_leave_nothing_for_sigma():
    scene, photographs = scene_and_photographs([20, 20, 20])  # one light three times
    found = fit(scene, photographs, OrenNayar(albedo=per_texel(scene)))
    assert found.status == "not identified"
    assert "sigma from the albedo of each texel" in found.reason


def test_sigma_and_albedo_of_each_texel_need_several_lights():
    scene, photographs = scene_and_photographs([0, 40])
    start = OrenNayar(albedo=per_texel(scene), sigma=per_texel(scene)[:, 0])
    found = fit(Scene(scene.surface, scene.lights[:1], scene.sensor), photographs[:1], start)
    assert not found.standard_error["sigma"].isfinite().any()
    assert "1468 of 1468 texels not identified" in found.reason


def test_texels_on_a_bound_are_counted():
    scene, photographs = scene_and_photographs([0, 30, -30], noise=0.0, exposure=2.0)
    photographs[:, 20:22, 20:22] *= 1.6  # brighter than albedo 1 allows: 0.7 times 1.6
    found = fit(scene, photographs, QualitativeOrenNayar(albedo=per_texel(scene)))
    assert "4 of 1468 texels on a bound" in found.reason
