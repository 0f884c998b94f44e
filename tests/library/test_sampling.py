"""The laws of sampling over the catalog."""

import math

import pytest
import torch
from catalog import MODELS
from weights import by_quadrature

from torchbrdf import (
    BRDF,
    GGX,
    AshikhminShirley,
    Lambert,
    Mirror,
    Oriented,
    Perfect,
    Schlick,
    TorranceSparrow,
    fixed,
)
from torchbrdf import testing as laws

ANGLES = [math.radians(60), math.radians(85)]
# One run in a thousand raises a false alarm: shared between the tests of all models and angles (Bonferroni).
FALSE_ALARM = 1e-3 / (len(MODELS) * len(ANGLES))


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def held(value):
    return fixed(torch.tensor(value, dtype=torch.float64))


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


def facets(sigma):
    return TorranceSparrow(sigma=held(sigma))


def highlight():
    # F = 1, no body
    brdf = AshikhminShirley(diffuse=held(0.0), specular=held(1.0), exponent_x=held(20.0), exponent_y=held(20.0))
    return Oriented(brdf, torch.tensor([1.0, 0.0, 0.2]))


def test_weights_of_facets_never_exceed_their_reflectance():
    for brdf in (facets(0.3), facets(1.0), GGX(alpha=held(0.5), fresnel=Perfect()), highlight()):
        for angle in (0.0, *ANGLES, math.radians(89.9)):
            weight = laws.SamplingSetup.of(brdf, angle).draw(5000, seeded()).weight
            assert weight.max() <= 1 + 1e-9


def test_mirror_returns_the_reflected_view():
    normal, _, view = laws.random_directions(100, dtype=torch.float64, generator=seeded())
    light, pdf, weight = Mirror(fresnel=Schlick(f0=held(0.3))).sample(normal, view, torch.rand(100, 2).double())
    torch.testing.assert_close(light, 2 * (normal * view).sum(-1, keepdim=True) * normal - view)
    assert pdf.isinf().all()
    cos = (normal * view).sum(-1)
    torch.testing.assert_close(weight[:, 0], 0.3 + 0.7 * (1 - cos) ** 5)


def test_delta_lobes_survive_in_sums():
    brdf = 0.5 * Mirror() + 0.5 * Lambert(albedo=held(0.6))
    brdf = brdf.double()
    _, pdf, weight = laws.SamplingSetup.of(brdf, 1.0).draw(20_000, seeded())
    delta = pdf.isinf()
    assert abs(float(delta.double().mean()) - 0.5) < 5 * math.sqrt(0.25 / 20_000)
    assert abs(float(weight.detach().mean()) - 0.8) < 0.01


def test_gradient_of_the_mean_weight_is_that_of_the_albedo():
    # light and pdf are held, so the derivative passes through f_r: unbiased, five standard errors allowed
    brdf = GGX(alpha=torch.tensor(0.5, dtype=torch.float64), fresnel=Perfect())
    angle = 1.0
    setting = laws.SamplingSetup.of(brdf, angle)
    (got,) = torch.autograd.grad(setting.draw(200_000, seeded()).weight.mean(), list(setting.brdf.parameters()))
    albedo = brdf.directional_albedo(torch.tensor(math.cos(angle), dtype=torch.float64), nodes=256)
    (expected,) = torch.autograd.grad(albedo.sum(), list(brdf.parameters()))
    assert abs(float(got - expected)) < 0.02


class Skewed(BRDF):
    """Draws from the cosine but says it is uniform."""

    def evaluate_components(self, cosines):
        return {"all": torch.ones_like(cosines.light)[..., None]}

    def density(self, cosines):
        return torch.full_like(cosines.light, 0.5 / math.pi)


class Leaky(Skewed):
    def density(self, cosines):
        return 0.9 * cosines.light / math.pi


def test_laws_notice():
    with pytest.raises(AssertionError, match="chi-square"):
        laws.assert_samples_follow_pdf(Skewed(), 1.0, generator=seeded())
    with pytest.raises(AssertionError, match=r"integrates to 0\.9 and misses 0"):
        laws.assert_density_integrates(Leaky(), 1.0, generator=seeded())


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
