"""One slope angle: azimuth means against adaptive quadrature of the integrand written from the paper's vectors and
strips.
"""

import itertools
import math

import numpy as np
import pytest
import torch
from paper_form import crossed_strings
from scipy.integrate import quad

from torchbrdf.models.oren_nayar.azimuth import (
    direct_mean,
    saturated_correlation,
    saturated_lobes,
    two_bounce_mean_approximate,
)
from torchbrdf.models.oren_nayar.azimuth_paper import direct_mean_paper, two_bounce_mean_paper
from torchbrdf.models.oren_nayar.azimuth_quadrature import two_bounce_mean
from torchbrdf.models.oren_nayar.interreflection import (
    two_bounce_integrand,
)
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles
from torchbrdf.v_cavity import direct_integrand, geometric_attenuation

RNG = np.random.default_rng(5)
CASES = [(*RNG.uniform(0, 1.5, 2), RNG.uniform(0, math.pi), RNG.uniform(0.05, 1.5)) for _ in range(25)]
CASES += [
    (0.0, 1.2, 0.4, 1.0),
    (1.3, 1.3, 0.0, 1.2),
    (1.3, 1.3, math.pi, 1.2),
    (1.4, 1.1, 0.5 * math.pi, 1.3),
    (1.0, 1.4, 0.0, 0.9),
]


def f64(*values):
    return [torch.tensor(v, dtype=torch.float64) for v in values]


def plane_and_slope(theta_i, theta_r, delta, slope):
    cosine, tangent = f64(math.cos(slope), math.tan(slope))
    return slope_plane_from_angles(*f64(theta_i, theta_r, delta)), {"cos_slope": cosine, "tan_slope": tangent}


def distance(x, y, slope):
    return math.sqrt(x * x + 2 * x * y * math.cos(2 * slope) + y * y)


def facets(theta_i, theta_r, delta, slope):
    """Direct and two-bounce BRDF against facet azimuth, from the vectors of sections 2 to 4 (no slope plane)."""
    s = np.array([math.sin(theta_i), 0, math.cos(theta_i)])
    v = np.array([math.sin(theta_r) * math.cos(delta), math.sin(theta_r) * math.sin(delta), math.cos(theta_r)])

    def normal(phi):
        return np.array([math.sin(slope) * math.cos(phi), math.sin(slope) * math.sin(phi), math.cos(slope)])

    def direct(phi):
        a = normal(phi)
        sa, va = s @ a, v @ a
        if sa <= 0 or va <= 0:
            return 0.0
        return sa * va / (a[2] * v[2] * s[2] * math.pi) * min(1, 2 * s[2] * a[2] / sa, 2 * v[2] * a[2] / va)

    def two(phi):
        a, b = normal(phi), normal(phi + math.pi)
        sb, va = s @ b, v @ a
        if sb <= 0 or va <= 0:
            return 0.0
        hidden_v, hidden_s = (max(0.0, min(1.0, -m)) for m in (v @ b / va, s @ a / sb))
        exchange = (
            distance(1, hidden_s, slope)
            + distance(1, hidden_v, slope)
            - distance(hidden_s, hidden_v, slope)
            - distance(1, 1, slope)
        )
        return sb * va / (math.pi * a[2] * v[2] * s[2]) * 0.5 * exchange

    return direct, two


def azimuth_mean(function, theta_i, theta_r, delta, slope, *, rtol):
    """Adaptive, cut at every shadow and mask edge and where the two coincide."""
    cuts = {0.0, 2 * math.pi}
    for theta, centre in ((theta_i, 0.0), (theta_r, delta)):
        if math.tan(theta) * math.tan(slope) > 1:
            half = math.acos(1 / (math.tan(theta) * math.tan(slope)))
            cuts |= {(centre + sign * half + turn) % (2 * math.pi) for sign in (-1, 1) for turn in (0, math.pi)}
    p, q = np.array([math.tan(theta_i), 0]), math.tan(theta_r) * np.array([math.cos(delta), math.sin(delta)])
    for difference in (p - q, p + q):
        cuts |= {(math.atan2(difference[0], -difference[1]) + turn) % (2 * math.pi) for turn in (0, math.pi)}
    edges = sorted(cuts)
    parts = [
        quad(function, a, b, epsabs=1e-15, epsrel=rtol, limit=200)[0]
        for a, b in itertools.pairwise(edges)
        if b - a > 1e-14
    ]
    return math.fsum(parts) / (2 * math.pi)


@pytest.mark.filterwarnings("ignore:.*roundoff:scipy.integrate.IntegrationWarning")
@pytest.mark.filterwarnings("ignore:.*roundoff.*")
@pytest.mark.parametrize("case", CASES)
def test_direct_mean_is_the_integral(case):
    plane, slope = plane_and_slope(*case)
    assert direct_mean(plane, **slope).item() == pytest.approx(
        azimuth_mean(facets(*case)[0], *case, rtol=1e-13), rel=1e-12, abs=1e-15
    )


@pytest.mark.filterwarnings("ignore:.*roundoff.*")
@pytest.mark.parametrize("case", CASES)
def test_two_bounce_mean_is_the_integral(case):
    plane, slope = plane_and_slope(*case)
    lobes = saturated_lobes(plane, **slope)
    expected = azimuth_mean(facets(*case)[1], *case, rtol=1e-11)
    correlation = saturated_correlation(plane, lobes)
    assert two_bounce_mean(plane, lobes, correlation, order=24, graded=True).item() == pytest.approx(
        expected, rel=1e-9, abs=1e-15
    )
    assert two_bounce_mean(plane, lobes, correlation, order=5).item() == pytest.approx(expected, rel=6e-3, abs=4e-4)


@pytest.mark.parametrize("delta", [0.0, 0.5 * math.pi, math.pi])
def test_paper_forms_are_exact_in_and_across_the_plane(delta):
    for theta_i, theta_r, slope_angle in RNG.uniform(0.02, 1.5, (200, 3)):
        plane, slope = plane_and_slope(theta_i, theta_r, delta, slope_angle)
        torch.testing.assert_close(
            direct_mean_paper(plane, **slope), direct_mean(plane, **slope), rtol=1e-12, atol=1e-13
        )
        torch.testing.assert_close(
            two_bounce_mean_paper(plane, **slope), two_bounce_mean_approximate(plane, **slope), rtol=1e-12, atol=1e-13
        )


def test_collapsed_integrand_equals_strips():
    """X' Y IF / (pi S^2) in the collapsed form against crossed strings, and in float32 on a shallow slope."""
    for light, view, slope in zip(
        RNG.uniform(-3, 9, 300), RNG.uniform(-3, 9, 300), RNG.uniform(0.1, 1.5, 300), strict=True
    ):
        x, y = max(0, 1 + light), max(0, 1 + view)
        hidden = [min(1.0, max(0.0, 1 - 2 / z)) if z > 0 else 1.0 for z in (x, y)]
        factor = crossed_strings(*hidden, slope)
        found = two_bounce_integrand(*f64(light, view), cos_slope=f64(math.cos(slope))[0]).item()
        assert found == pytest.approx(x * y * factor / (math.pi * math.sin(slope) ** 2), rel=1e-11, abs=1e-13)
    single, cosine = torch.tensor([1.5, 4.0]), torch.tensor(0.01).cos()
    slope = math.acos(cosine.item())  # 1 - cos has lost most of its digits in the rounding of the cosine already
    expected = 2.5 * 5 * crossed_strings(1 - 2 / 2.5, 1 - 2 / 5, slope) / (math.pi * math.sin(slope) ** 2)
    assert two_bounce_integrand(*single, cos_slope=cosine).item() == pytest.approx(expected, rel=1e-5)


def test_attenuation_is_the_smaller_fraction():
    """The nesting that is printed in (38) would give 1 for a facet that is 30 % lit and fully visible."""
    keywords = dict(zip(("cos_light", "cos_view", "cos_facet"), f64(0.1, 0.9, 0.6), strict=True))
    lit = 2 * 0.1 * 0.6 / 0.4
    assert geometric_attenuation(*f64(0.4, 0.8), **keywords).item() == pytest.approx(lit)
    assert geometric_attenuation(*f64(-0.4, 0.8), **keywords).item() == 0
    assert direct_integrand(*f64(3.0, 0.5)).item() == pytest.approx(2 * 1.5)
