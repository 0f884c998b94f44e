"""Light and view as points of the slope plane, turned so that the more grazing one lies along the first axis.

A direction at polar angle theta and azimuth d (a unit vector) is the point p = tan(theta) d. All of a frame is made of
the same two points: what rounding leaves in one of its fields it leaves in all, so that next to the normal and to
light = view they still belong together, and with them their derivatives.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import cross, dot, half_turn_sine, length, safe_divide, safe_sqrt
from torchbrdf.directions import Cosines


class SlopeFrame(NamedTuple):
    """Two directions in the plane of slopes over their rms, each (...), and how steep a slope vector is. [-]

    The squared steepness of the slope (x, y) is along x^2 + 2 mixed x y + across y^2.
    """

    grazing: Tensor  # t_a, of the more grazing direction: its distance from the origin
    other: Tensor  # t_b <= t_a
    other_along: Tensor  # t_b cos(dphi)
    other_across: Tensor  # t_b |sin(dphi)|
    half_turn: Tensor  # sin(dphi/2)
    along: Tensor
    mixed: Tensor
    across: Tensor


def slope_frame(cosines: Cosines, slope: Tensor) -> SlopeFrame:
    """Of directions (...) on an isotropic surface of rms slope s (...).

    Lengths have zero gradient where they are 0. Nothing that is read there depends on them: without a tangent part a
    ray is not masked, and of two rays in one only the cone is left, whose subgradient is 0.
    """
    if cosines.vectors is None:
        return _frame_from_cosines(cosines, slope)
    normal = cosines.vectors[0]
    pair = _pair(*_points(*cosines.vectors, cosines))
    across = dot(normal, cross(pair.grazing, pair.other)).abs()
    squared = slope * slope
    return SlopeFrame(
        grazing=slope * pair.grazing_length,
        other=slope * pair.other_length,
        other_along=slope * pair.other_along,
        other_across=slope * pair.over_grazing(across),
        half_turn=pair.half_turn,
        along=squared,
        mixed=torch.zeros_like(squared),
        across=squared,
    )


def anisotropic_slope_frame(cosines: Cosines, slope_x: Tensor, slope_y: Tensor) -> SlopeFrame:
    """Of directions (...) on a surface of rms slopes s_x along the tangent and s_y across it (...).

    The plane of slopes is stretched until they are isotropic. The surface is an isotropic one stretched along the
    ground, and a stretch takes rays to rays and hides what was hidden: every quantity of visibility, the azimuth
    between light and view among them, is that of the stretched directions. What stays is how steep a facet is.
    Raises ValueError without a tangent.
    """
    pair = _pair(*_stretched_points(cosines, slope_x, slope_y))
    ax, ay, _ = pair.grazing.unbind(-1)
    bx, by, _ = pair.other.unbind(-1)
    ex, ey = pair.over_grazing(ax) + (pair.grazing_length <= 0).to(ax), pair.over_grazing(ay)
    turned = ax * by - ay * bx
    # The second axis points to the side where the other direction lies.
    hand = torch.where(turned < 0, -1.0, 1.0).to(ax)
    x2, y2 = slope_x * slope_x, slope_y * slope_y
    return SlopeFrame(
        grazing=pair.grazing_length,
        other=pair.other_length,
        other_along=pair.other_along,
        other_across=pair.over_grazing(hand * turned),  # no modulus: it has a derivative where it is 0
        half_turn=pair.half_turn,
        along=x2 * ex * ex + y2 * ey * ey,
        mixed=hand * (y2 - x2) * ex * ey,
        across=x2 * ey * ey + y2 * ex * ex,
    )


def tangents(cosines: Cosines) -> tuple[Tensor, Tensor]:
    """tan(theta) (...) of light and view, with zero gradient where it is 0."""
    if cosines.vectors is None:
        light, view = (safe_sqrt((1 - c) * (1 + c)) / c for c in (cosines.light, cosines.view))
        return light, view
    p, q = _points(*cosines.vectors, cosines)
    return length(p), length(q)


def _points(normal: Tensor, light: Tensor, view: Tensor, cosines: Cosines) -> tuple[Tensor, Tensor]:
    """Light and view in the slope plane (..., 3), turned by 90 degrees; 0 below the horizon."""
    below = ~cosines.above_horizon[..., None]
    # n x s is exactly 0 where direction and normal are one
    p = (cross(normal, light) / cosines.light[..., None]).masked_fill(below, 0.0)
    q = (cross(normal, view) / cosines.view[..., None]).masked_fill(below, 0.0)
    return p, q


def _stretched_points(cosines: Cosines, slope_x: Tensor, slope_y: Tensor) -> tuple[Tensor, Tensor]:
    """(s_x p_x, s_y p_y, 0) of light and view, the first axis along the tangent."""
    plane = cosines.tangent_plane
    light = slope_x * plane.light_tangent / cosines.light, slope_y * plane.light_bitangent / cosines.light
    view = slope_x * plane.view_tangent / cosines.view, slope_y * plane.view_bitangent / cosines.view
    p, q = (torch.stack((x, y, torch.zeros_like(x)), -1) for x, y in (light, view))
    return p, q


class _Pair(NamedTuple):
    """Two points (..., 3), the more grazing one first, and what both frames make of them (...)."""

    grazing: Tensor
    other: Tensor
    grazing_length: Tensor
    other_length: Tensor
    other_along: Tensor
    half_turn: Tensor  # sin(dphi/2)

    def over_grazing(self, part: Tensor) -> Tensor:
        """part/|grazing|, 0 where that is 0."""
        return safe_divide(part, self.grazing_length, where=self.grazing_length > 0)


def _pair(p: Tensor, q: Tensor) -> _Pair:
    light, view = length(p), length(q)
    product = light * view
    # |p| |q| |d_p - d_q| is exactly 0 where both are one
    chord = length(p * view[..., None] - q * light[..., None])
    half_turn = safe_divide(chord, 2 * product, where=product > torch.finfo(product.dtype).tiny)
    # One choice for all fields, which a maximum and a minimum of equal lengths would not make.
    light_grazes = light >= view
    grazing, grazing_length = torch.where(light_grazes[..., None], p, q), torch.where(light_grazes, light, view)
    other, other_length = torch.where(light_grazes[..., None], q, p), torch.where(light_grazes, view, light)
    along = safe_divide(dot(p, q), grazing_length, where=grazing_length > 0)
    return _Pair(grazing, other, grazing_length, other_length, along, half_turn)


def _frame_from_cosines(cosines: Cosines, slope: Tensor) -> SlopeFrame:
    """Without vectors: sines from cosines, which keep half the digits next to the normal."""
    product = cosines.sin_alpha * cosines.sin_beta
    turn = [safe_divide(part, product, where=product > 0) for part in (cosines.in_plane, cosines.azimuth_sine)]
    # Tangents of the other direction along and across the grazing one, without its sine: smooth at its normal.
    below, steep = cosines.sin_alpha * cosines.beta, cosines.sin_alpha > 0
    squared = slope * slope
    return SlopeFrame(
        grazing=slope * cosines.sin_alpha / cosines.alpha,
        other=slope * cosines.sin_beta / cosines.beta,
        other_along=slope * safe_divide(cosines.in_plane, below, where=steep),
        other_across=slope * safe_divide(cosines.azimuth_sine, below, where=steep),
        half_turn=half_turn_sine(*turn),
        along=squared,
        mixed=torch.zeros_like(squared),
        across=squared,
    )
