r"""Azimuth means over all facets of one slope angle: an isotropic surface made of equal cavities. Direct light, exact
and closed.

In the slope plane a = u.p = A cos(psi), b = u.q = B cos(psi - delta) with A = tan(theta_a) tan(theta_i), B =
tan(theta_a) tan(theta_r). All that is not smooth happens on the lobes a > 1 (half width f_A = arcsec A) and b > 1 (f_B)
and on their overlap [low, high].
Source: own derivation in `docs/equations/oren_nayar.md`, section 5a; the closed forms of Oren & Nayar 1994 (DOI
    10.1145/192161.192213, numbered as in its long version), section 5b there, are in `azimuth_paper`.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import arccsc, arcsec
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane


class Lobes(NamedTuple):
    """Where facets of one slope angle saturate. Every field broadcasts the plane (...) with the slope."""

    cos_slope: Tensor  # C = cos(theta_a) [-]
    tan_slope: Tensor  # T = tan(theta_a) [-]
    light: Tensor  # A [-]
    view: Tensor  # B [-]
    half_light: Tensor  # f_A [rad] in [0, pi/2)
    half_view: Tensor  # f_B [rad] in [0, pi/2)
    clear_light: (
        Tensor  # pi/2 - f_A with all its digits: half width of the zone that is neither cut nor turned away [rad]
    )
    clear_view: Tensor  # pi/2 - f_B [rad]


def saturated_lobes(plane: SlopePlane, *, cos_slope: Tensor, tan_slope: Tensor) -> Lobes:
    """A, B and the critical angles f_A, f_B of Oren & Nayar 1994, eq. (39), 0 where nothing saturates. The slope
    broadcasts with the plane.
    """
    light, view = tan_slope * plane.tan_light, tan_slope * plane.tan_view
    return Lobes(cos_slope, tan_slope, light, view, arcsec(light), arcsec(view), arccsc(light), arccsc(view))


def overlap(lobes: Lobes, angle: Tensor) -> tuple[Tensor, Tensor]:
    """Azimuths low <= high at which both lobes hold, the view's lobe centred at `angle` in [0, pi]; equal where they
    miss. [rad]
    """
    low = torch.maximum(-lobes.half_light, angle - lobes.half_view)
    return low, torch.maximum(low, torch.minimum(lobes.half_light, angle + lobes.half_view))


def saturated_correlation(plane: SlopePlane, lobes: Lobes) -> Tensor:
    """Azimuth mean of c(a) c(b), c(z) = clamp(z, -1, 1): CC of the module's source (...). [-] in [-1, 1]

    The source adds terms of size A B that cancel on steep slopes at grazing angles. Here the part proportional to A B
    cos(delta) is summed beforehand, and everything is written in the clear zones pi/2 - f, which are what remains
    small.
    """
    across = math.pi - plane.delta
    same, opposite = _meeting(plane.delta, across, lobes), _meeting(across, plane.delta, lobes)
    rims = 0.5 * ((2 * lobes.clear_light).sin() + (2 * lobes.clear_view).sin())
    # A B cos(delta) = T^2 p.q is read from `dot`: smooth at normal incidence, where the azimuth itself means nothing.
    clear = lobes.tan_slope * lobes.tan_slope * plane.dot * (0.5 * (same.surplus + opposite.surplus) + rims) / math.pi
    return clear + _overlap_excess(plane.delta, lobes, same) - _overlap_excess(across, lobes, opposite)


def common_excess(plane: SlopePlane, lobes: Lobes) -> Tensor:
    """Azimuth mean of 2 (min(a, b) - 1)+: what the overlap of masking and shadowing gives back; m of the module's
    source (...). [-]
    """
    low, high = overlap(lobes, plane.delta)
    start, end = (low - plane.delta).sin(), high.sin()
    # The shadow edge rules before the crossing, the mask edge after it, one of them alone where it lies outside. At the
    # crossing A sin(psi) - B sin(psi - delta) is T |p - q|, which is written so because there the crossing itself has
    # no derivative that rounding would respect.
    shadowed, masked = lobes.view * ((high - plane.delta).sin() - start), lobes.light * (end - low.sin())
    both = lobes.light * end - lobes.view * start - lobes.tan_slope * plane.apart
    smaller = torch.where(plane.crossing >= high, shadowed, torch.where(plane.crossing <= low, masked, both))
    return (smaller - (high - low)) / math.pi


def direct_mean(plane: SlopePlane, *, cos_slope: Tensor, tan_slope: Tensor) -> Tensor:
    r"""Exact direct BRDF of isotropic cavities of one slope angle, unit albedo, any azimuth.

    .. math:: d(\theta_a) = \frac1\pi \cos\theta_a\,\bigl[1 + \overline{c(a)c(b)} + 2\,\overline{(\min(a,b)-1)_+}\bigr]

    Args: the plane (...) and cos, tan of the slope angle, broadcastable with it. [-]
    Returns: (...). [1/sr] Not masked at the horizon.
    Source: `docs/equations/oren_nayar.md`, section 5a (own derivation; Oren & Nayar 1994, eqs. (40)-(45), give only
        delta = 0, pi/2, pi and an interpolation).
    """
    lobes = saturated_lobes(plane, cos_slope=cos_slope, tan_slope=tan_slope)
    return direct_from(common_excess(plane, lobes), saturated_correlation(plane, lobes), cos_slope)


def direct_from(excess: Tensor, correlation: Tensor, cos_slope: Tensor) -> Tensor:
    """(1/pi) C (1 + CC + m): the direct mean from its two parts (...). [1/sr]"""
    return cos_slope * (1 + correlation + excess) / math.pi


def two_bounce_mean_approximate(plane: SlopePlane, *, cos_slope: Tensor, tan_slope: Tensor) -> Tensor:
    """Exact azimuth mean of an approximate exchange: (1/pi) C (1 - C)(1 - CC) (...). [1/sr]

    Source: exchange: Oren & Nayar 1994, eq. (48); mean: `docs/equations/oren_nayar.md`, section 5a.
    """
    lobes = saturated_lobes(plane, cos_slope=cos_slope, tan_slope=tan_slope)
    return cos_slope * (1 - cos_slope) * (1 - saturated_correlation(plane, lobes)) / math.pi


class _Meeting(NamedTuple):
    """How two lobes lie to each other.

    Decided once for all that depends on it: the parts have kinks where one lobe starts to miss or to hold the other
    (at the mirror direction both at once), which cancel in the sum only if rounding puts all on one side.
    """

    missed: Tensor  # whether they have no azimuth in common
    half_gap: Tensor  # half of pi less the width of the overlap [rad]
    middle: Tensor  # azimuth of the middle of the overlap, from that of the light's lobe [rad]
    surplus: Tensor  # angle + clear_light + clear_view - gap, the latter at most pi [rad]


def _meeting(angle: Tensor, complement: Tensor, lobes: Lobes) -> _Meeting:
    """Lobes `angle` = pi - `complement` apart, both in [0, pi]."""
    light, view = lobes.clear_light, lobes.clear_view
    total, spread = light + view, (light - view).abs()
    # An empty lobe is missed at every angle: next to the normal rounding may not decide otherwise, as the derivative of
    # the azimuth grows without bound there.
    missed = (complement <= total) | (torch.minimum(lobes.half_light, lobes.half_view) <= 0)
    nested = angle < spread
    half_gap = torch.where(nested, torch.maximum(light, view), 0.5 * (total + angle))
    middle = torch.where(nested, torch.where(light > view, 0.0, angle), 0.5 * (view - light + angle))
    surplus = torch.where(missed, total - complement, torch.where(nested, angle - spread, 0.0))
    return _Meeting(missed, half_gap, middle, surplus)


def _overlap_excess(angle: Tensor, lobes: Lobes, meeting: _Meeting) -> Tensor:
    """(1/pi) times the integral of (a - 1)(b - 1), less that of (1/2) A B cos(angle), over the overlap of lobes `angle`
    apart.
    """
    a, b = lobes.light, lobes.view
    missed, half_gap, middle, _ = meeting
    half_chord = half_gap.cos()
    product = a * b * (2 * middle - angle).cos() * half_gap.sin() * half_chord
    singles = 2 * half_chord * (a * middle.cos() + b * (middle - angle).cos())
    return torch.where(missed, 0.0, product - singles + math.pi - 2 * half_gap) / math.pi
