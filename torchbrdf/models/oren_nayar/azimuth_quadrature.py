r"""Azimuth means of interreflected light over facets of one slope angle: closed form of an approximation plus a small
correction by quadrature.

Exact exchange, Oren & Nayar 1994, eq. (19), and the mean of the approximate one, their eq. (48), differ only where a
facet is shadowed or masked. With z the light's and b the view's
projection, the difference is a sum of
    (1 + c(b)) e(z) + (1 + c(z)) e(b)     e(z) <= 0 on the lobe z > 1, 0 elsewhere: "one direction is cut",
    M(z, b)                               on the overlap z > 1, b > 1: "both are cut",
so the quadrature runs over two half lobes and over the two overlaps of the lobes, on which every integrand is analytic;
nodes never straddle a kink and lobes that do not exist have zero width. Own derivation from
Oren & Nayar 1994, eq. (19); see `interreflection` for the source and `two_bounce_integrand` there for the notation.
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


class Overlap(NamedTuple):
    """Nodes on the azimuths where both lobes hold; (..., node)."""

    light: Tensor  # a = A cos(psi) >= 1 [-]
    view: Tensor  # b = B cos(psi - angle) >= 1 [-]
    weight: Tensor  # d psi / (2 pi); 0 where the lobes miss each other


def half_lobe(half: Tensor, projection: Tensor, order: int, *, scale: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """Nodes on one lobe: projections A cos(psi) >= 1 and weights for the azimuth mean over the whole lobe, each (...,
    order).

    Integrands are analytic but for square roots that vanish at a distance `scale` [rad] beyond the rim. Pictures do
    with nodes that thicken towards the rim; the reference passes the scale, and a sinh substitution moves the roots
    away.
    """
    x, weight = gauss_legendre(order, half)
    if scale is None:
        inward, step = half[..., None] * (1 - x) ** 2, half[..., None] * 2 * (1 - x) * weight
    else:
        inward, step = _sinh_piece(half, scale, x, weight)
    # Inside a lobe the projection exceeds 1; the clamp serves lobes that do not exist, whose weight is 0.
    return (projection[..., None] * (half[..., None] - inward).cos()).clamp(min=1), step / math.pi


def overlap_nodes(
    lobes: Lobes,
    angle: Tensor,
    order: int,
    *,
    crossing: Tensor | None = None,
    distance: Tensor | None = None,
    scale: Tensor | None = None,
) -> Overlap:
    """Nodes on the overlap of lobes that are `angle` apart, (..., order).

    With `crossing`, `distance` (of the two points of the slope plane) and `scale` (the reference) in four graded
    pieces, (..., 4 order): dense at the rims and where the two projections cross, which is almost a kink on steep
    slopes.
    """
    low, high = overlap(lobes, angle)
    x, weight = gauss_legendre(order, low)
    if crossing is None or distance is None or scale is None:
        psi = low[..., None] + (high - low)[..., None] * x
        weights = (high - low)[..., None] * weight
    else:
        turn = torch.minimum(torch.maximum(crossing, low), high)
        slope = lobes.tan_slope * distance
        height = (lobes.light * turn.cos()).clamp(min=1)
        # where the nodes lie is no concern of the derivative, and beside p = q it would be any number
        bend = safe_divide(lobes.cos_slope * (height - 1) * (height + 1), slope, where=slope > 0).detach()
        bend = bend.masked_fill(slope <= 0, math.inf)  # projections that are one do not cross
        pieces = []
        for end, sign, length in ((low, 1, 0.5 * (turn - low)), (high, -1, 0.5 * (high - turn))):
            for start, side, width in (
                (end, sign, scale),
                (turn, -sign, torch.minimum(torch.maximum(bend, 1e-3 * length), scale)),
            ):
                offset, step = _sinh_piece(length, width, x, weight)
                pieces.append((start[..., None] + side * offset, step))
        psi, weights = (torch.cat(part, dim=-1) for part in zip(*pieces, strict=True))
    light = (lobes.light[..., None] * psi.cos()).clamp(min=1)
    view = (lobes.view[..., None] * (psi - angle[..., None]).cos()).clamp(min=1)
    return Overlap(light, view, weights / (2 * math.pi))


def _sinh_piece(length: Tensor, scale: Tensor, x: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Offsets in [0, length] and weights, dense within `scale` of 0: scale * sinh(w), w uniform; (..., order)."""
    scale = torch.broadcast_to(torch.where(length > 0, scale, 1.0), length.shape)
    stop = torch.asinh(length / scale)[..., None]
    scale = scale[..., None]
    return scale * torch.sinh(stop * x), scale * stop * weight * torch.cosh(stop * x)


def root_scale(plane: SlopePlane, lobes: Lobes) -> Tensor:
    """Distance from a lobe's rim to the nearest complex zero of the square roots, 1/(sin(theta_a) tan(theta)) for the
    steeper direction. [rad]
    """
    sine = lobes.tan_slope * lobes.cos_slope
    steepest = sine * torch.maximum(plane.tan_light, plane.tan_view)
    return safe_divide(torch.ones_like(steepest), steepest, where=steepest > 0)


def two_bounce_mean(
    plane: SlopePlane, lobes: Lobes, correlation: Tensor, *, order: int, graded: bool = False
) -> Tensor:
    r"""Azimuth mean of the exact two-bounce BRDF of one slope angle, unit albedo.

    .. math:: i(\theta_a) = \frac1\pi\,C\,\{(1-C)(1-\overline{c(a)c(b)}) + S^2[\bar e_i + \bar e_r + \bar M + \bar N]\}

    e_i, e_r: one direction cut; M: both cut, facing each other; N: what e counted where one facet is seen and the other
        one lit.

    Args:
        plane, lobes: (...), see `azimuth.saturated_lobes`.
        correlation: CC (...) of the same lobes. [-]
        order: nodes on each piece; 4 serves pictures.
        graded: for the reference: pieces split and nodes graded to where the integrand turns; 16 nodes then serve 1e-9.
    Returns: (...). [1/sr]
    """
    c = lobes.cos_slope
    scale = root_scale(plane, lobes) if graded else None
    near, far = _graded(plane, graded)
    one_cut = _lobe_mean(plane, lobes, order, scale)
    facing = overlap_nodes(lobes, math.pi - plane.delta, order, scale=scale, **far)
    both_cut = (facing.weight * _both_cut(facing.light, facing.view, c[..., None])).sum(-1)
    same = overlap_nodes(lobes, plane.delta, order, scale=scale, **near)
    rim = (same.view - 1) * one_cut_share(same.light, c[..., None]) + (same.light - 1) * one_cut_share(
        same.view, c[..., None]
    )
    missed = (same.weight * rim).sum(-1)
    sin_squared = (1 - c) * (1 + c)
    correction = sin_squared * (one_cut + both_cut + missed)
    return c * ((1 - c) * (1 - correlation) + correction) / math.pi


def _graded(plane: SlopePlane, graded: bool) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Where the projections on one facet, and on two opposite ones, cross: what `overlap_nodes` grades its nodes by."""
    if not graded:
        return {}, {}
    return (
        {"crossing": plane.crossing, "distance": plane.apart},
        {"crossing": plane.opposite_crossing, "distance": plane.opposed},
    )


def one_cut_share(z: Tensor, cos_slope: Tensor) -> Tensor:
    """e(z) / S^2 = 1/P(z) - 1/(1+C) for z >= 1 (...): what Oren & Nayar 1994, eq. (48), overrates
    when the light alone is cut. [-]
    """
    return 1 / reach(z, cos_slope) - 1 / (1 + cos_slope)


def _lobe_mean(plane: SlopePlane, lobes: Lobes, order: int, scale: Tensor | None) -> Tensor:
    """Mean of (1 + b) e(z) over the lobe z > 1 plus its mirror, over S^2, as if b were not clamped there (...)."""
    total = torch.zeros_like(lobes.light)
    for half, projection, tangent in (
        (lobes.half_light, lobes.light, plane.tan_light),
        (lobes.half_view, lobes.view, plane.tan_view),
    ):
        z, weight = half_lobe(half, projection, order, scale=scale)
        share = weight * one_cut_share(z, lobes.cos_slope[..., None])
        # b = -(p.q / |p|^2) z + an odd part that averages out
        slant = safe_divide(plane.dot, tangent * tangent, where=half > 0)
        total = total + torch.where(half > 0, share.sum(-1) - slant * (share * z).sum(-1), 0.0)
    return total


def _both_cut(z: Tensor, b: Tensor, cos_slope: Tensor) -> Tensor:
    """M(z, b) / S^2: exact exchange less that of Oren & Nayar 1994, eq. (48), less the two single cuts; 0 on the
    rim of the overlap.
    """
    return (z + b - 2) / (1 + cos_slope) - strip_mismatch(z, b, cos_slope)


def higher_bounce_means(
    plane: SlopePlane, lobes: Lobes, correlation: Tensor, modes: CavityModes, *, order: int, graded: bool = False
) -> Tensor:
    r"""Geometry side of three and more bounces: azimuth means over the modes of each slope, (1/pi) C times mean of xi_n
    xi_n.

    A facet met with projection z couples to mode n by xi_n(z) = (1 + z) Q_n(m(z)), which is G_n(1) (1 + c(z)) + r_n(z)
    with r_n = 0 off the lobe. The first part gives the closed form of `saturated_correlation`, the rest the same lobes
    and overlaps as two bounces.

    Args: plane, lobes, correlation (..., K), modes of the same K slopes; `order` nodes on each piece, `graded` as in
        `two_bounce_mean`.
    Returns: (..., K, N, 2), last axis (same facet lit, opposite facet lit); contract with
        `cavity_modes.bounce_coefficients`. [1/sr]
    """
    whole = strip_means(modes, torch.ones_like(modes.cos_slope)[:, None])[..., 0]  # G_n(1), (K, N)
    scale = root_scale(plane, lobes) if graded else None
    straight, slanted = _mode_lobes(plane, lobes, modes, whole, order=order, scale=scale)
    pairs, rims = [], []
    for angle, placed in zip((plane.delta, math.pi - plane.delta), _graded(plane, graded), strict=True):
        pair, rim = _mode_overlap(overlap_nodes(lobes, angle, order, scale=scale, **placed), modes, whole)
        pairs.append(pair)
        rims.append(rim)
    means = []
    for sign, here, there in ((1, 0, 1), (-1, 1, 0)):
        flat = whole * (1 + sign * correlation)[..., None]
        means.append(whole * (flat + straight + sign * slanted - rims[here] + rims[there]) + pairs[here])
    return (lobes.cos_slope / math.pi)[..., None, None] * torch.stack(means, dim=-1)


def _coupling_change(modes: CavityModes, whole: Tensor, z: Tensor) -> Tensor:
    """r_n(z) = 2 (G_n(2/(1+z)) - G_n(1)) at projections z >= 1 (..., K, node); result (..., K, N, node)."""
    return 2 * (strip_means(modes, 2 / (1 + z)) - whole[..., None])


def _mode_lobes(
    plane: SlopePlane, lobes: Lobes, modes: CavityModes, whole: Tensor, *, order: int, scale: Tensor | None
) -> tuple[Tensor, Tensor]:
    """Lobe means of r_n, plain and times the other projection, both directions added; each (..., K, N)."""
    straight, slanted = [], []
    for half, projection, tangent in (
        (lobes.half_light, lobes.light, plane.tan_light),
        (lobes.half_view, lobes.view, plane.tan_view),
    ):
        z, weight = half_lobe(half, projection, order, scale=scale)
        change = _coupling_change(modes, whole, z) * weight[..., None, :]
        slant = safe_divide(plane.dot, tangent * tangent, where=half > 0)
        straight.append(change.sum(-1))
        slanted.append(torch.where((half > 0)[..., None], slant[..., None] * (change * z[..., None, :]).sum(-1), 0.0))
    return straight[0] + straight[1], slanted[0] + slanted[1]


def _mode_overlap(nodes: Overlap, modes: CavityModes, whole: Tensor) -> tuple[Tensor, Tensor]:
    """Overlap means of r_n(a) r_n(b) and of (b - 1) r_n(a) + (a - 1) r_n(b); each (..., K, N)."""
    light, view = _coupling_change(modes, whole, nodes.light), _coupling_change(modes, whole, nodes.view)
    weight = nodes.weight[..., None, :]
    rim = light * (nodes.view - 1)[..., None, :] + view * (nodes.light - 1)[..., None, :]
    return (weight * light * view).sum(-1), (weight * rim).sum(-1)
