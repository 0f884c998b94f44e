"""Roughness of EON and of Fujii's model that comes closest to a random heightfield, by another minimisation."""

import math
from pathlib import Path

import pytest
import torch
from scipy.optimize import minimize_scalar

from torchbrdf import (
    EON,
    Cosines,
    FujiiOrenNayar,
    GaussianHeightfield,
    fixed,
)
from torchbrdf.accuracy import (
    eon_roughness_from_sigma,
    fitted_roughness,
    fujii_roughness_from_sigma,
)
from torchbrdf.testing import random_directions

D = torch.float64
DATA = Path(__file__).parents[1] / "data"


def number(value):
    return torch.tensor(value, dtype=D)


def directions(count, seed=0):
    return random_directions(count, dtype=D, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize(
    ("kind", "conversion"), [(EON, eon_roughness_from_sigma), (FujiiOrenNayar, fujii_roughness_from_sigma)]
)
def test_converted_roughness_is_the_best(kind, conversion):
    """By minimisation over random directions instead of a grid."""
    cosines = Cosines.of(*directions(4000, seed=4))
    sigma = number(math.radians(30))
    surfaces = {rho: GaussianHeightfield(albedo=number(rho), sigma=sigma) for rho in (0.3, 0.6, 0.9)}
    truth = {rho: surface.evaluate(cosines).detach() for rho, surface in surfaces.items()}

    def error(r):
        models = {rho: kind(albedo=number(rho), roughness=number(float(r))) for rho in truth}
        with torch.no_grad():
            return sum((models[rho].evaluate(cosines) / f - 1).square().mean().item() for rho, f in truth.items())

    best = minimize_scalar(error, bounds=(0.01, 0.99), method="bounded").x
    assert conversion(sigma).item() == pytest.approx(best, abs=0.02)
    stored, _ = fitted_roughness(lambda albedo, r: kind(albedo=albedo, roughness=fixed(r)), sigma)
    assert conversion(sigma).item() == pytest.approx(stored.item(), abs=1e-6)


def test_conversions_keep_to_their_domain():
    sigma = torch.deg2rad(torch.tensor([[0.0, 10.0], [52.5, 90.0]], dtype=D))
    r = eon_roughness_from_sigma(sigma)
    assert r.shape == (2, 2)
    assert r[0, 0] == 0
    assert r[0, 1] == pytest.approx(0.191)
    assert (r[1] == 1).all()  # EON ends there
    with pytest.raises(ValueError, match="fujii_roughness_from_sigma: sigma must lie in"):
        fujii_roughness_from_sigma(sigma + 1)
