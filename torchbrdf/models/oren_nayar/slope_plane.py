"""Light and view as points of the slope plane, where every masking and shadowing event of a V-cavity is a straight
line.

For a direction s the point p = s_xy / s_z has length tan(theta); a facet of slope angle theta_a is the point u of
length tan(theta_a). With p for the light and q for the view,  <s,a> = s_z a_z X, X = 1 + u.p,  <v,a> = v_z a_z Y, Y = 1
+ u.q,  and the opposite facet of the cavity is -u. Source: own derivation, `docs/equations/oren_nayar.md`, section 1.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import cross, dot, length, safe_atan2, safe_sqrt
from torchbrdf.directions import Cosines


class SlopePlane(NamedTuple):
    """Light point p and view point q of the slope plane, up to a common rotation. Every field (...)."""

    tan_light: Tensor  # |p| = tan(theta_i) [-]
    tan_view: Tensor  # |q| = tan(theta_r) [-]
    dot: Tensor  # p.q = tan(theta_i) tan(theta_r) cos(delta) [-]
    delta: Tensor  # azimuth between p and q, folded to [0, pi] [rad]
    apart: Tensor  # |p - q| [-]
    opposed: Tensor  # |p + q| [-]
    crossing: Tensor  # azimuth from p, towards q, at which u.p = u.q > 0 [rad]; without a derivative
    opposite_crossing: Tensor  # the same for p and -q: u.p = -u.q > 0 [rad]; without a derivative


def slope_plane(cosines: Cosines) -> SlopePlane:
    """Slope-plane coordinates (...) of light and view.

    The mean over azimuth is reciprocal; here the more grazing of the two directions always plays the light, so that
    exchanging them changes no bit, at any order of a quadrature.
    Derivatives: |p|, |q|, |p - q|, |p + q| and delta are roots of quantities that vanish at normal incidence and in the
    plane of incidence. Their derivative is taken as 0 there. Every function of these modules is even about those points
    or reads `dot` for its odd part, so that derivatives with respect to the *vectors* stay exact; only at light = view,
    a genuine cone of the BRDF, is the zero a choice among subgradients. That holds next to those points too, because
    all fields are made of the same two vectors: what rounding leaves of a length in one of them it leaves in all.
    Without vectors (`Cosines.from_products`) the two tangents and p.q take their place.
    Below the horizon all fields describe a light and a view along the normal.
    """
    if cosines.vectors is None:
        tan_light, tan_view = (safe_sqrt((1 - c) * (1 + c)) / c for c in (cosines.alpha, cosines.beta))
        return _from_tangents(tan_light, tan_view, cosines.in_plane / (cosines.light * cosines.view))
    normal, light, view = cosines.vectors
    below = ~cosines.above_horizon[..., None]
    # n x s / (n.s) is p turned by 90 degrees, exactly 0 where light and normal are one.
    p = (cross(normal, light) / cosines.light[..., None]).masked_fill(below, 0.0)
    q = (cross(normal, view) / cosines.view[..., None]).masked_fill(below, 0.0)
    tan_p, tan_q = length(p), length(q)
    return _from_lengths(
        torch.maximum(tan_p, tan_q),
        torch.minimum(tan_p, tan_q),
        dot(p, q),
        dot(normal, cross(p, q)).abs(),
        apart=length(p - q),
        opposed=length(p + q),
    )


def slope_plane_from_angles(theta_light: Tensor, theta_view: Tensor, azimuth: Tensor) -> SlopePlane:
    """Slope-plane coordinates from polar angles and relative azimuth (...), for tables and tests. [rad]

    Keeps the digits of a small azimuth or of an angle next to 90 degrees that the three cosines cannot carry.
    """
    theta_light, theta_view, azimuth = torch.broadcast_tensors(theta_light, theta_view, azimuth)
    tan_light, tan_view = theta_light.tan(), theta_view.tan()
    product = tan_light * tan_view
    apart, opposed = (
        safe_sqrt((tan_light - tan_view) ** 2 + 4 * product * half**2)
        for half in ((azimuth / 2).sin(), (azimuth / 2).cos())
    )
    return _from_lengths(
        tan_light, tan_view, product * azimuth.cos(), product * azimuth.sin().abs(), apart=apart, opposed=opposed
    )


def _from_tangents(tan_light: Tensor, tan_view: Tensor, dot: Tensor) -> SlopePlane:
    """From |p|, |q| and p.q, whose rounding may leave it beyond +-|p| |q|."""
    product = tan_light * tan_view
    backward, forward = (product - dot).relu(), (product + dot).relu()
    squared = (tan_light - tan_view) ** 2
    return _from_lengths(
        tan_light,
        tan_view,
        dot,
        safe_sqrt(backward * forward),
        apart=safe_sqrt(squared + 2 * backward),
        opposed=safe_sqrt(squared + 2 * forward),
    )


def _from_lengths(
    tan_light: Tensor, tan_view: Tensor, dot: Tensor, cross: Tensor, *, apart: Tensor, opposed: Tensor
) -> SlopePlane:
    """From |p|, |q|, p.q, |p x q|, |p - q| and |p + q|."""
    # u.(p - q) = 0 perpendicular to p - q: with p along the first axis, u is along (|p x q|, p.(p - q)). It parts
    # integrals into pieces whose sum does not depend on where they meet: no derivative passes through it, and none
    # may, since at p = q it has no meaning and next to it any number as a derivative.
    squares = (tan_light - tan_view) * (tan_light + tan_view)
    crossing, opposite_crossing = (
        safe_atan2(0.5 * (squares + distance * distance), cross).detach() for distance in (apart, opposed)
    )
    return SlopePlane(tan_light, tan_view, dot, safe_atan2(cross, dot), apart, opposed, crossing, opposite_crossing)
