"""The fit recovers a known truth, its error bars cover it, and it says when it cannot."""

import math

import pytest
import torch
from scipy.stats import binom

from inverse import Ambient, Distant, FitError, Scene, Sensor, Surface, bootstrap, fit, plane, render, sphere, vase
from torchbrdf import (
    Lambert,
    OrenNayar,
    QualitativeOrenNayar,
    fixed,
    sigma_from_degrees,
    trainable,
)

DOUBLE = torch.float64
LIGHTS = [Distant.from_angle(0), Distant.from_angle(20)]


def clay(cls=OrenNayar, albedo=0.7, degrees=40.0, dtype=DOUBLE):
    return cls(albedo=torch.tensor(albedo, dtype=dtype), sigma=sigma_from_degrees(torch.tensor(degrees, dtype=dtype)))


def photographed(scene, model, seed=0):
    return scene.sensor.expose(render(scene, model), torch.Generator().manual_seed(seed)).detach()


@pytest.mark.parametrize("cls", [OrenNayar, QualitativeOrenNayar])
@pytest.mark.parametrize(("psf_sigma", "samples"), [(0.0, 1), (0.7, 2)])
def test_noise_free_photographs_give_the_truth(cls, psf_sigma, samples):
    scene = Scene(vase(48, 48, samples=samples, dtype=DOUBLE), LIGHTS, Sensor(exposure=3.0, psf_sigma=psf_sigma))
    found = fit(scene, photographed(scene, clay(cls)), cls())
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-5
    assert abs(found.parameters["albedo"].item() - 0.7) < 1e-8
    assert found.status == "converged"


def test_float32_recovers_to_its_own_precision():
    scene = Scene(vase(48, 48), LIGHTS, Sensor(exposure=3.0))
    found = fit(scene, photographed(scene, clay(dtype=torch.float32)), OrenNayar())
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-3
    assert abs(found.parameters["albedo"].item() - 0.7) < 1e-5


def test_model_without_basis_goes_the_general_way():
    lights = [Distant.from_angle(a) for a in (-60, 0, 60)]
    scene = Scene(sphere(24, 24, dtype=DOUBLE), lights, Sensor(exposure=2.0, psf_sigma=0.6))
    white = fixed(torch.tensor(1.0, dtype=DOUBLE))
    truth = 0.4 * OrenNayar(albedo=white, sigma=torch.tensor(0.7, dtype=DOUBLE)) + 0.3 * Lambert(albedo=white)
    start = 0.5 * OrenNayar(albedo=white, sigma=fixed(torch.tensor(0.7, dtype=DOUBLE))) + 0.5 * Lambert(albedo=white)
    found = fit(scene, photographed(scene, truth), start)
    torch.testing.assert_close(found.parameters["weights"], torch.tensor([0.4, 0.3], dtype=DOUBLE), rtol=1e-7, atol=0)
    # one Oren-Nayar lobe, all free but the albedo: weight and sigma
    truth = 0.6 * OrenNayar(albedo=white, sigma=torch.tensor(0.7, dtype=DOUBLE))
    found = fit(scene, photographed(scene, truth), 0.9 * OrenNayar(albedo=white, sigma=0.3))
    torch.testing.assert_close(found.parameters["parts.0.sigma"].item(), 0.7, rtol=1e-7, atol=0)


def test_linear_and_general_prediction_agree():
    # an ambient light of radiance 0 forces the general way
    surface = sphere(24, 24, dtype=DOUBLE, samples=2)
    sensor = Sensor(exposure=2.0, psf_sigma=0.6)
    photographs = photographed(Scene(surface, LIGHTS, sensor), clay(), 0) + 0.01
    linear = fit(Scene(surface, LIGHTS, sensor), photographs, OrenNayar())
    general = fit(Scene(surface, [(light, Ambient(0.0)) for light in LIGHTS], sensor), photographs, OrenNayar())
    for name, value in linear.parameters.items():
        torch.testing.assert_close(general.parameters[name], value, rtol=1e-7, atol=0)
        torch.testing.assert_close(general.standard_error[name], linear.standard_error[name], rtol=1e-6, atol=0)


def test_stated_interval_covers_the_truth_as_often_as_it_says():
    # 68.3 % expected; 58..78 of 100 is missed by chance with the probability asserted here (per parameter)
    assert binom.cdf(57, 100, math.erf(1 / math.sqrt(2))) + binom.sf(78, 100, math.erf(1 / math.sqrt(2))) < 0.032
    scene = Scene(vase(48, 48, dtype=DOUBLE), LIGHTS, Sensor(exposure=3.0, read_noise=0.01))
    clean = render(scene, clay()).detach()
    lit = clean[..., 0] > 0.02  # clear of the clipping at black
    covered = {"sigma": 0, "albedo": 0}
    for seed in range(100):
        noisy = scene.sensor.expose(clean, torch.Generator().manual_seed(seed))
        found = fit(scene, noisy, OrenNayar(), valid=lit)
        for name, truth in {"sigma": math.radians(40), "albedo": 0.7}.items():
            covered[name] += abs(found.parameters[name].item() - truth) < found.standard_error[name].item()
    assert all(58 <= count <= 78 for count in covered.values()), covered


def test_exposure_and_ambient_are_recovered():
    scene = Scene(vase(48, 48, dtype=DOUBLE), LIGHTS, Sensor(exposure=2.0))
    photographs = photographed(scene, clay()) * torch.tensor([1.0, 1.3], dtype=DOUBLE)[:, None, None, None]
    photographs = photographs + torch.tensor([0.03, 0.01], dtype=DOUBLE)[:, None, None, None]
    found = fit(scene, photographs, OrenNayar(), free_exposure=True, free_ambient=True)
    torch.testing.assert_close(found.parameters["exposure"], torch.tensor([1.3], dtype=DOUBLE), rtol=1e-7, atol=0)
    torch.testing.assert_close(found.parameters["ambient"], torch.tensor([0.03, 0.01], dtype=DOUBLE), rtol=0, atol=1e-8)
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-5


def test_per_channel_albedo_and_coloured_light():
    lights = [Distant(torch.tensor([0.3, 0.1, 1.0]), torch.tensor([1.0, 0.8, 0.5])), Distant.from_angle(-40)]
    scene = Scene(sphere(24, 24, dtype=DOUBLE), lights, Sensor(exposure=2.0))
    truth = OrenNayar(albedo=torch.tensor([0.3, 0.6, 0.9], dtype=DOUBLE), sigma=torch.tensor(0.4, dtype=DOUBLE))
    found = fit(scene, photographed(scene, truth), OrenNayar(albedo=torch.full((3,), 0.5)))
    torch.testing.assert_close(found.parameters["albedo"], truth.albedo.detach(), rtol=1e-8, atol=0)


def test_per_texel_albedo_with_one_sigma():
    lights = [Distant.from_angle(a) for a in (0, 20, -30, 45)]
    scene = Scene(sphere(24, 24, dtype=DOUBLE), lights, Sensor(exposure=1.5))
    points = int(scene.surface.mask.sum())
    albedo = 0.3 + 0.5 * torch.rand(points, 2, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    photographs = photographed(scene, OrenNayar(albedo=albedo, sigma=torch.tensor(0.5, dtype=DOUBLE)))
    noise = 1e-3 * torch.randn(photographs.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
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


def test_sigma_and_albedo_of_every_pixel():
    lights = [Distant.from_angle(a) for a in (-50, -25, 0, 25, 50)]
    scene = Scene(sphere(24, 24, dtype=DOUBLE), lights, Sensor(exposure=1.5))
    points = int(scene.surface.mask.sum())
    generator = torch.Generator().manual_seed(0)
    truth = QualitativeOrenNayar(
        albedo=0.3 + 0.5 * torch.rand(points, 1, dtype=DOUBLE, generator=generator),
        sigma=0.2 + 0.6 * torch.rand(points, dtype=DOUBLE, generator=generator),
    )
    start = QualitativeOrenNayar(albedo=torch.full((points, 1), 0.5), sigma=torch.full((points,), 0.4))
    found = fit(scene, photographed(scene, truth), start)
    central = scene.surface.normals[scene.surface.mask][:, 2] > 0.6  # well seen under all lights
    torch.testing.assert_close(found.parameters["sigma"][central], truth.sigma.detach()[central], rtol=1e-4, atol=0)


def test_random_starts_reach_the_same_minimum():
    scene = Scene(vase(32, 32, dtype=DOUBLE), LIGHTS, Sensor(exposure=3.0))
    found = fit(scene, photographed(scene, clay()), OrenNayar(sigma=1.5, albedo=0.05), starts=4)
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-5


def test_model_given_is_not_changed_and_fixed_parameters_stay():
    scene = Scene(vase(32, 32, dtype=DOUBLE), LIGHTS, Sensor(exposure=3.0))
    start = OrenNayar(sigma=fixed(math.radians(40)), albedo=0.3)
    found = fit(scene, photographed(scene, clay()), start)
    assert list(found.parameters) == ["albedo"]
    assert start.albedo.item() == pytest.approx(0.3, rel=1e-6)
    assert found.model.albedo.item() == pytest.approx(0.7, rel=1e-6)
    frozen = OrenNayar(sigma=math.radians(40))
    frozen.raw_sigma.requires_grad_(False)
    assert list(trainable(frozen)) == ["albedo"]


def test_result_prints_and_serialises():
    scene = Scene(vase(32, 32), LIGHTS, Sensor(exposure=3.0, read_noise=0.01))
    found = fit(scene, photographed(scene, clay(dtype=torch.float32)), OrenNayar())
    assert "deg" in str(found)
    assert "+-" in str(found)
    as_json = found.to_json()
    assert as_json["sigma_degrees"] == pytest.approx(40, abs=5 * as_json["sigma_degrees_standard_error"])
    assert as_json["status"] == "converged"


# Statuses: what photographs cannot say


def test_lambertian_object_has_no_confident_sigma():
    scene = Scene(sphere(48, 48, dtype=DOUBLE), [Distant.from_angle(0)], Sensor(exposure=2.0, read_noise=0.01))
    photographs = photographed(scene, Lambert(albedo=0.7).double())
    clear = render(scene, Lambert(albedo=0.7).double())[..., 0] > 0.05  # noise clipped at black looks like roughness
    found = fit(scene, photographs, OrenNayar(), valid=clear)
    assert found.status == "at bound"
    assert "sigma" in found.reason
    assert "95 %" in found.reason


def test_flat_plate_lit_straight_on_cannot_tell_sigma_from_albedo():
    scene = Scene(plane(16, 16, dtype=DOUBLE), [Distant.from_angle(0)], Sensor(exposure=2.0, read_noise=0.01))
    found = fit(scene, photographed(scene, clay()), OrenNayar())
    assert found.status == "not identified"
    assert "albedo from sigma" in found.reason
    assert "unknown" in found.estimate("sigma")


def test_noise_that_swamps_sigma_is_said():
    scene = Scene(sphere(16, 16, dtype=DOUBLE), [Distant.from_angle(0)], Sensor(exposure=1.0, read_noise=0.2))
    found = fit(scene, photographed(scene, clay(albedo=0.5)) + 0.3, OrenNayar(), free_ambient=True)
    assert found.status in ("not identified", "at bound")


def test_out_of_steps_is_a_status():
    scene = Scene(vase(32, 32, dtype=DOUBLE), LIGHTS, Sensor(exposure=3.0))
    found = fit(scene, photographed(scene, clay()), OrenNayar(), max_steps=1)
    assert found.status == "out of steps"


def test_divergence_raises_unless_asked_not_to():
    scene = Scene(vase(32, 32, dtype=DOUBLE), LIGHTS, Sensor(exposure=3.0))
    photographs = photographed(scene, clay())
    broken = OrenNayar()
    with torch.no_grad():
        broken.raw_sigma.fill_(math.nan)
    with pytest.raises(FitError, match="not finite"):
        fit(scene, photographs, broken)
    assert fit(scene, photographs, broken, throw=False).status == "diverged"


# Bad input

SCENE = Scene(sphere(16, 16), LIGHTS, Sensor(exposure=2.0))
GOOD = render(SCENE, Lambert(albedo=0.7)).detach() * 2


def spoiled(value, where=(0,)):
    photographs = GOOD.clone()
    photographs[where] = value
    return photographs


@pytest.mark.parametrize(
    ("photographs", "message"),
    [
        (GOOD[:1], r"2 sets of lights; found \(1, 16, 16, 1\)"),
        (GOOD[:, :8], r"found \(2, 8, 16, 1\)"),
        (GOOD[..., 0], r"found \(2, 16, 16\)"),
        (spoiled(math.nan, (1, 8, 8)), "1 values are not, in image 1"),
        (spoiled(0.0), "photograph 0 is all dark"),
        (spoiled(1.0, (1,)), "photograph 1 is saturated: 100%"),
    ],
)
def test_bad_photographs_are_named(photographs, message):
    with pytest.raises(ValueError, match=message):
        fit(SCENE, photographs, Lambert())


def test_bad_masks_and_settings_are_named():
    nothing = torch.zeros(2, 16, 16, dtype=torch.bool)
    with pytest.raises(ValueError, match="no sample is left"):
        fit(SCENE, GOOD, Lambert(), valid=nothing)
    with pytest.raises(ValueError, match="valid must be bool"):
        fit(SCENE, GOOD, Lambert(), valid=nothing[:1])
    with pytest.raises(ValueError, match="nothing to fit"):
        fit(SCENE, GOOD, Lambert(albedo=fixed(0.5)))
    with pytest.raises(ValueError, match="starts must be a whole number of at least 1"):
        fit(SCENE, GOOD, Lambert(), starts=0)
    with pytest.raises(ValueError, match="mask is empty"):
        Surface(GOOD[0].expand(16, 16, 3), GOOD[0].expand(16, 16, 3), nothing[0], torch.tensor([0.0, 0.0, 1.0]))
    points = int(SCENE.surface.mask.sum())
    blurred = Scene(SCENE.surface, LIGHTS, Sensor(psf_sigma=1.0))
    with pytest.raises(ValueError, match="psf_sigma=0"):
        fit(blurred, GOOD, Lambert(albedo=torch.full((points, 1), 0.5)))


def test_saturated_samples_are_left_out():
    photographs = GOOD.clone()
    photographs[0, 7:9, 7:9] = 1.0
    found = fit(SCENE, photographs, Lambert())
    assert found.samples == fit(SCENE, GOOD, Lambert()).samples - 4
    assert found.parameters["albedo"].item() == pytest.approx(0.7, rel=1e-5)


def test_bootstrap_sees_a_light_that_is_wrong():
    # one of four lights is 5 degrees off: the formal error ignores it, the bootstrap does not
    angles = (-40, -10, 20, 50)
    surface = sphere(32, 32, dtype=DOUBLE)
    photographs = photographed(Scene(surface, [Distant.from_angle(a) for a in angles], Sensor(exposure=1.5)), clay())
    believed = Scene(surface, [Distant.from_angle(a) for a in (-40, -10, 20, 55)], Sensor(exposure=1.5))
    found = fit(believed, photographs, OrenNayar())
    spread = bootstrap(believed, photographs, OrenNayar(), samples=20)
    assert spread["sigma"] > 2 * found.standard_error["sigma"]
    with pytest.raises(ValueError, match="at least 2 samples"):
        bootstrap(believed, photographs, OrenNayar(), samples=1)
    with pytest.raises(ValueError, match="at least 3; found 2"):
        bootstrap(Scene(surface, believed.lights[:2]), photographs[:2], OrenNayar(), samples=3)
