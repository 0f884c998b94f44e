"""What a He-Torrance surface returns: energy, its quadrature, and Monte Carlo."""

import math

import pytest
import torch
from helpers.he_torrance_surfaces import material
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import HeTorrance, fixed
from torchbrdf import testing as laws
from torchbrdf.models.he_torrance.energy import directional_diffuse_albedo
from torchbrdf.models.he_torrance.reflectance import specular_reflectivity

PERFECT = 1e4j  # |F| = 1 at every angle


def cosines(*degrees):
    return torch.deg2rad(doubles(degrees)).cos()


def model(sigma0, tau, wavelength, index, **more):
    return HeTorrance(
        **{name: fixed(value) for name, value in material(sigma0, tau, wavelength, index).items()}, **more
    )


def surface_albedo(cos, *parameters):
    surface = material(*parameters)
    return (directional_diffuse_albedo(cos, **surface) + specular_reflectivity(cos, **surface))[:, 0]


# figures of the equation sheet, section 10 and 2, by another quadrature
@pytest.mark.parametrize(
    ("parameters", "degrees", "expected", "atol"),
    [
        ((0.05, 3.0, 0.5, PERFECT), (0, 30, 60), (1.0, 1.0, 1.0), 5e-5),
        ((0.05, 3.0, 0.5, PERFECT), (86, 89), (1.0217, 0.44), 5e-3),
        ((1.45, 13.2, 0.5, 1.74), (0, 60, 84), (0.073, 0.115, 0.221), 6e-4),
        ((0.28, 1.77, 0.5, 0.77 + 6.08j), (0, 60), (0.919, 0.806), 5e-4),
    ],
)
def test_what_the_surface_returns(parameters, degrees, expected, atol):
    assert_close(surface_albedo(cosines(*degrees), *parameters), doubles(expected), rtol=0, atol=atol)


@pytest.mark.parametrize(
    "parameters",
    [
        (0.28, 1.77, 0.5, 0.77 + 6.08j),
        (0.05, 3.0, 0.5, PERFECT),
        (1.45, 13.2, 0.5, 1.74),
        (4.4, 1.0, 0.55, 1.5),
        (0.001, 100.0, 0.5, 1.5),
    ],
)
def test_quadrature_is_as_good_as_it_says(parameters):
    surface, cos = material(*parameters), cosines(0, 30, 60, 80, 86, 89, 89.9)
    fine = directional_diffuse_albedo(cos, nodes=80, **surface)
    assert (directional_diffuse_albedo(cos, **surface) - fine).abs().max() < 2e-7
    assert (directional_diffuse_albedo(cos, nodes=16, **surface) - fine).abs().max() < 1e-4


def test_albedo_agrees_with_monte_carlo():
    # draws of the sampler, five standard errors; the specular part is drawn apart
    for angle in (0.3, 1.4):
        brdf = model(0.1, 1.0, 0.5, 0.77 + 6.08j, diffuse=fixed(doubles([0.05])))
        with torch.no_grad():
            weight = laws.SamplingSetup.of(brdf, angle).draw(40_000, torch.Generator().manual_seed(1)).weight
        expected = brdf.directional_albedo(doubles(math.cos(angle)))
        assert abs(float(weight.mean() - expected)) < 5 * float(weight.std()) / math.sqrt(40_000)
