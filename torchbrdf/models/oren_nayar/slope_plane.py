"""Light and view as points of the slope plane, where every masking and shadowing event of a V-cavity is a straight
line.

For a direction s the point p = s_xy / s_z has length tan(theta); a facet of slope angle theta_a is the point u of
length tan(theta_a). With p for the light and q for the view,  <s,a> = s_z a_z X, X = 1 + u.p,  <v,a> = v_z a_z Y, Y = 1
+ u.q,  and the opposite facet of the cavity is -u. Source: own derivation, `docs/equations/oren_nayar.md`, section 1.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import safe_atan2, safe_divide, safe_sqrt
from torchbrdf.directions import Cosines


class SlopePlane(NamedTuple):
    """Light point p and view point q of the slope plane, up to a common rotation. Every field (...)."""

    tan_light: Tensor  # |p| = tan(theta_i) [-]
    tan_view: Tensor  # |q| = tan(theta_r) [-]
    dot: Tensor  # p.q = tan(theta_i) tan(theta_r) cos(delta) [-]
    delta: Tensor  # azimuth between p and q, folded to [0, pi] [rad]
    crossing: Tensor  # azimuth from p, towards q, at which u.p = u.q > 0 [rad]
    opposite_crossing: Tensor  # the same for p and -q: u.p = -u.q > 0 [rad]


def slope_plane(cosines: Cosines) -> SlopePlane:
    """Slope-plane coordinates (...) of light and view.

    The mean over azimuth is reciprocal; here the more grazing of the two directions always plays the light, so that
    exchanging them changes no bit, at any order of a quadrature.
    Derivatives: |p|, |q| and delta are roots of quantities that vanish at normal incidence and in the plane of
    incidence. Their derivative is taken as 0 there. Every function of these modules is even about those points or
    reads `dot` for its odd part, so that derivatives with respect to the *vectors* stay exact; only at light = view, a
    genuine cone of the BRDF, is the zero a choice among subgradients.
    Below the horizon all fields describe a light and a view along the normal.
    """
    light, view = cosines.alpha, cosines.beta
    product = light * view
    # (1-c)(1+c) keeps the digits that 1 - c*c loses next to the normal.
    tan_light = safe_sqrt((1 - light) * (1 + light)) / light
    tan_view = safe_sqrt((1 - view) * (1 + view)) / view
    return _from_products(tan_light, tan_view, cosines.in_plane / product, cosines.azimuth_sine / product)


def _from_products(tan_light: Tensor, tan_view: Tensor, dot: Tensor, cross: Tensor) -> SlopePlane:
    """From |p|, |q|, p.q and |p x q|."""
    delta = safe_atan2(cross, dot)
    # u.(p - q) = 0 perpendicular to p - q: with p along the first axis, u is along (|q| sin, |p| - |q| cos).
    lit = tan_light > 0
    along = safe_divide(dot, tan_light, where=lit)
    across = safe_divide(cross, tan_light, where=lit)
    crossing = safe_atan2(tan_light - along, across)
    opposite_crossing = safe_atan2(tan_light + along, across)
    return SlopePlane(tan_light, tan_view, dot, delta, crossing, opposite_crossing)


def slope_plane_from_angles(theta_light: Tensor, theta_view: Tensor, azimuth: Tensor) -> SlopePlane:
    """Slope-plane coordinates from polar angles and relative azimuth (...), for tables and tests. [rad]

    Keeps the digits of a small azimuth or of an angle next to 90 degrees that the three cosines cannot carry.
    """
    theta_light, theta_view, azimuth = torch.broadcast_tensors(theta_light, theta_view, azimuth)
    tan_light, tan_view = theta_light.tan(), theta_view.tan()
    delta = safe_atan2(azimuth.sin().abs(), azimuth.cos())
    along, across = tan_view * delta.cos(), tan_view * delta.sin()
    crossing = safe_atan2(tan_light - along, across)
    opposite_crossing = safe_atan2(tan_light + along, across)
    return SlopePlane(tan_light, tan_view, tan_light * along, delta, crossing, opposite_crossing)
