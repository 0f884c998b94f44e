"""Ashikhmin and Shirley: albedos, and the grain."""

import pytest
import torch
from helpers.probes import COS, albedo, doubles, few, held
from torch.testing import assert_close

from torchbrdf import AshikhminShirley, Oriented


def grained(**material):
    return Oriented(AshikhminShirley(**material), doubles([1.0, 0.0, 0.0]))


def test_ashikhmin_shirley_albedos():
    zero, one = held(0.0), held(1.0)
    matte = grained(diffuse=one, specular=held(0.1), exponent_x=zero, exponent_y=zero)
    for c in COS:
        parts = matte.brdf.components  # the diffuse part alone has a closed form
        assert parts is not None
        body = grained(diffuse=one, specular=zero, exponent_x=held(1.0), exponent_y=held(1.0))
        shine = grained(diffuse=zero, specular=zero, exponent_x=held(1.0), exponent_y=held(1.0))
        assert albedo(body, c) - albedo(shine, c) == pytest.approx(1 - (1 - c / 2) ** 5, rel=1e-9)
        assert albedo(matte, c) <= 1
    for n, expected in ((1.0, 0.25), (10.0, 0.696), (100.0, 0.961)):
        shine = grained(diffuse=zero, specular=one, exponent_x=held(n), exponent_y=held(n))
        assert albedo(shine, 1.0, 64) == pytest.approx(expected, abs=5e-4)


def test_ashikhmin_shirley_turns_with_its_grain():
    brdf = AshikhminShirley(exponent_x=held(5.0), exponent_y=held(200.0), diffuse=held(0.1), specular=held(0.3))
    swapped = AshikhminShirley(exponent_x=held(200.0), exponent_y=held(5.0), diffuse=held(0.1), specular=held(0.3))
    normal, light, view = few()
    tangent = torch.linalg.cross(normal, normal.roll(1, -1))
    across = torch.linalg.cross(normal, torch.nn.functional.normalize(tangent, dim=-1))
    assert_close(brdf(normal, light, view, tangent=tangent), swapped(normal, light, view, tangent=across))
    assert_close(brdf(normal, light, view, tangent=-3 * tangent + normal), brdf(normal, light, view, tangent=tangent))
