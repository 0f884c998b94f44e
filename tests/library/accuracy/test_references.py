"""The references of the ladder: the converged model, and what it agrees with."""

import math

import pytest
import torch

from torchbrdf import Cosines, RoughSurface
from torchbrdf.accuracy import converged, reference_error
from torchbrdf.models.oren_nayar.converged import converged as converged_parts
from torchbrdf.models.oren_nayar.slope_plane import slope_plane
from torchbrdf.testing import random_directions

DOUBLE = torch.float64


def directions(n, seed=0):
    return Cosines.of(*random_directions(n, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed)))


@pytest.mark.parametrize("degrees", [5.0, 20.0, 60.0])
def test_reference_is_the_converged_model(degrees):
    sigma, rho = torch.deg2rad(torch.tensor(degrees, dtype=DOUBLE)), torch.tensor(0.9, dtype=DOUBLE)
    assert reference_error(rho, sigma, directions(40)) < 5e-4


def test_converged_is_the_limit_of_the_exact_rungs():
    """The rungs of the default surface come closer with their slopes and bounces; the best stays within its figure."""
    sigma, rho = torch.tensor(0.5, dtype=DOUBLE), torch.tensor([0.9, 0.3], dtype=DOUBLE)
    cosines = directions(12)
    exact = converged(cosines, albedo=rho, sigma=sigma)

    def error(**settings):
        values = RoughSurface(albedo=rho, sigma=sigma, **settings).evaluate(cosines).detach()
        return float((values / exact - 1).abs().max())

    one, two, every = (error(bounces=bounces) for bounces in (1, 2, "all"))
    finest = error(bounces="all", nodes=48, order=6, modes=8)
    assert one > two > every > finest
    assert every < 6e-3
    assert finest < 1e-3
    # with almost no albedo all light is reflected once
    faint = converged(cosines, albedo=1e-6 + 0 * rho, sigma=sigma) / 1e-6
    direct = converged_parts(slope_plane(cosines), sigma).direct
    torch.testing.assert_close(faint[:, 0], direct, rtol=1e-5, atol=0)


def test_converged_has_the_conventions_of_a_model():
    below = Cosines.from_products(*(torch.tensor([a, -0.5], dtype=DOUBLE) for a in (0.5, 0.8)), directions(2).phase)
    f = converged(below, albedo=torch.tensor([0.2, 0.4, 0.6], dtype=DOUBLE), sigma=torch.tensor(0.0, dtype=DOUBLE))
    assert f.shape == (2, 3)
    torch.testing.assert_close(f[0], torch.tensor([0.2, 0.4, 0.6], dtype=DOUBLE) / math.pi)  # smooth: Lambert
    assert (f[1] == 0).all()
    with pytest.raises(TypeError, match="must be float64"):
        converged(Cosines.from_products(*torch.full((3, 1), 0.5)), albedo=torch.tensor(0.5), sigma=torch.tensor(0.3))
    with pytest.raises(ValueError, match="converged: albedo must lie in"):
        converged(below, albedo=torch.tensor(1.5, dtype=DOUBLE), sigma=torch.tensor(0.3, dtype=DOUBLE))
