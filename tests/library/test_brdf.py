"""What every BRDF offers: the share of light that it reflects, against another quadrature."""

import math

import torch
from helpers.catalog import MODELS

from torchbrdf import OrenNayar
from torchbrdf.testing import laws


def test_directional_albedo_agrees_with_another_quadrature(model):
    # 128 nodes without regard to kinks against panels that end at them.
    brdf = model.make(torch.float64)
    for angle in (0.0, 0.5, 1.2, math.radians(85)):
        cosine = torch.tensor(math.cos(angle), dtype=torch.float64)
        expected = laws.albedo_by_quadrature(brdf, angle, max(32, model.nodes))
        upright = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
        view = torch.tensor([math.sin(angle), 0.0, math.cos(angle)], dtype=torch.float64)
        mirror = brdf.delta_reflectance(brdf.cosines(upright, upright, view, normalize=True))
        expected = expected if mirror is None else expected + mirror
        error = model.albedo_error
        got = brdf.directional_albedo(cosine, nodes=128)
        torch.testing.assert_close(got, expected.expand_as(got), rtol=0, atol=max(5e-5, error / 5))
        torch.testing.assert_close(brdf.directional_albedo(cosine), expected.expand_as(got), rtol=0, atol=error)


def test_directional_albedo_of_lambert_is_its_albedo():
    brdf = MODELS[0].make(torch.float64)
    cosine = torch.tensor([0.1, 0.5, 1.0], dtype=torch.float64)
    torch.testing.assert_close(brdf.directional_albedo(cosine), brdf.material()["albedo"].expand(3, 3))


def test_directional_albedo_pairs_each_texel_with_its_direction():
    sigma = torch.linspace(0.1, 1.0, 32)  # as many as there are nodes: the case that would mix them up silently
    cosine = torch.linspace(0.3, 1.0, 32)
    together = OrenNayar(sigma=sigma).directional_albedo(cosine)
    alone = torch.cat([OrenNayar(sigma=s).directional_albedo(c[None]) for s, c in zip(sigma, cosine, strict=True)])
    torch.testing.assert_close(together, alone)


def test_directional_albedo_has_a_gradient_at_normal_incidence():
    cosine = torch.tensor([1.0, 0.5], dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(OrenNayar().double().directional_albedo(cosine).sum(), cosine)
    assert slope.isfinite().all()
