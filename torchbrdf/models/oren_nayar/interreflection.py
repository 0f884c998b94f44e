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

from torch import Tensor

from torchbrdf._numerics import safe_divide, safe_sqrt


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
