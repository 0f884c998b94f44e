"""Means over the azimuth of facets of one slope: adaptive quadrature of what the paper's vectors and strips say."""

import itertools
import math

import numpy as np
from scipy.integrate import quad

from helpers.planes import f64
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles

RNG = np.random.default_rng(5)
CASES = [(*RNG.uniform(0, 1.5, 2), RNG.uniform(0, math.pi), RNG.uniform(0.05, 1.5)) for _ in range(25)]
CASES += [
    (0.0, 1.2, 0.4, 1.0),
    (1.3, 1.3, 0.0, 1.2),
    (1.3, 1.3, math.pi, 1.2),
    (1.4, 1.1, 0.5 * math.pi, 1.3),
    (1.0, 1.4, 0.0, 0.9),
]


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
