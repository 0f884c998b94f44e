r"""Cubic splines on a grid over the unit cube, with columns of values: one gather of table rows a point.

.. math:: f(u) = \sum_{k} c_{k_1 .. k_d} \prod_a b(u_a (n_a - 3) - k_a)

with b the uniform cubic B-spline, n_a coefficients along axis a and as many sites, at which values are met exactly.
Values have two continuous derivatives. The first ones are computed in the same manner as the values; those of higher
order, and what torch.func and torch.compile ask for, by plain tensor operations.
Source: de Boor 1978, "A Practical Guide to Splines", Springer, DOI 10.1007/978-1-4612-6333-3.
"""

from collections.abc import Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.autograd import forward_ad
from torch.nn.functional import embedding_bag

FEWEST_SITES = 6
TAPS = 4  # coefficients that a point of an axis reads
POINTS_AT_A_TIME = 4096  # rows of so many points stay in a core's cache


class SplineTable(NamedTuple):
    """Coefficients (n_1, .., n_d, column), written down so that a point reads 4^(d-1) rows of them."""

    rows: Tensor  # (n_1 .. n_(d-1) (n_d - 3), 4 column): those that follow one another along the last axis side by side
    counts: tuple[int, ...]  # n_1 .. n_d

    @classmethod
    def of(cls, coefficients: Tensor) -> "SplineTable":
        counts = coefficients.shape[:-1]
        windows = coefficients.unfold(len(counts) - 1, TAPS, 1).transpose(-1, -2)
        return cls(windows.flatten(-2).flatten(0, -2).contiguous(), tuple(counts))

    def to(self, like: Tensor) -> "SplineTable":
        """In the dtype and on the device of `like`."""
        return SplineTable(self.rows.to(like), self.counts)

    def times(self, matrix: Tensor) -> "SplineTable":
        """The table whose columns are these times a matrix (column, new column)."""
        rows = self.rows.unflatten(-1, (TAPS, -1)).to(matrix.dtype)
        return SplineTable((rows @ matrix).flatten(-2), self.counts)


def sites(count: int) -> np.ndarray:
    """Where on [0, 1] an axis of `count` coefficients, at least six, takes its values: the ends, the knots, and one
    point more in the first and in the last cell.
    """
    if count < FEWEST_SITES:
        raise ValueError(f"an axis of a spline table needs at least {FEWEST_SITES} sites; found {count}.")
    cells = count - TAPS + 1
    knots = np.arange(cells + 1) / cells
    return np.concatenate((knots[:1], [0.5 / cells], knots[1:-1], [1 - 0.5 / cells], knots[-1:]))


def spline_coefficients(values: np.ndarray, axes: int) -> np.ndarray:
    """Coefficients of the spline that has `values` (n_1, .., n_axes, ...) at the sites of the first axes."""
    for axis in range(axes):
        count = values.shape[axis]
        first, weights = (t.numpy() for t in _taps(torch.from_numpy(sites(count)), count))
        collocation = np.zeros((count, count))
        for tap in range(TAPS):
            collocation[np.arange(count), first + tap] += weights[:, tap]
        lines = np.moveaxis(values, axis, 0)
        solved = np.linalg.solve(collocation, lines.reshape(count, -1)).reshape(lines.shape)
        values = np.moveaxis(solved, 0, axis)
    return np.ascontiguousarray(values)


def interpolate(table: SplineTable, coordinates: Sequence[Tensor]) -> Tensor:
    """Values (..., column) at coordinates, each (...) in [0, 1]; the first and last cell go on beyond the ends.

    Differentiable with respect to the coordinates, and by torch.func and torch.compile to the table.
    """
    dtype = reduce(torch.promote_types, (u.dtype for u in coordinates), table.rows.dtype)
    points = torch.broadcast_tensors(*(u.to(dtype) for u in coordinates))
    table = SplineTable(table.rows.to(dtype), table.counts)
    if torch.compiler.is_compiling() or any(map(_is_transformed, (table.rows, *points))) or table.rows.requires_grad:
        return _by_tensor_operations(table, points)
    shape = points[0].shape
    pieces = zip(*(u.reshape(-1).split(POINTS_AT_A_TIME) for u in points), strict=True)
    values = [_Interpolated.apply(table.rows, table.counts, *piece) for piece in pieces]
    return torch.cat(values).reshape(*shape, table.rows.shape[-1] // TAPS)


class _Interpolated(torch.autograd.Function):
    """Values at points (P,) with first derivatives by the same gathers."""

    generate_vmap_rule = True  # never used: what is mapped goes by tensor operations, and the rest passes through

    @staticmethod
    def forward(rows: Tensor, counts: tuple[int, ...], *points: Tensor) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        places, weights = _places(counts, points)
        return _bag(rows, places, weights)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Tensor) -> None:
        rows, ctx.counts, *points = inputs
        ctx.save_for_backward(rows, *points)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        (gradient,) = gradients
        rows, *points = ctx.saved_tensors
        needed = ctx.needs_input_grad[2:]
        if torch.is_grad_enabled():  # derivatives of this derivative are asked for
            values = _by_tensor_operations(SplineTable(rows, ctx.counts), points)
            asked = [u for u, n in zip(points, needed, strict=True) if n]
            found = iter(torch.autograd.grad(values, asked, gradient, create_graph=True))
            return (None, None, *(next(found) if n else None for n in needed))
        places, weights = _places(ctx.counts, points)
        slopes = [_slopes(u, n) for u, n in zip(points, ctx.counts, strict=True)]
        parts: list[Tensor | None] = []
        for axis, asked in enumerate(needed):
            turned = [*weights[:axis], slopes[axis], *weights[axis + 1 :]]
            parts.append((_bag(rows, places, turned) * gradient).sum(-1) if asked else None)
        return (None, None, *parts)


def _bag(rows: Tensor, places: Tensor, weights: Sequence[Tensor]) -> Tensor:
    """Weighted sum of rows at places (P, 4^(d-1)), then of the taps along the last axis: (P, column)."""
    *outer, last = weights
    side_by_side = embedding_bag(places, rows, per_sample_weights=_products(outer), mode="sum")
    return (side_by_side.unflatten(-1, (TAPS, -1)) * last[..., None]).sum(-2)


def _by_tensor_operations(table: SplineTable, points: Sequence[Tensor]) -> Tensor:
    places, (*outer, last) = _places(table.counts, points)
    gathered = table.rows[places]
    side_by_side = (_products(outer)[..., None] * gathered).sum(-2)
    return (side_by_side.unflatten(-1, (TAPS, -1)) * last[..., None]).sum(-2)


def _places(counts: tuple[int, ...], points: Sequence[Tensor]) -> tuple[Tensor, list[Tensor]]:
    """Rows (..., 4^(d-1)) that points read, and the weights (..., 4) of the taps along each axis."""
    first, weights = zip(*(_taps(u, n) for u, n in zip(points, counts, strict=True)), strict=True)
    steps = torch.arange(TAPS, device=points[0].device)
    place = torch.zeros_like(first[0])[..., None]
    for axis, count in enumerate(counts[:-1]):
        place = ((place * count + first[axis][..., None])[..., None] + steps).flatten(-2)
    return place * (counts[-1] - TAPS + 1) + first[-1][..., None], list(weights)


def _taps(u: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """First coefficient (...) that a point of an axis reads, and the weights of four (..., 4)."""
    first, s = _cell(u, count)
    r = 1 - s
    s2, r2 = s * s, r * r
    inner, outer = 2 / 3 - s2 * (1 - 0.5 * s), 2 / 3 - r2 * (1 - 0.5 * r)
    return first, torch.stack((r2 * r / 6, inner, outer, s2 * s / 6), -1)


def _slopes(u: Tensor, count: int) -> Tensor:
    """Derivatives (..., 4) of the weights with respect to u."""
    _, s = _cell(u, count)
    r = 1 - s
    slopes = torch.stack((-0.5 * r * r, s * (1.5 * s - 2), r * (2 - 1.5 * r), 0.5 * s * s), -1)
    return (count - TAPS + 1) * slopes


def _cell(u: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Cell of an axis, and the place in it."""
    cells = count - TAPS + 1
    along = u * cells
    first = along.detach().floor().clamp(0, cells - 1)
    return first.long(), along - first


def _products(weights: Sequence[Tensor]) -> Tensor:
    """All products (..., 4^n) of one tap of each axis."""
    return reduce(lambda a, b: (a[..., :, None] * b[..., None, :]).flatten(-2), weights)


def _is_transformed(t: Tensor) -> bool:
    """Whether a transform of torch.func, or forward differentiation, looks at a tensor."""
    return torch.func.debug_unwrap(t) is not t or forward_ad.unpack_dual(t).tangent is not None
