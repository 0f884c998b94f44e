"""Facets drawn in proportion to the area that a view sees of them."""

import math

import torch
from helpers.probes import held, seeded

from torchbrdf import GGX, AshikhminShirley, Oriented, Perfect, TorranceSparrow
from torchbrdf import testing as laws

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
