"""What the fit predicts is what is rendered and recorded, in every way of computing it."""

import pytest
import torch
from helpers.photographs import LIGHTS, clay, photographed

from inverse import Ambient, Disc, Distant, Point, Scene, Sensor, fit, render, sphere, vase
from inverse.fitting.prediction import predictor
from torchbrdf import EON, Coupled, Lambert, OrenNayar, fixed

D = torch.float64
RAISED = Distant(torch.tensor([0.3, 1.6, 0.6], dtype=D))


def number(value):
    return torch.tensor(value, dtype=D)


MODELS = {
    "linear": lambda: OrenNayar(albedo=number([0.7, 0.4]), sigma=number(0.5)),
    "general": lambda: EON(albedo=number(0.7), roughness=number(0.5)),
    "with a mirror lobe": lambda: Coupled(albedo=number(0.6)),
}


@pytest.mark.parametrize(("samples", "psf"), [(2, 0.8), (3, 0.0), (1, 0.0)])
@pytest.mark.parametrize("name", MODELS)
def test_a_fit_predicts_what_is_rendered(name, samples, psf):
    """With everything on: shadows, parts, a disc, a lamp, ambient light, merged pixels, focus."""
    model = MODELS[name]()
    surface = vase(24, 24, samples=2, dtype=D)
    lights = [
        [RAISED, Ambient(0.05)],
        [Disc(torch.tensor([0.5, 0.5, 1.0]), 0.1), Point(torch.tensor([1.0, 2, 3]), 4.0)],
    ]
    sensor = Sensor(exposure=1.7, psf_sigma=psf)
    scene = Scene(surface, lights, sensor, between_parts=True, fully_sampled=torch.rand(24, 24) < 0.5)
    pixels = surface.coverage() == 1
    predicted = predictor(scene, model, pixels, per_texel=False)(dict(model.named_parameters()))
    recorded = sensor.focus(render(scene, model)) * sensor.exposure
    torch.testing.assert_close(predicted, recorded[:, pixels].expand_as(predicted), rtol=1e-9, atol=1e-12)


def test_model_without_basis_goes_the_general_way():
    lights = [Distant.from_angle(a) for a in (-60, 0, 60)]
    scene = Scene(sphere(24, 24, dtype=D), lights, Sensor(exposure=2.0, psf_sigma=0.6))
    white = fixed(torch.tensor(1.0, dtype=D))
    truth = 0.4 * OrenNayar(albedo=white, sigma=torch.tensor(0.7, dtype=D)) + 0.3 * Lambert(albedo=white)
    start = 0.5 * OrenNayar(albedo=white, sigma=fixed(torch.tensor(0.7, dtype=D))) + 0.5 * Lambert(albedo=white)
    found = fit(scene, photographed(scene, truth), start)
    torch.testing.assert_close(found.parameters["weights"], torch.tensor([0.4, 0.3], dtype=D), rtol=1e-7, atol=0)
    # one Oren-Nayar lobe, all free but the albedo: weight and sigma
    truth = 0.6 * OrenNayar(albedo=white, sigma=torch.tensor(0.7, dtype=D))
    found = fit(scene, photographed(scene, truth), 0.9 * OrenNayar(albedo=white, sigma=0.3))
    torch.testing.assert_close(found.parameters["parts.0.sigma"].item(), 0.7, rtol=1e-7, atol=0)


def test_linear_and_general_prediction_agree():
    # an ambient light of radiance 0 forces the general way
    surface = sphere(24, 24, dtype=D, samples=2)
    sensor = Sensor(exposure=2.0, psf_sigma=0.6)
    photographs = photographed(Scene(surface, LIGHTS, sensor), clay(), 0) + 0.01
    linear = fit(Scene(surface, LIGHTS, sensor), photographs, OrenNayar())
    general = fit(Scene(surface, [(light, Ambient(0.0)) for light in LIGHTS], sensor), photographs, OrenNayar())
    for name, value in linear.parameters.items():
        torch.testing.assert_close(general.parameters[name], value, rtol=1e-7, atol=0)
        torch.testing.assert_close(general.standard_error[name], linear.standard_error[name], rtol=1e-6, atol=0)
