"""The directional albedo by quadrature, against reflectances whose integrals are known."""

import math

import pytest

from torchbrdf import BRDF
from torchbrdf.testing.quadrature import albedo_by_quadrature, panels


class SquaredPhase(BRDF):
    """(light . view)^2."""

    def evaluate_components(self, cosines):
        return {"all": (cosines.phase**2)[..., None]}


class SmallerCosine(BRDF):
    """The smaller of both cosines: a kink where light and view are equally steep."""

    def evaluate_components(self, cosines):
        return {"all": cosines.light.minimum(cosines.view)[..., None]}


@pytest.mark.parametrize("angle", [0.0, 0.6, 1.5])
def test_albedo_of_known_integrals(angle):
    # the integral of light light^T cos over the hemisphere is diag(pi/4, pi/4, pi/2)
    expected = math.pi / 4 * math.sin(angle) ** 2 + math.pi / 2 * math.cos(angle) ** 2
    assert float(albedo_by_quadrature(SquaredPhase(), angle, 24)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("angle", [0.3, 0.6, 1.2])
def test_kink_at_the_view_is_the_end_of_a_panel(angle):
    # over x = cos(light): min(x, c) x, which is c x where the light is steeper than the view and x^2 where it is not
    c = math.cos(angle)
    expected = 2 * math.pi * (c * (1 - c * c) / 2 + c**3 / 3)
    assert float(albedo_by_quadrature(SmallerCosine(), angle, 24)) == pytest.approx(expected, rel=1e-12)


def test_panels_are_rules_between_their_ends():
    x, weight = panels([0.0, 0.3, 2.0], 3)
    assert x.shape == weight.shape == (6,)
    assert float(weight.sum()) == pytest.approx(2.0, rel=1e-14)
    assert float((weight * (x - 0.3).abs()).sum()) == pytest.approx((0.3**2 + 1.7**2) / 2, rel=1e-14)
