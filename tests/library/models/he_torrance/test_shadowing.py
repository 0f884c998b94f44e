"""Shadowing against recorded values and Smith's integral."""

import math

import pytest
from helpers.he_torrance_surfaces import GOLDEN, close
from helpers.probes import doubles
from scipy.integrate import quad

from torchbrdf.models.he_torrance.shadowing import shadowing


@pytest.mark.parametrize("case", GOLDEN["smith"])
def test_shadowing(case):
    theta = doubles([math.radians(case["theta"])])
    got = shadowing(theta.cos(), theta.sin(), sigma0=doubles([case["sigma0_over_tau"]]), tau=doubles([1.0]))
    rtol = 1e-14 if case["theta"] < 89.5 else 2e-11
    close(got.visibility, case["S1"], rtol)
    close(got.over_cos, case["S1_over_cos"], rtol)
    close(got.k, case["K"], max(rtol, 2e-11))


@pytest.mark.parametrize(("degrees", "ratio"), [(30.0, 0.5), (60.0, 0.16), (80.0, 1.0), (89.0, 4.4)])
def test_shadowing_is_smiths_integral(degrees, ratio):
    theta, w = math.radians(degrees), math.sqrt(2) * ratio
    mu = 1 / math.tan(theta)

    def facets(q):
        return (q - mu) * math.exp(-(q**2) / (2 * w**2)) / (math.sqrt(2 * math.pi) * w)

    shadow = quad(facets, mu, mu + 12 * w, epsabs=1e-14)[0] / mu
    lit = 0.5 * (1 + math.erf(mu / (math.sqrt(2) * w)))
    got = shadowing(*(doubles([f(theta)]) for f in (math.cos, math.sin)), sigma0=doubles([ratio]), tau=doubles([1.0]))
    close(got.visibility, lit / (1 + shadow), 1e-10)
