r"""Azimuth means of interreflected light over facets of one slope angle: closed form of an approximation plus a
correction by quadrature.

Exact exchange, Oren & Nayar 1994, eq. (19), and the mean of the approximate one, their eq. (48), differ only where a
facet is shadowed or masked. With z the light's and b the view's projection and c(.) the clamp to [-1, 1], the exact
exchange is
    (1 + c(z))(1 + c(b))/(1 + C)        whose mean is closed form,
    + (1 + c(b)) e(z) + (1 + c(z)) e(b)     e(z) = 1/P(z) - 1/(1 + C) on the lobe z > 1, 0 elsewhere: "one is cut",
    + M(z, b)                               on the overlap z > 1, b > 1: "both are cut".
The quadrature runs over pieces on which every integrand is analytic *and bounded*: the part of each lobe on which the
other direction is neither cut nor turned away, and the overlap of the lobes, on either side of the azimuth at which
z = b. So rounding and quadrature stay in proportion to what there is at any angle up to the horizon. The same lobe on
the opposite facet needs no nodes of its own: there the other projection is -b. Own derivation from
Oren & Nayar 1994, eq. (19); see `interreflection` for the source and `two_bounce_integrand` there for the notation.

Nodes are a dimension before the last: (..., node, pixel), so that every operation runs along pixels.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import safe_divide
from torchbrdf.models.oren_nayar.azimuth import Lobes, overlap
from torchbrdf.models.oren_nayar.cavity_modes import CavityModes, strip_means
from torchbrdf.models.oren_nayar.interreflection import reach, strip_mismatch
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane
from torchbrdf.quadrature import gauss_legendre


class OneCut(NamedTuple):
    """Nodes at which one direction is cut and the other is not, for both directions; (..., node, pixel)."""

    cut: Tensor  # projection >= 1 of the direction that is cut [-]
    free: Tensor  # projection of the other one on the same facet, -free on the opposite one [-]
    weight: Tensor  # d psi / (2 pi) [-]


class BothCut(NamedTuple):
    """Nodes at which both directions are cut; (..., node, pixel)."""

    light: Tensor  # projection a = A cos(psi) >= 1 [-]
    view: Tensor  # projection b = B cos(psi - angle) >= 1 [-]
    weight: Tensor  # d psi / (2 pi); 0 where the lobes miss each other [-]


def one_cut(plane: SlopePlane, lobes: Lobes, order: int, *, graded: bool = False) -> OneCut:
    """Nodes on the lobes less what the other direction's lobes hold: 4 pieces of `order` nodes.

    With delta the angle from the middle of a zone in which the other direction is free, its projection is B sin(delta),
    with all digits in the narrow zones of grazing light, and that of the cut one A sin(delta +- azimuth).
    A direction that is nowhere cut is free everywhere and enters linearly: its mean over both halves of the lobe is
    p.q/|p|^2 times the other projection, which is smooth where that direction is the normal and has no azimuth.
    """
    near = plane.delta <= 0.5 * math.pi
    folded, sign = torch.where(near, plane.delta, math.pi - plane.delta), torch.where(near, 1.0, -1.0)
    rims, starts, ends, offsets, cuts, frees, slants, doubled = [], [], [], [], [], [], [], []
    for half, rim, cut, tangent, zone, free in (
        (lobes.half_light, lobes.clear_light, lobes.light, plane.tan_light, lobes.clear_view, lobes.view),
        (lobes.half_view, lobes.clear_view, lobes.view, plane.tan_view, lobes.clear_light, lobes.light),
    ):
        bounded = free > 1
        slant = safe_divide(plane.dot, tangent * tangent, where=half > 0)
        middle = 0.5 * (rim + 0.5 * math.pi)
        for low, high, offset, half_lobe in (
            (torch.maximum(-zone, rim - folded), torch.minimum(zone, math.pi - rim - folded), folded, (rim, middle)),
            (rim + folded, zone, -folded, (middle, torch.full_like(rim, 0.5 * math.pi))),
        ):
            start, end = (torch.where(bounded, *ends_of) for ends_of in ((low, half_lobe[0]), (high, half_lobe[1])))
            rims.append(rim)
            starts.append(start)
            ends.append(torch.where(half > 0, torch.maximum(start, end), start))
            offsets.append(torch.where(bounded, offset, 0.0))
            cuts.append(cut)
            frees.append(torch.where(bounded, sign * free, 0.0))
            slants.append(torch.where(bounded, 0.0, slant))
            doubled.append(torch.where(bounded, 1.0, 2.0))
    rim, start, end, offset, scale, free, slant, double = (
        torch.stack(torch.broadcast_tensors(*t), -2)[..., None, :]
        for t in (rims, starts, ends, offsets, cuts, frees, slants, doubled)
    )
    delta, step = _graded_piece(start, end, offset, rim, order) if graded else _piece(start, end, order)
    # Inside a lobe the projection exceeds 1; the clamp serves rounding and lobes that do not exist, whose weight is 0.
    cut = (scale * (delta + offset).sin()).clamp(min=1)
    nodes = (cut, free * delta.sin() + slant * cut, double * step / (2 * math.pi))
    return OneCut(*(t.flatten(-3, -2) for t in nodes))


def _column(numbers: Tensor) -> Tensor:
    return numbers[:, None]


def _piece(start: Tensor, end: Tensor, order: int) -> tuple[Tensor, Tensor]:
    """Nodes and weights of pieces (..., 1, pixel); (..., order, pixel)."""
    x, weight = (_column(t) for t in gauss_legendre(order, start))
    length = end - start
    return start + length * x, length * weight


def _graded_piece(start: Tensor, end: Tensor, offset: Tensor, rim: Tensor, order: int) -> tuple[Tensor, Tensor]:
    """As `_piece`, dense towards both rims: `order` nodes on either side of the middle (..., 2 order, pixel).

    In w = log tan(u/2), u = delta + offset, the projection is A/cosh(w), and the square roots of the integrand vanish
    no nearer than |Im w| = pi/2, at any angle.
    """
    x, weight = (_column(t) for t in gauss_legendre(order, start))
    # u is no less than the rim: rounding would take it to 0 on a slope of 90 degrees
    low, high = ((0.5 * torch.maximum(edge + offset, rim)).tan().log() for edge in (start, end))
    middle = torch.minimum(torch.maximum(torch.zeros_like(low), low), high)
    w = torch.cat((low + (middle - low) * x, middle + (high - middle) * x), -2)
    share = torch.cat(((middle - low) * weight, (high - middle) * weight), -2)
    return 2 * w.exp().atan() - offset, share / w.cosh()


def both_cut(lobes: Lobes, angle: Tensor, order: int, *, crossing: Tensor | None = None) -> BothCut:
    """Nodes on the overlap of lobes that are `angle` apart: `order` of them, or as many on each side of `crossing`,
    where an integrand has almost a kink on steep slopes, dense at both ends of each side.
    """
    low, high = overlap(lobes, angle)
    if crossing is None:
        return _overlap_at(lobes, angle, *_piece(low[..., None, :], high[..., None, :], order))
    turn = torch.minimum(torch.maximum(crossing, low), high)
    x, share = (_column(t) for t in gauss_legendre(order, low))
    share, x = 6 * x * (1 - x) * share, x * x * (3 - 2 * x)  # a cubic with flat ends
    start, length = (torch.stack(pair, -2)[..., None, :] for pair in ((low, turn), (turn - low, high - turn)))
    psi, weight = start + length * x, length * share
    return _overlap_at(lobes, angle, psi.flatten(-3, -2), weight.flatten(-3, -2))


def _overlap_at(lobes: Lobes, angle: Tensor, psi: Tensor, weight: Tensor) -> BothCut:
    light = (lobes.light[..., None, :] * psi.cos()).clamp(min=1)
    view = (lobes.view[..., None, :] * (psi - angle[..., None, :]).cos()).clamp(min=1)
    return BothCut(light, view, weight / (2 * math.pi))


def both_cut_graded(
    plane: SlopePlane, lobes: Lobes, angle: Tensor, order: int, *, crossing: Tensor, distance: Tensor
) -> BothCut:
    """The reference's nodes on the overlap, 4 order of them: from each rim and from each side of `crossing`, graded to
    the distance of the nearest singularity; `distance` of the two points of the slope plane.
    """
    low, high = overlap(lobes, angle)
    x, weight = (_column(t) for t in gauss_legendre(order, low))
    scale = _root_scale(plane, lobes)
    turn = torch.minimum(torch.maximum(crossing, low), high)
    slope = lobes.tan_slope * distance
    height = (lobes.light * turn.cos()).clamp(min=1)
    # where the nodes lie is no concern of the derivative, and beside p = q it would be any number
    bend = safe_divide(lobes.cos_slope * (height - 1) * (height + 1), slope, where=slope > 0).detach()
    bend = bend.masked_fill(slope <= 0, math.inf)  # projections that are one do not cross
    starts, sides, lengths, widths = [], [], [], []
    for end, sign, length in ((low, 1.0, 0.5 * (turn - low)), (high, -1.0, 0.5 * (high - turn))):
        starts += [end, turn]
        sides += [sign, -sign]
        lengths += [length, length]
        widths += [scale, torch.minimum(torch.maximum(bend, 1e-3 * length), scale)]
    start, length, width = (
        torch.stack(torch.broadcast_tensors(*t), -2)[..., None, :] for t in (starts, lengths, widths)
    )
    side = length.new_tensor(sides)[:, None, None]
    # scale * sinh(w), w uniform
    width = torch.where(length > 0, width, 1.0)
    stop = torch.asinh(length / width)
    psi, step = start + side * width * torch.sinh(stop * x), width * stop * weight * torch.cosh(stop * x)
    return _overlap_at(lobes, angle, psi.flatten(-3, -2), step.flatten(-3, -2))


def _root_scale(plane: SlopePlane, lobes: Lobes) -> Tensor:
    """Distance from a lobe's rim to the nearest complex zero of the square roots, 1/(sin(theta_a) tan(theta)) for the
    steeper direction. [rad]
    """
    sine = lobes.tan_slope * lobes.cos_slope
    steepest = sine * torch.maximum(plane.tan_light, plane.tan_view)
    return safe_divide(torch.ones_like(steepest), steepest, where=steepest > 0)


def two_bounce_mean(
    plane: SlopePlane,
    lobes: Lobes,
    correlation: Tensor,
    *,
    order: int,
    graded: bool = False,
    one: OneCut | None = None,
) -> Tensor:
    r"""Azimuth mean of the exact two-bounce BRDF of one slope angle, unit albedo.

    .. math:: i(\theta_a) = \frac1\pi\,C\,\{(1-C)(1-\overline{c(a)c(b)}) + S^2[\bar e + \bar M]\}

    e: one direction cut; M: both cut, facing each other.

    Args:
        plane, lobes: (..., pixel), see `azimuth.saturated_lobes`.
        correlation: CC (..., pixel) of the same lobes. [-]
        order: nodes on each piece where one direction is cut, twice as many where both are; 3 serves pictures.
        graded: for the reference: nodes graded to where the integrand turns; 16 nodes then serve 1e-9.
        one: `one_cut` of the same arguments, where two bounces and more share it.
    Returns: (..., pixel). [1/sr]
    """
    c = lobes.cos_slope
    wide = c[..., None, :]
    if one is None:
        one = one_cut(plane, lobes, order, graded=graded)
    single = (one.weight * (1 - one.free) * one_cut_share(one.cut, wide)).sum(-2)
    both = _facing(plane, lobes, order, graded)
    paired = (both.weight * _both_cut_share(both.light, both.view, wide)).sum(-2)
    return c * ((1 - c) * (1 - correlation) + (1 - c) * (1 + c) * (single + paired)) / math.pi


def _facing(plane: SlopePlane, lobes: Lobes, order: int, graded: bool) -> BothCut:
    across = math.pi - plane.delta
    if graded:
        return both_cut_graded(plane, lobes, across, order, crossing=plane.opposite_crossing, distance=plane.opposed)
    return both_cut(lobes, across, 2 * order, crossing=plane.opposite_crossing)


def one_cut_share(z: Tensor, cos_slope: Tensor) -> Tensor:
    """e(z) = 1/P(z) - 1/(1+C) for z >= 1 (...): what Oren & Nayar 1994, eq. (48), overrates when the light alone is
    cut. [-]
    """
    return 1 / reach(z, cos_slope) - 1 / (1 + cos_slope)


def _both_cut_share(z: Tensor, b: Tensor, cos_slope: Tensor) -> Tensor:
    """Exact exchange less that of Oren & Nayar 1994, eq. (48), where both are cut. [-]"""
    exchange = (1 + b) / reach(z, cos_slope) + (1 + z) / reach(b, cos_slope)
    return exchange - strip_mismatch(z, b, cos_slope) - 4 / (1 + cos_slope)


def higher_bounce_means(
    plane: SlopePlane,
    lobes: Lobes,
    correlation: Tensor,
    modes: CavityModes,
    *,
    order: int,
    graded: bool = False,
    one: OneCut | None = None,
) -> Tensor:
    r"""Geometry side of three and more bounces: azimuth means over the modes of each slope, (1/pi) C times mean of xi_n
    xi_n.

    A facet met with projection z couples to mode n by xi_n(z) = (1 + c(z)) G_n(s(z)), s = 1 uncut and 2/(1 + z) cut. So
    the mean is G_n(1)^2 times the closed form of `saturated_correlation`, and the pieces of two bounces serve the rest.

    Args: plane, lobes, correlation (..., K, pixel), modes of the same K slopes; `order` nodes on each piece, `graded`
        and `one` as in `two_bounce_mean`.
    Returns: (..., K, N, 2, pixel), last but one axis (same facet lit, opposite facet lit); contract with
        `cavity_modes.bounce_coefficients`. [1/sr]
    """
    whole = strip_means(modes, torch.ones_like(modes.cos_slope)[:, None])  # G_n(1), (K, N, 1)
    if one is None:
        one = one_cut(plane, lobes, order, graded=graded)
    change = one.weight[..., None, :, :] * (_couplings(modes, one.cut) - whole[..., None])
    even, odd = change.sum(-2), (one.free[..., None, :, :] * change).sum(-2)
    means = []
    for sign, angle, crossing, distance in (
        (1, plane.delta, plane.crossing, plane.apart),
        (-1, math.pi - plane.delta, plane.opposite_crossing, plane.opposed),
    ):
        if graded:
            both = both_cut_graded(plane, lobes, angle, order, crossing=crossing, distance=distance)
        else:
            both = both_cut(lobes, angle, order)
        pair = _couplings(modes, both.light) * _couplings(modes, both.view)
        paired = (both.weight[..., None, :, :] * (pair - (whole * whole)[..., None])).sum(-2)
        flat = whole * (1 + sign * correlation)[..., None, :]
        means.append(whole * (flat + 2 * (even + sign * odd)) + 4 * paired)
    return (lobes.cos_slope / math.pi)[..., None, None, :] * torch.stack(means, dim=-2)


def _couplings(modes: CavityModes, z: Tensor) -> Tensor:
    """G_n(2/(1+z)) at projections z >= 1 (..., K, node, pixel); result (..., K, N, node, pixel)."""
    shape = z.shape[-2:]
    return strip_means(modes, (2 / (1 + z)).flatten(-2)).unflatten(-1, shape)
