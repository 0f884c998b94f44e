"""The sampler of EON, at the roughness a heightfield says it looks like."""

import math

import pytest
import torch
from heightfields import held

from torchbrdf import FastGaussianHeightfield, GaussianHeightfield, sampling_laws


def weights(brdf, degrees, draws):
    setting = sampling_laws._Setting.of(brdf, math.radians(degrees))
    with torch.no_grad():
        return setting.draw(draws, torch.Generator().manual_seed(0)).weight[:, 0]


@pytest.mark.parametrize("sigma", [5, 10, 20, 40, 60, 85])
def test_weights_are_bounded_and_nearly_equal(sigma):
    # the cosine alone: variance 0.7 of the squared mean and weights of 19 times the mean at 60 deg of roughness
    brdf = FastGaussianHeightfield(albedo=held(0.9), sigma=held(math.radians(sigma)))
    for degrees in (0, 45, 75, 85, 89):
        w = weights(brdf, degrees, 20_000)
        assert w.var() < 0.05 * w.mean() ** 2
        assert w.max() < 2.5 * w.mean()


def test_the_reference_draws_alike():
    brdf = GaussianHeightfield(albedo=held(0.9), sigma=held(0.7), nodes=160)
    for degrees in (30, 85):
        w = weights(brdf, degrees, 4000)
        assert w.var() < 0.05 * w.mean() ** 2
        assert w.max() < 2.5 * w.mean()
