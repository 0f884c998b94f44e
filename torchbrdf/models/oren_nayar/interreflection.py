r"""Light that bounces between the two facets of a V-cavity: exactly two bounces in closed form, all bounces through
eigenmodes.

Coordinates: x in [0, 1] from the valley to the ridge on each facet. The facets exchange light through the symmetric
    kernel K(x, y) = (1/2) sin^2(2 theta_a) x y / (x^2 + 2 x y cos(2 theta_a) + y^2)^(3/2)                          =
    Oren & Nayar 1994, eq. (14), over pi
and the radiosity obeys B = rho (E + K B'), B' = rho (E' + K B) with E constant on the lit strip. Projections: z = -u.p
is how steeply the light meets the *opposite* facet, b = u.q how steeply the view meets the considered one.
Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), eqs. (12)-(20), (48).
"""

import math

import torch
from torch import Tensor

from torchbrdf._numerics import safe_divide, safe_sqrt


def two_bounce_factor(hidden_light: Tensor, hidden_view: Tensor, *, cos_slope: Tensor) -> Tensor:
    r"""Exchange between the lit strip [m_s, 1] of one facet and the visible strip [m_v, 1] of the other.

    .. math:: IF = (\pi/2)[\delta(1,1) + \delta(m_s,m_v) - \delta(1,m_s) - \delta(1,m_v)],\quad
              \delta(x,y) = x + y - d(x,y) = 4xy\sin^2\theta_a / (x+y+d(x,y))

    The delta form has the factor sin^2 in every term; the four distances of the source's eq. (20) cancel to
    nothing on shallow slopes.

    Source: Oren & Nayar 1994, eqs. (19), (20).

    Args: hidden fractions m_s, m_v and cos(theta_a), broadcastable (...). [-]
    Returns: IF (...). [-] in [0, pi (1 - cos(theta_a))]
    """
    one = torch.ones_like(cos_slope * hidden_light * hidden_view)
    delta_sum = _shortcut(one, one, cos_slope) + _shortcut(hidden_light, hidden_view, cos_slope)
    return (
        0.5 * math.pi * (delta_sum - _shortcut(one, hidden_light, cos_slope) - _shortcut(one, hidden_view, cos_slope))
    )


def two_bounce_factor_approximate(hidden_light: Tensor, hidden_view: Tensor, *, cos_slope: Tensor) -> Tensor:
    """IF as if every strip exchanged the mean share: pi (1 - cos(theta_a)) (1 - m_s)(1 - m_v); exact when
    nothing is hidden. Source: Oren & Nayar 1994, eq. (48).
    """
    return math.pi * (1 - cos_slope) * (1 - hidden_light) * (1 - hidden_view)


def two_bounce_integrand(opposite_light: Tensor, view_projection: Tensor, *, cos_slope: Tensor) -> Tensor:
    r"""X' Y IF / pi, divided by sin^2(theta_a), in a form without cancellation and without divisions by X' or Y (own
    derivation).

    With z >= 1, b >= 1, C = cos(theta_a), P(z) = zC + sqrt(z^2 C^2 + S^2) and D^2 = (z-b)^2 + C^2 (z^2-1)(b^2-1), the
    exchange of Oren & Nayar 1994, eq. (19), collapses to
    H(z, b) = (1+b)/P(z) + (1+z)/P(b) - (z-b)^2 / (D + C(zb - 1)); below 1 either argument enters H as
    1 and as a factor (1+z)/2.

    Args: z = -u.p and b = u.q (...), C broadcastable. [-]
    Returns: (...). [-] The two-bounce BRDF of facets with slope u is (rho^2/pi) C S^2 times this.
    """
    z, b = opposite_light.clamp(min=1), view_projection.clamp(min=1)
    facing = 0.25 * (1 + opposite_light.clamp(-1, 1)) * (1 + view_projection.clamp(-1, 1))
    exchange = (1 + b) / reach(z, cos_slope) + (1 + z) / reach(b, cos_slope) - strip_mismatch(z, b, cos_slope)
    return facing * exchange


def reach(z: Tensor, cos_slope: Tensor) -> Tensor:
    """P(z) = zC + sqrt(z^2 C^2 + S^2): 1 + C at z = 1, 2zC for large z; its inverse is (1/2) X' delta(1, m_s) / S^2
    less 1.
    """
    projected = z * cos_slope
    return projected + (projected * projected + (1 - cos_slope) * (1 + cos_slope)).clamp(min=0).sqrt()


def strip_mismatch(z: Tensor, b: Tensor, cos_slope: Tensor) -> Tensor:
    """(z-b)^2 / (D + C(zb-1)) for z, b >= 1 (clamped); 0 where z = b. Its derivative at the corner z = b = 1 is taken
    as 0.
    """
    z, b = z.clamp(min=1), b.clamp(min=1)
    gap = z - b
    root = safe_sqrt(gap * gap + cos_slope * cos_slope * ((z - 1) * (z + 1)) * ((b - 1) * (b + 1)))
    denominator = root + cos_slope * (z * b - 1)
    return safe_divide(gap * gap, denominator, where=denominator > 0)


def two_bounce_facet(light_projection: Tensor, view_projection: Tensor, *, cos_slope: Tensor) -> Tensor:
    """Two-bounce BRDF of unit-albedo facets of one slope vector u, light arriving by the facet -u; args u.p, u.q, C
    (...). [1/sr]
    """
    sin_squared = (1 - cos_slope) * (1 + cos_slope)
    return (
        cos_slope
        * sin_squared
        * two_bounce_integrand(-light_projection, view_projection, cos_slope=cos_slope)
        / math.pi
    )


def _shortcut(x: Tensor, y: Tensor, cos_slope: Tensor) -> Tensor:
    """delta(x, y) = x + y - d(x, y): by how much the straight line beats the way through the valley."""
    total = x + y
    distance = safe_sqrt(total * total * cos_slope * cos_slope + (x - y) ** 2 * (1 - cos_slope) * (1 + cos_slope))
    numerator = 4 * x * y * (1 - cos_slope) * (1 + cos_slope)
    return safe_divide(numerator, total + distance, where=total > 0)
