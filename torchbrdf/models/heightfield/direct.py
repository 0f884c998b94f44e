r"""Light reflected once: an integral over the facets' slopes, by a quadrature that ends where facets turn away.

.. math::
    f_1 = \frac1\pi\, E_\xi \Bigl[\frac{\cos_a\, X^+ Y^+}{1 + D}\Bigr],\quad
    X = 1 + t_i\, \xi \cdot d_i,\quad Y = 1 + t_r\, \xi \cdot d_r

The first axis of the slope plane points towards the more grazing direction a, the second across it so that the other
direction b lies on its positive side. For each y the facets that face both rays are an interval of x; the range of y
is split at the apex of the wedge they fill.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._constants import constant
from torchbrdf._numerics import horizon
from torchbrdf.models.heightfield.slope_frame import SlopeFrame
from torchbrdf.models.heightfield.visibility import (
    HeightfieldConstants,
    facet_masking,
    independence,
    joint_masking,
    ray,
)
from torchbrdf.quadrature import gauss_legendre

# Bytes of an array worked on at a time: what stays in a core's cache.
_BYTES_AT_A_TIME = 262144

# Distance of the directions over that of the more grazing one from the origin: nearer, where the split turns round
# within it, its derivative would be the rule's error over the distance.
_ONE_RAY = 1e-3


class Quadrature(NamedTuple):
    """Gauss-Legendre nodes along the grazing direction, and on each of two panels across it; reach in std. dev."""

    along: int
    across: int
    reach: float


# By the number of nodes of each.
QUADRATURES = {
    160: Quadrature(10, 8, 4.3),
    240: Quadrature(12, 10, 4.6),
    384: Quadrature(16, 12, 5.0),
    560: Quadrature(20, 14, 5.5),
}


def check_nodes(name: str, nodes: int) -> None:
    """Raise ValueError unless there is a quadrature of so many nodes."""
    if nodes not in QUADRATURES:
        raise ValueError(f"{name}: nodes must be one of {', '.join(map(str, QUADRATURES))}; found {nodes!r}.")


def direct_light(
    frame: SlopeFrame, occlusion: Tensor, constants: HeightfieldConstants, quadrature: Quadrature
) -> Tensor:
    """f_1 (...) [1/sr] of unit albedo. Working memory is that of a few hundred pixels, without derivatives."""
    shape = torch.broadcast_shapes(*(field.shape for field in frame), occlusion.shape)
    nodes = 2 * quadrature.along * quadrature.across
    step = max(1, _BYTES_AT_A_TIME // (nodes * frame.grazing.element_size()))
    if torch.compiler.is_compiling() or shape.numel() <= step:
        return _direct_light(frame, occlusion, constants, quadrature)
    pieces = zip(*(field.expand(shape).reshape(-1).split(step) for field in (*frame, occlusion)), strict=True)
    parts = [_direct_light(SlopeFrame(*piece[:-1]), piece[-1], constants, quadrature) for piece in pieces]
    return torch.cat(parts).reshape(shape)


def _direct_light(
    frame: SlopeFrame, occlusion: Tensor, constants: HeightfieldConstants, quadrature: Quadrature
) -> Tensor:
    first, second = ray(frame.grazing, occlusion, constants), ray(frame.other, occlusion, constants)
    independent = independence(first, second, frame.half_turn, constants)[..., None, None]
    first, second = (type(r)(*(field[..., None, None] for field in r)) for r in (first, second))
    wide = SlopeFrame(*(field[..., None] for field in frame))
    y, weight_y = _across(wide, quadrature)
    low, top = _facing(wide, y, quadrature.reach)
    node, weight = gauss_legendre(quadrature.along, y)
    start, width = torch.asinh(low), torch.asinh(top) - torch.asinh(low)
    x, stretch = _sinh_cosh(start[..., None] + width[..., None] * node)
    # The same rule from end to end of the Gaussian gives 1: without roughness the integral is exact.
    weight_x = width[..., None] * (weight / _whole(quadrature)) * stretch * torch.exp(-0.5 * x * x)

    wide, y = SlopeFrame(*(field[..., None] for field in wide)), y[..., None]
    lit = 1 + wide.grazing * x
    # An empty interval weighs nothing, and must not overflow.
    seen = (1 + wide.other_across * y + wide.other_along * x).relu()
    steep = x * (wide.along * x + 2 * wide.mixed * y) + (1 + wide.across * y * y)
    masking_first = facet_masking((first.steepness + x).relu(), first)
    masking_second = facet_masking(second.steepness * seen, second)
    joint = joint_masking(masking_first, masking_second, independent)
    facets = lit * seen * torch.rsqrt(steep) / (1 + joint)
    return ((facets * weight_x).sum(-1) * weight_y).sum(-1) / math.pi


def _across(frame: SlopeFrame, quadrature: Quadrature) -> tuple[Tensor, Tensor]:
    """Nodes y (..., 2 across) and their shares, on both sides of the apex of the facets that face both rays.

    The apex y* = -(t_a - t_b cos(dphi))/(t_a t_b sin(dphi)) <= 0. Beyond the reach nothing needs a split, which then
    tends to the middle.
    """
    apart = frame.grazing - frame.other_along
    sideways = quadrature.reach * frame.grazing * frame.other_across
    # y*/reach is apart/sideways up to 1; its inverse from there on
    largest = torch.maximum(apart, sideways)
    flat = largest <= 0
    share = torch.minimum(apart, sideways).masked_fill(flat, 0.0) / largest.masked_fill(flat, 1.0)
    share = torch.where(largest <= _ONE_RAY * frame.grazing, share.detach(), share)
    split = -torch.asinh(quadrature.reach * share)
    end = math.asinh(quadrature.reach)
    node, weight = gauss_legendre(quadrature.across, split)
    low, high = end + split, end - split
    y, stretch = _sinh_cosh(torch.cat((low * node - end, high * node + split), -1))
    weight = torch.cat((low * weight, high * weight), -1) * stretch * torch.exp(-0.5 * y * y)
    return y, weight / weight.sum(-1, keepdim=True)


def _facing(frame: SlopeFrame, y: Tensor, reach: float) -> tuple[Tensor, Tensor]:
    """Ends low <= top (...) of the x in [-reach, reach] whose facets face both rays."""
    limit = horizon(y.dtype)
    # Where b has no part along a, all or none of the interval faces it: the end lies beyond the reach.
    along = torch.where(frame.other_along.abs() < limit, limit, frame.other_along)
    end = (-(1 + frame.other_across * y) / along).clamp(-reach, reach)
    grazing = frame.grazing.clamp(min=1 / reach)
    behind = -1 / grazing
    low = torch.where(along > 0, torch.maximum(behind, end), behind)
    top = torch.where(along > 0, torch.full_like(end, reach), end)
    return low, torch.maximum(low, top)


def _sinh_cosh(u: Tensor) -> tuple[Tensor, Tensor]:
    e = torch.exp(u)
    return 0.5 * (e - 1 / e), 0.5 * (e + 1 / e)


@constant
@lru_cache(maxsize=8)
def _whole(quadrature: Quadrature) -> float:
    """Integral of exp(-x^2/2) over the reach by the rule along x."""
    like = torch.zeros((), dtype=torch.float64)
    node, weight = gauss_legendre(quadrature.along, like)
    end = math.asinh(quadrature.reach)
    x, stretch = _sinh_cosh(2 * end * node - end)
    return float((2 * end * weight * stretch * torch.exp(-0.5 * x * x)).sum())
