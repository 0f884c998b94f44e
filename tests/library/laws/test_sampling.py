"""The laws of sampling over the catalog."""

import math

import pytest
import torch
from helpers.catalog import MODELS
from helpers.probes import seeded
from helpers.weights import by_quadrature

from torchbrdf import testing as laws

ANGLES = [math.radians(60), math.radians(85)]
# One run in a thousand raises a false alarm: shared between the tests of all models and angles (Bonferroni).
FALSE_ALARM = 1e-3 / (len(MODELS) * len(ANGLES))


@pytest.mark.parametrize("angle", ANGLES)
def test_samples_follow_pdf(model, angle):
    laws.assert_samples_follow_pdf(model.make(torch.float64), angle, false_alarm=FALSE_ALARM, generator=seeded())


@pytest.mark.parametrize("angle", [0.0, math.radians(85)])
def test_density_integrates(model, angle):
    laws.assert_density_integrates(model.make(torch.float64), angle, generator=seeded())


@pytest.mark.parametrize("angle", [0.0, *ANGLES, math.radians(89.9)])
def test_weight_is_f_cos_over_pdf(model, angle):
    laws.assert_weights(model.make(torch.float64), angle, generator=seeded())


def test_mean_weight_is_the_directional_albedo(model):
    # five standard errors: a false alarm in 1.7 million tests
    brdf = model.make(torch.float64)
    angle = 1.0
    setting = laws.SamplingSetup.of(brdf, angle)
    with torch.no_grad():
        weight = setting.draw(20_000, seeded()).weight
    if brdf.anisotropic:  # `directional_albedo` takes the view along the grain
        expected = by_quadrature(brdf, angle, azimuth=laws.AZIMUTH).mean
    else:
        expected = brdf.directional_albedo(torch.tensor(math.cos(angle), dtype=torch.float64), nodes=192).detach()
    allowed = 5 * weight.std(0) / math.sqrt(len(weight)) + max(5e-5, model.albedo_error / 20)
    assert ((weight.mean(0) - expected).abs() <= allowed).all()


def test_samples_in_float32(model):
    brdf = model.make(torch.float32)
    normal, _, view = laws.random_directions(500, generator=seeded(), max_angle=math.radians(89.9))
    light, pdf, weight = brdf.sample(normal, view, torch.rand(500, 2, generator=seeded()))
    assert light.dtype == pdf.dtype == weight.dtype == torch.float32
    assert weight.isfinite().all()
    assert ((light.norm(dim=-1) - 1).abs() < 1e-5).all()
    assert not light.requires_grad
    assert not pdf.requires_grad


def test_one_view_takes_many_numbers(model):
    brdf = model.make(torch.float64)
    normal, _, view = (v[0] for v in laws.random_directions(1, dtype=torch.float64, generator=seeded(), max_angle=1.2))
    u = torch.rand(20, 2, dtype=torch.float64, generator=seeded())
    together = brdf.sample(normal, view, u)
    for one, each in zip(together, brdf.sample(normal.expand(20, 3), view.expand(20, 3), u), strict=True):
        torch.testing.assert_close(one, each, rtol=1e-9, atol=1e-12)
