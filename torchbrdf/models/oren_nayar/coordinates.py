r"""Coordinates in which the V-cavity reflectance of every roughness is nearly one smooth function.

A facet of slope tan(theta_a) is shaded where tan(theta_a) tan(theta) > 1, so a light and a view are points p, q at
distances t = z tan(theta) in one plane for all roughnesses, z(sigma) being the slope of typical facets; sigma itself
enters once more, through the facets' own tilt. Everything is even in sigma, symmetric in light and view, 0 for a smooth
surface and bounded at the horizon, and made of the cosines by products, quotients and roots. The cone at light = view
is one coordinate; all others are smooth.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import positive

KAPPA = 1.5  # z = KAPPA sigma for small sigma
LEVEL = 1.25  # [rad] where z levels off: slopes end at 90 degrees, so that a wider Gaussian changes little
RETURN = 0.5  # of `Coordinates.growth`
# The tip of the cone is round on this scale, so that every derivative exists there, at the normal and at sigma = 0.
_TIP = 1e-10


class Coordinates(NamedTuple):
    """Of directions (...) on a surface of roughness sigma (...)."""

    features: Tensor  # (7, ...)
    growth: Tensor  # grows as the tangent where light and view approach the horizon together (...)
    share: Tensor  # z^2/(1 + z^2) (...)


def slope_squared(sigma: Tensor) -> Tensor:
    """z^2 (...) of sigma (...) [rad]."""
    s2 = sigma * sigma
    return KAPPA**2 * s2 / (1 + s2 / LEVEL**2)


def coordinates(light: Tensor, view: Tensor, phase: Tensor, azimuth_sine: Tensor, squared: Tensor) -> Coordinates:
    """From the fields of `Cosines` of these names and z^2, all of one shape (...)."""
    # Directions alone first, and as few operations with a constant as possible: in forward differentiation by one
    # sigma for all, each of those takes torch longer than its numbers do.
    over = 1 / (light * view)
    directions = (
        (1 - light) * (1 + light) / (light * light),
        (1 - view) * (1 + view) / (view * view),
        (phase - light * view) * over,
        azimuth_sine * over,
    )
    t2_i, t2_r, dot, cross = (squared * torch.stack(directions)).unbind(0)  # dot = p.q, cross = |p x q|
    area_i, area_r = 1 + t2_i, 1 + t2_r
    v_i, v_r = torch.rsqrt(area_i), torch.rsqrt(area_r)
    dip_i, dip_r = 1 - v_i, 1 - v_r
    around, twice = area_i + t2_r, dot + dot
    # Facets that one direction shades: vectors of length f = t^4/(1 + t^2)^(3/2) along p and q, and their distance.
    # 2 f_i f_r (1 - cos(dphi)) is written with (|p||q| - p.q)^2 + |p x q|^2, which keeps its digits at dphi = 0.
    g_i, g_r = t2_i * (v_i * v_i * v_i), t2_r * (v_r * v_r * v_r)
    f_i, f_r = t2_i * g_i, t2_r * g_r
    difference, both = f_i - f_r, f_i + f_r
    turned = positive(t2_i * t2_r).sqrt() - dot
    turn = g_i * g_r * (turned * turned + cross * cross)
    distance = (difference * difference + turn + _TIP * _TIP).sqrt()
    # f_i + f_r less the distance, without its cancellation: what both are shaded from
    common = ((f_i + f_i) * (f_r + f_r) - turn) / (both + distance)
    share = squared / (1 + squared)
    features = (
        dip_i + dip_r,
        dip_i * dip_r,
        1 - torch.rsqrt((around + twice).clamp(min=1)),  # of |p + q|^2: the two points on one side of the normal
        1 - torch.rsqrt((around - twice).clamp(min=1)),  # and of their distance
        dot * v_i * v_r,
        common / (1 + both),
        share,
    )
    return Coordinates(torch.stack(features), 1 + RETURN * common, share)
