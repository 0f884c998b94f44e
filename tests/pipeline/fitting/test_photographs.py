"""The fit recovers a known truth, and refuses what would broadcast into nonsense."""

import math
from dataclasses import replace

import pytest
import torch
from helpers.photographs import LIGHTS, clay, photographed, scene_and_photographs
from torch import nn

from inverse import (
    Disc,
    Distant,
    FitError,
    Point,
    Scene,
    Sensor,
    Surface,
    everything,
    fit,
    perspective,
    pinhole,
    render,
    sphere,
    vase,
)
from torchbrdf import BRDF, Lambert, OrenNayar, QualitativeOrenNayar, RoughSurface, fixed, trainable

D = torch.float64


def test_fit_through_a_pinhole():
    surface = perspective(vase(8, 8).solid, pinhole(40, 40, field_of_view=40), dtype=D)
    scene = Scene(surface, [Distant.from_angle(0), Distant.from_angle(30)])
    truth = OrenNayar(albedo=torch.tensor(0.7, dtype=D), sigma=torch.tensor(0.6, dtype=D))
    result = fit(scene, render(scene, truth).detach(), OrenNayar(albedo=0.4, sigma=0.3))
    assert result.parameters["sigma"].item() == pytest.approx(0.6, rel=1e-6)


def vector(*values):
    return torch.tensor(values, dtype=D)


def number(value):
    return torch.tensor(value, dtype=D)


@pytest.mark.parametrize("make", [OrenNayar, lambda **k: RoughSurface(**k, nodes=4)])
def test_fit_under_a_lamp_and_a_disc(make):
    lights = [Point(vector(1, 2, 4), 20.0), [Disc(vector(-0.6, 0, 0.8), 0.3), Point(vector(3, 0, 1), 3.0)]]
    scene = Scene(sphere(20, 20, dtype=D), lights)
    photographs = render(scene, make(albedo=number(0.7), sigma=number(0.5))).detach()
    result = fit(scene, photographs, make(albedo=number(0.4), sigma=number(0.3)))
    assert result.status == "converged"
    torch.testing.assert_close(result.parameters["sigma"], number(0.5), rtol=1e-6, atol=0)


RAISED = Distant(torch.tensor([0.3, 1.6, 0.6], dtype=D))


def test_what_parts_send_each_other_is_not_taken_for_paint():
    """Photographs of a white vase with everything on: fitted as such they give its albedo, without they do not."""
    scene = Scene(vase(40, 40, dtype=D), [Distant.from_angle(0), RAISED])
    truth = OrenNayar(albedo=number(0.9), sigma=number(0.4))
    photographs = 0.8 * render(everything(scene), truth).detach()
    right = fit(replace(everything(scene), sensor=Sensor(exposure=0.8)), photographs, OrenNayar())
    wrong = fit(replace(scene, sensor=Sensor(exposure=0.8)), photographs, OrenNayar())
    assert right.parameters["albedo"].item() == pytest.approx(0.9, rel=1e-6)
    assert right.parameters["sigma"].item() == pytest.approx(0.4, rel=1e-5)
    assert abs(wrong.parameters["sigma"].item() - 0.4) > 0.01


@pytest.mark.parametrize("cls", [OrenNayar, QualitativeOrenNayar])
@pytest.mark.parametrize(("psf_sigma", "samples"), [(0.0, 1), (0.7, 2)])
def test_noise_free_photographs_give_the_truth(cls, psf_sigma, samples):
    scene = Scene(vase(48, 48, samples=samples, dtype=D), LIGHTS, Sensor(exposure=3.0, psf_sigma=psf_sigma))
    found = fit(scene, photographed(scene, clay(cls)), cls())
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-5
    assert abs(found.parameters["albedo"].item() - 0.7) < 1e-8
    assert found.status == "converged"


def test_float32_recovers_to_its_own_precision():
    scene = Scene(vase(48, 48), LIGHTS, Sensor(exposure=3.0))
    found = fit(scene, photographed(scene, clay(dtype=torch.float32)), OrenNayar())
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-3
    assert abs(found.parameters["albedo"].item() - 0.7) < 1e-5


def test_exposure_and_ambient_are_recovered():
    scene = Scene(vase(48, 48, dtype=D), LIGHTS, Sensor(exposure=2.0))
    photographs = photographed(scene, clay()) * torch.tensor([1.0, 1.3], dtype=D)[:, None, None, None]
    photographs = photographs + torch.tensor([0.03, 0.01], dtype=D)[:, None, None, None]
    found = fit(scene, photographs, OrenNayar(), free_exposure=True, free_ambient=True)
    torch.testing.assert_close(found.parameters["exposure"], torch.tensor([1.3], dtype=D), rtol=1e-7, atol=0)
    torch.testing.assert_close(found.parameters["ambient"], torch.tensor([0.03, 0.01], dtype=D), rtol=0, atol=1e-8)
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-5


def test_per_channel_albedo_and_coloured_light():
    lights = [Distant(torch.tensor([0.3, 0.1, 1.0]), torch.tensor([1.0, 0.8, 0.5])), Distant.from_angle(-40)]
    scene = Scene(sphere(24, 24, dtype=D), lights, Sensor(exposure=2.0))
    truth = OrenNayar(albedo=torch.tensor([0.3, 0.6, 0.9], dtype=D), sigma=torch.tensor(0.4, dtype=D))
    found = fit(scene, photographed(scene, truth), OrenNayar(albedo=torch.full((3,), 0.5)))
    torch.testing.assert_close(found.parameters["albedo"], truth.albedo.detach(), rtol=1e-8, atol=0)


def test_random_starts_reach_the_same_minimum():
    scene = Scene(vase(32, 32, dtype=D), LIGHTS, Sensor(exposure=3.0))
    found = fit(scene, photographed(scene, clay()), OrenNayar(sigma=1.5, albedo=0.05), starts=4)
    assert abs(torch.rad2deg(found.parameters["sigma"]).item() - 40) < 1e-5


def test_model_given_is_not_changed_and_fixed_parameters_stay():
    scene = Scene(vase(32, 32, dtype=D), LIGHTS, Sensor(exposure=3.0))
    start = OrenNayar(sigma=fixed(math.radians(40)), albedo=0.3)
    found = fit(scene, photographed(scene, clay()), start)
    assert list(found.parameters) == ["albedo"]
    assert start.albedo.item() == pytest.approx(0.3, rel=1e-6)
    assert found.model.albedo.item() == pytest.approx(0.7, rel=1e-6)
    frozen = OrenNayar(sigma=math.radians(40))
    frozen.raw_sigma.requires_grad_(False)
    assert list(trainable(frozen)) == ["albedo"]


def test_divergence_raises_unless_asked_not_to():
    scene = Scene(vase(32, 32, dtype=D), LIGHTS, Sensor(exposure=3.0))
    photographs = photographed(scene, clay())
    broken = OrenNayar()
    with torch.no_grad():
        broken.raw_sigma.fill_(math.nan)
    with pytest.raises(FitError, match="not finite"):
        fit(scene, photographs, broken)
    assert fit(scene, photographs, broken, throw=False).status == "diverged"


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


class Tinted(BRDF):
    def __init__(self):
        super().__init__()
        self.k = nn.Parameter(torch.tensor(0.5))
        self.inner = Lambert()

    def evaluate_components(self, cosines):
        return {"all": self.k * self.inner.evaluate(cosines)}


def test_shapes_that_would_broadcast_into_nonsense_are_named():
    scene, photographs = scene_and_photographs([0, 20])
    points = int(scene.surface.mask.sum())
    cases = [
        (OrenNayar(albedo=torch.full((3,), 0.5)), "1 channels, and model and lights 3"),
        (OrenNayar(albedo=torch.full((points,), 0.5)), "1 channels, and model and lights 1468"),
        (OrenNayar(albedo=torch.full((points + 1, 1), 0.5)), r"albedo must be per texel \(1468, channel\)"),
        (OrenNayar(albedo=torch.full((48, 48, 1), 0.5)), r"found shape \(48, 48, 1\)"),
        (OrenNayar(sigma=torch.full((points, 1), 0.5)), r"sigma must be per texel \(1468,\)"),
        (Tinted(), "outside its table: k"),
    ]
    for model, message in cases:
        with pytest.raises(ValueError, match=message):
            fit(scene, photographs, model)
    with pytest.raises(ValueError, match="per-texel sigma"):
        render(scene, OrenNayar(sigma=torch.full((points, 1), 0.5)))
    coloured = Scene(scene.surface, [Distant(torch.tensor([0.0, 0.0, 1.0]), torch.tensor([1.0, 0.5, 0.2]))] * 2)
    with pytest.raises(ValueError, match="model and lights 3"):
        fit(coloured, photographs, Lambert())


def test_a_computed_parameter_is_refused():
    w = torch.zeros(3, requires_grad=True)
    with pytest.raises(ValueError, match="its gradient would be lost"):
        OrenNayar(albedo=torch.sigmoid(w))


def test_wrong_types_are_named():
    scene, photographs = scene_and_photographs([0, 20])
    with pytest.raises(TypeError, match=r"floating-point torch\.Tensor with full scale 1; found ndarray"):
        fit(scene, photographs.numpy(), OrenNayar())  # pyright: ignore
    with pytest.raises(TypeError, match=r"found torch\.uint8"):
        fit(scene, (photographs * 255).to(torch.uint8), OrenNayar())
    with pytest.raises(TypeError, match="model must be a BRDF"):
        fit(scene, photographs, OrenNayar)  # pyright: ignore
    with pytest.raises(TypeError, match="found a single light"):
        Scene(scene.surface, Distant.from_angle(0))  # pyright: ignore
    with pytest.raises(ValueError, match="finite and not negative"):
        Distant.from_angle(0, math.inf)
    with pytest.raises(ValueError, match="positive and finite"):
        Sensor(exposure=math.inf)
    assert Distant(torch.tensor([0, 0, 2])).direction.tolist() == [0, 0, 1]
    weight_held = 0.5 * OrenNayar(albedo=0.9)
    weight_held.weights = fixed(torch.tensor([0.5]))
    assert "weights" not in fit(scene, photographs, weight_held).parameters
