r"""Coordinates in which the V-cavity reflectance of every roughness is close to a polynomial.

A direction at polar angle theta becomes a point at radius w on a disc, w = u/sqrt(1 + u^2) with
u = z tan(theta), where z(sigma) is the effective slope of the facets. So what the surface does to a
direction (how many facets shade it) is read on one scale for all roughnesses, and the horizon is the rim
w = 1. Everything below is even in the azimuth, symmetric in light and view, and made of the three cosines
by products, square roots and one division; nothing is singular before the horizon.
"""

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import safe_divide, safe_sqrt
from torchbrdf.directions import Cosines

KAPPA = 1.35  # z = KAPPA sigma for small sigma; between the best for direct (1.4) and interreflected light (1.2)
LEVEL = 1.25  # [rad] where z levels off: slopes end at 90 degrees, so that a wider Gaussian changes little
KNEE = 0.35  # [rad] of x = sigma^2 / (sigma^2 + KNEE^2), the variable of all series in sigma

Term = tuple[str, int, int, int]  # factor and the powers of A, S, Q


class Ring(NamedTuple):
    """Light and view on the disc, each (...); w_i, w_r are the radii, v = sqrt(1 - w^2) and c = cos(dphi). [-]"""

    along: Tensor  # A = w_i w_r c
    depth: Tensor  # S = (1 - v_i) + (1 - v_r)
    both: Tensor  # Q = (1 - v_i)(1 - v_r)
    apart: Tensor  # D, distance of light and view: the cone of the BRDF at light = view
    opposite: Tensor  # P, distance of light and mirrored view
    common: Tensor  # G, grows as the tangent of the smaller polar angle: light that masking and shadowing cut only once


def ring(cosines: Cosines, sigma: Tensor) -> Ring:
    """Ring coordinates of directions (...) for roughness sigma (broadcastable) [rad]; all 0 at sigma = 0."""
    light, view, in_plane = cosines.light, cosines.view, cosines.in_plane
    sine2_light, sine2_view = (1 - light) * (1 + light), (1 - view) * (1 + view)
    s2 = sigma * sigma
    z2 = KAPPA**2 * s2 / (1 + s2 / LEVEL**2)
    z = KAPPA * sigma * torch.rsqrt(1 + s2 / LEVEL**2)
    # t = w / z, so that no root of something of order sigma is taken: its derivative is infinite at sigma = 0.
    r_light, r_view = torch.rsqrt(light * light + z2 * sine2_light), torch.rsqrt(view * view + z2 * sine2_view)
    t2_light, t2_view = sine2_light * r_light * r_light, sine2_view * r_view * r_view
    a = in_plane * r_light * r_view
    # 1 - v = w^2 / (1 + v) is exactly 0 at sigma = 0 and loses no digits beside it.
    dip_light = z2 * t2_light / (1 + light * r_light)
    dip_view = z2 * t2_view / (1 + view * r_view)
    total = t2_light + t2_view
    # G = (T_i + T_r - |T_i - T_r|)/2 of two vectors of length T = w^3 / v, without cancellation or division by v.
    sine_light, sine_view = safe_sqrt(sine2_light), safe_sqrt(sine2_view)
    u_light, u_view = t2_light * sine_light * view, t2_view * sine_view * light
    product = t2_light * t2_view
    chord = safe_sqrt(u_light * u_light + u_view * u_view - 2 * product * light * view * in_plane)
    below = u_light + u_view + chord
    common = safe_divide(product * (sine_light * sine_view + in_plane), below, where=below > 0)
    return Ring(
        along=z2 * a,
        depth=dip_light + dip_view,
        both=dip_light * dip_view,
        apart=z * safe_sqrt(total - 2 * a),
        opposite=z * safe_sqrt(total + 2 * a),
        common=z2 * z * common,
    )


def knee(sigma: Tensor) -> Tensor:
    """x = sigma^2 / (sigma^2 + KNEE^2) in [0, 1), the variable of the series in sigma (...). [-]"""
    s2 = sigma * sigma
    return s2 / (s2 + KNEE**2)


def chebyshev(x: Tensor, count: int) -> list[Tensor]:
    """T_0 .. T_(count-1) of 2x - 1, each (...). [-]"""
    y = 2 * x - 1
    rows = [torch.ones_like(y), y]
    while len(rows) < count:
        rows.append(2 * y * rows[-1] - rows[-2])
    return rows[:count]


def chebyshev_slope(x: Tensor, count: int) -> list[Tensor]:
    """Derivatives of `chebyshev` by x, each (...). [-]"""
    y, rows = 2 * x - 1, chebyshev(x, count)
    slopes = [torch.zeros_like(y), torch.full_like(y, 2.0)]
    while len(slopes) < count:
        slopes.append(4 * rows[len(slopes) - 1] + 2 * y * slopes[-1] - slopes[-2])
    return slopes[:count]


def contract(r: Ring, terms: Sequence[Term], weights: Sequence[Tensor]) -> Tensor:
    """sum_n weights[n] * factor_n A^i S^j Q^k (...), nested (Horner) so that each coordinate is read rarely.

    torch.compile writes out every read of a coordinate again before it finds what is common: reads cost compile time.
    """
    factors = {"1": None, "D": r.apart, "P": r.opposite, "G": r.common}
    parts = []
    for name, factor in factors.items():
        mine = [(powers, weight) for (its, *powers), weight in zip(terms, weights, strict=True) if its == name]
        if mine:
            inner = _nested(mine, (r.along, r.depth, r.both))
            parts.append(inner if factor is None else factor * inner)
    return reduce(torch.add, parts)


def _nested(terms: list[tuple[list[int], Tensor]], variables: Sequence[Tensor]) -> Tensor:
    """Polynomial of `terms` (powers, weight) in the variables, the first outermost."""
    if not variables:
        return reduce(torch.add, [weight for _, weight in terms])
    first, *others = variables
    total = None
    for power in range(max(powers[0] for powers, _ in terms), -1, -1):
        here = [(powers[1:], weight) for powers, weight in terms if powers[0] == power]
        if total is not None:
            total = total * first
        if here:
            inner = _nested(here, others)
            total = inner if total is None else total + inner
    assert total is not None
    return total
