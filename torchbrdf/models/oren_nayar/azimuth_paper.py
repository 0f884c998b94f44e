"""The paper's closed azimuth means of one slope angle: exact in and across the plane of incidence, interpolated in
between.

Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), eqs. (39)-(45), (48), (49). Their own rung of the ladder; the exact means are in
    `azimuth`.
"""

import math

import torch
from torch import Tensor

from torchbrdf._numerics import positive_part, safe_divide, safe_sqrt
from torchbrdf.models.oren_nayar.azimuth import Lobes, saturated_lobes
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane


def direct_mean_paper(plane: SlopePlane, *, cos_slope: Tensor, tan_slope: Tensor) -> Tensor:
    r"""Direct BRDF of one slope angle, unit albedo, Oren & Nayar 1994, eqs. (24), (45) (...). [1/sr]

    .. math:: \frac{1}{\pi}\cos\theta_a\{1 + \cos\Delta\,(A_1\tan\beta + A_2) + (1-|\cos\Delta|)A_3\}
    """
    lobes = saturated_lobes(plane, cos_slope=cos_slope, tan_slope=tan_slope)
    cos_delta = _cos_delta(plane)
    # The steeper direction alpha enters A1 times tan(beta); cos(delta) tan(beta) tan(alpha) = p.q is smooth at the
    # normal, so it is split off.
    steep, half_steep, half_flat = _ordered(lobes)
    in_plane = _in_plane(plane, steep, half_steep, lobes)
    away = positive_part(-cos_delta)
    forward = (2 / math.pi) * (half_flat - _flat(lobes) * half_flat.sin()) * away
    return cos_slope * (1 + in_plane - forward + (1 - cos_delta.abs()) * _across(plane, lobes)) / math.pi


def two_bounce_mean_paper(plane: SlopePlane, *, cos_slope: Tensor, tan_slope: Tensor) -> Tensor:
    """Two-bounce BRDF of one slope angle, unit albedo, Oren & Nayar 1994, eq. (49): their exchange (48) averaged in and
    across the plane, cosine in between (...). [1/sr]
    """
    lobes = saturated_lobes(plane, cos_slope=cos_slope, tan_slope=tan_slope)
    steep, half_steep, half_flat = _ordered(lobes)
    bracket = _in_plane(plane, steep, half_steep, lobes)
    bracket = bracket + (2 / math.pi) * (half_flat - _flat(lobes) * half_flat.sin()) * _cos_delta(plane)
    return cos_slope * (1 - cos_slope) * (1 - bracket) / math.pi


def _in_plane(plane: SlopePlane, steep: Tensor, half_steep: Tensor, lobes: Lobes) -> Tensor:
    """cos(delta) A1 tan(beta): (T^2 p.q) [ (2/pi) sin f / (T tan(alpha)) + 1/2 - f/pi - sin(2f)/(2 pi) ] with f that of
    alpha.
    """
    shadow = safe_divide(half_steep.sin(), steep, where=steep > 1)
    clear = 0.5 - (half_steep + half_steep.sin() * half_steep.cos()) / math.pi
    return lobes.tan_slope * lobes.tan_slope * plane.dot * ((2 / math.pi) * shadow + clear)


def _across(plane: SlopePlane, lobes: Lobes) -> Tensor:
    """A3 of Oren & Nayar 1994, eq. (45): what masking and shadowing share across the plane, once f_A + f_B passes
    pi/2.
    """
    excess = lobes.half_light + lobes.half_view - 0.5 * math.pi
    roots = _half_tangent(lobes.light) + _half_tangent(lobes.view)
    hypotenuse = lobes.tan_slope * safe_sqrt(plane.tan_light * plane.tan_light + plane.tan_view * plane.tan_view)
    return torch.where(excess > 0, (roots - hypotenuse - excess) / math.pi, 0.0)


def _half_tangent(projection: Tensor) -> Tensor:
    """sqrt(A^2 - 1) = tan f_A, 0 for A <= 1."""
    return safe_sqrt((projection - 1) * (projection + 1))


def _ordered(lobes: Lobes) -> tuple[Tensor, Tensor, Tensor]:
    """T tan(alpha), f_alpha, f_beta; alpha the larger and beta the smaller of the two polar angles."""
    steep = torch.maximum(lobes.light, lobes.view)
    return steep, torch.maximum(lobes.half_light, lobes.half_view), torch.minimum(lobes.half_light, lobes.half_view)


def _flat(lobes: Lobes) -> Tensor:
    return torch.minimum(lobes.light, lobes.view)


def _cos_delta(plane: SlopePlane) -> Tensor:
    """cos(delta), 0 (with no derivative) when light or view stands at the normal: there every term it multiplies is
    0.
    """
    product = plane.tan_light * plane.tan_view
    return safe_divide(plane.dot, product, where=product > 0)
