"""Masking and shadowing of one facet by its neighbour in a symmetric V-cavity.

The assumption "cavities are symmetric V-grooves with Lambertian facets" enters the package here (which strip is lit,
which is visible) and in `interreflection` (how the strips exchange light) and nowhere else.
Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), section 3 and eqs. (33)-(38), with the nesting of (38) repaired: lit and visible
    strip both end at the ridge, so their overlap is the *smaller* of the two.
"""

import math

import torch
from torch import Tensor

from torchbrdf._numerics import safe_divide


def mirror_attenuation(cos_facet_light: Tensor, *, cos_alpha: Tensor, cos_facet: Tensor) -> Tensor:
    """Part of a facet's width that is lit and visible at once, where it mirrors light into view (...). [-] in (0, 1]

    Lit is clamp(2 <s,n><a,n> / <s,a>), and so is visible with v for s; <s,a> and <v,a> are the same here.

    Args:
        cos_facet_light: <s,a> = <v,a>, facet normal and source (...). [-] > 0
        cos_alpha: the smaller of <s,n> and <v,n> (...). [-] > 0
        cos_facet: <a,n> (...). [-] > 0
    Source: Oren & Nayar 1994, eqs. (35) and (38) repaired.
    """
    return (2 * cos_facet * cos_alpha / cos_facet_light).clamp(max=1.0)


def strip_fraction(projection: Tensor) -> Tensor:
    """Part of a facet's width that is lit, in the slope plane: clamp(2 / X) with X = 1 + projection, projection = u.p
    (...); 0 for X <= 0. [-]
    """
    facing = 1 + projection
    return safe_divide(torch.full_like(facing, 2.0), facing, where=facing > 0).clamp(0, 1)


def direct_integrand(light_projection: Tensor, view_projection: Tensor) -> Tensor:
    r"""GAF times both foreshortenings, min(X Y, 2X, 2Y) for X, Y > 0, else 0; no division, hence no guard.

    Args: u.p and u.q (...). [-]
    Returns: (...). [-] The direct BRDF of facets with slope u is (rho/pi) cos(theta_a) times this.
    Source: Oren & Nayar 1994, eqs. (10), (38) and Table 1, in the slope plane.
    """
    x = (1 + light_projection).clamp(min=0)
    y = (1 + view_projection).clamp(min=0)
    return torch.minimum(x * y, 2 * torch.minimum(x, y))


def direct_facet(light_projection: Tensor, view_projection: Tensor, *, cos_slope: Tensor) -> Tensor:
    """Direct BRDF of unit-albedo facets of one slope vector: (1/pi) cos(theta_a) min(XY, 2X, 2Y) (...). [1/sr]"""
    return cos_slope * direct_integrand(light_projection, view_projection) / math.pi
