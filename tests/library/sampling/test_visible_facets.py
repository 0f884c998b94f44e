"""Facets drawn in proportion to the area that a view sees of them: densities by differences, weights."""

import math

import pytest
import torch
from helpers.jacobians import density_by_differences, inner_numbers
from helpers.probes import doubles, held, seeded
from torch.testing import assert_close

from torchbrdf import GGX, AshikhminShirley, Oriented, Perfect, TorranceSparrow
from torchbrdf import testing as laws
from torchbrdf.sampling import visible_beckmann_facet, visible_ggx_facet

ANGLES = [math.radians(60), math.radians(85)]


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


def visible_ggx(facet, view, x, y):
    """D G1 (view . m)/cos_view of GGX, written out."""
    d = 1 / (math.pi * x * y * ((facet[:, 0] / x) ** 2 + (facet[:, 1] / y) ** 2 + facet[:, 2] ** 2) ** 2)
    steep = ((x * view[0]) ** 2 + (y * view[1]) ** 2) / view[2] ** 2
    return d * 2 / (1 + (1 + steep).sqrt()) * (facet @ view) / view[2]


def visible_beckmann(facet, view, x, y):
    """D G1 (view . m)/cos_view of Beckmann, written out."""
    tan2 = ((facet[:, 0] / x) ** 2 + (facet[:, 1] / y) ** 2) / facet[:, 2] ** 2
    d = torch.exp(-tan2) / (math.pi * x * y * facet[:, 2] ** 4)
    a = view[2] / torch.hypot(x * view[0], y * view[1])
    hidden = torch.exp(-a * a) / (2 * a * math.sqrt(math.pi)) - torch.erfc(a) / 2
    return d / (1 + hidden) * (facet @ view) / view[2]


@pytest.mark.parametrize(
    ("sampler", "density"), [(visible_ggx_facet, visible_ggx), (visible_beckmann_facet, visible_beckmann)]
)
@pytest.mark.parametrize("widths", [(0.4, 0.4), (0.2, 0.8)])
@pytest.mark.parametrize("view", [(0.0, 0.6, 0.8), (-0.48, 0.64, 0.6), (0.99, 0.02, 0.13967)])
def test_facets_have_the_density_that_a_view_sees(sampler, density, widths, view):
    view = torch.nn.functional.normalize(doubles(view), dim=-1)
    x, y = doubles(widths)
    u = inner_numbers()
    facet = sampler(view.expand(200, 3), x, y, u)
    got = density_by_differences(lambda u: sampler(view.expand(200, 3), x, y, u), u)
    assert_close(got, density(facet, view, x, y), rtol=1e-5, atol=0)
