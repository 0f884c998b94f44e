"""What every model offers of sampling: gradients of weights, and what it asks for."""

import math

import pytest
import torch
from helpers.probes import seeded

from torchbrdf import GGX, AshikhminShirley, Perfect
from torchbrdf import testing as laws


def test_gradient_of_the_mean_weight_is_that_of_the_albedo():
    # light and pdf are held, so the derivative passes through f_r: unbiased, five standard errors allowed
    brdf = GGX(alpha=torch.tensor(0.5, dtype=torch.float64), fresnel=Perfect())
    angle = 1.0
    setting = laws.SamplingSetup.of(brdf, angle)
    (got,) = torch.autograd.grad(setting.draw(200_000, seeded()).weight.mean(), list(setting.brdf.parameters()))
    albedo = brdf.directional_albedo(torch.tensor(math.cos(angle), dtype=torch.float64), nodes=256)
    (expected,) = torch.autograd.grad(albedo.sum(), list(brdf.parameters()))
    assert abs(float(got - expected)) < 0.02


def test_anisotropic_models_ask_for_a_tangent():
    normal, light, view = laws.random_directions(5, generator=seeded())
    brdf = AshikhminShirley()
    for call in (
        lambda: brdf(normal, light, view),
        lambda: brdf.sample(normal, view, torch.rand(5, 2)),
        lambda: brdf.pdf(normal, light, view),
    ):
        with pytest.raises(ValueError, match="AshikhminShirley is anisotropic and needs a tangent"):
            call()
    with pytest.raises(ValueError, match="tangent must not be parallel to the normal; 5 of 5 are"):
        brdf(normal, light, view, tangent=2 * normal)
