r"""The series of the directional-diffuse lobe, for any roughness, with exact derivatives.

.. math::
    \frac{S(g, t)}{g} = \sum_{m \ge 1} \frac{g^{m-1} e^{-g}}{m!\,m}\,e^{-t/m}
    = \mathrm E_{j \sim \mathrm{Poisson}(g)}[h(j)], \quad h(j) = \frac{e^{-t/(j+1)}}{(j+1)^2}

A mean over a Poisson distribution has derivatives of the same kind: d/dg is the mean of h(j + 1) - h(j), and d/dt puts
one more power of j + 1 below, with the other sign. Where the largest term is among the first, the mean is summed from
j = 0, with as many terms as needed; beyond, `expansion` takes over.
"""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf.models.he_torrance.expansion import exp_or_zero, expansion


class _Scheme(NamedTuple):
    """What is used up to which index m of the largest term; each starts where the one before ends.

    Attributes:
        sums: ends of the ranges where terms are added, as many as the end needs.
        expansions: (end, highest power of 1/m) of the ranges beyond.
        tail: share of the sum that may be left out.
    """

    sums: tuple[float, ...]
    expansions: tuple[tuple[float, int], ...]
    tail: float


_SCHEMES = {
    torch.float32: _Scheme((0.3, 1.5, 6.0, 14.0, 24.0), ((34.0, 8), (80.0, 5), (600.0, 4), (math.inf, 2)), 1e-8),
    torch.float64: _Scheme((0.3, 1.5, 6.0, 16.0, 34.0, 70.0), ((200.0, 9), (1000.0, 6), (math.inf, 4)), 1e-13),
}
_HIGHEST_DERIVATIVE = 2
# Entries at a time: many, for each range of m is a call per term; not all, for a term is a temporary.
_AT_A_TIME = 2**18


def series_over_g(g: Tensor, t: Tensor) -> Tensor:
    """S(g, t)/g with S = sum_{m >= 1} g^m e^-g/(m! m) e^(-t/m); e^-t at g = 0. [-]

    Args:
        g: squared phase of the roughness, (v_z sigma)^2 >= 0. [-] Broadcasts with t.
        t: squared lateral phase, (v_xy tau)^2/4 >= 0. [-]
        Neither is checked: both are squares. The sum over m in eq. (78) is g times this.
    Returns: (...), in the dtype of the inputs, with first and second derivatives in reverse and forward mode.
    Raises: TypeError unless both are float32 or both float64; NotImplementedError for a third derivative.
    Accuracy: 1e-11 relative in float64, 1e-6 + 3 eps (1 + |ln(g S)|) in float32, where an exponent of 60 carries
        60 eps. Derivatives are evaluated in float64: 1e-10 of the larger of themselves and a thousandth of
        S/g/max(g, 1), rounded to the dtype. Exponentials below the smallest normal number are 0.
    Source: He, Torrance, Sillion & Greenberg 1991, "A comprehensive physical model for light reflection", DOI
        10.1145/127719.122738, eqs. (7), (78).
    """
    if g.dtype != t.dtype or g.dtype not in _SCHEMES:
        raise TypeError(f"series_over_g: g and t must both be float32 or both float64; found {g.dtype} and {t.dtype}")
    function = _captured if torch.compiler.is_compiling() else _Eager.apply
    return function(*torch.broadcast_tensors(g, t), [0, 0])[0]


def first_terms_over_g(g: Tensor, t: Tensor, *, terms: int) -> Tensor:
    """S(g, t)/g from its first terms alone, as the equation reads: the scheme to compare `series_over_g` with.

    Args:
        g, t: as in `series_over_g`, (...).
        terms: number of terms, from m = 1 on. [-]
    Deviations: good for g up to about terms - 6 sqrt(terms); nothing is left of the sum beyond, and NaN once g^terms
        over the factorial overflows.
    """
    total = torch.zeros_like(g * t)
    for m in range(terms, 0, -1):
        total = torch.exp(-t / m) / m**2 + g / m * total
    return total * torch.exp(-g)


def _derivatives(g: Tensor, t: Tensor, orders: Sequence[int]) -> Tensor:
    """Derivatives of S/g stacked in front, (order, ...); `orders` is n, q, n, q, ...: n times by g, q times by t."""
    pairs = _pairs(orders)
    # A derivative by g is a difference that changes sign: its digits are kept by float64 alone.
    dtype = torch.float64 if max(orders) > 0 else g.dtype
    derivatives = g.new_empty((len(pairs), g.numel()))
    for start in range(0, g.numel(), _AT_A_TIME):
        part = slice(start, start + _AT_A_TIME)
        _fill(derivatives[:, part], g.reshape(-1)[part].to(dtype), t.reshape(-1)[part].to(dtype), pairs)
    return derivatives.view(len(pairs), *g.shape)


def _pairs(orders: Sequence[int]) -> list[tuple[int, int]]:
    return list(zip(orders[::2], orders[1::2], strict=True))


def _remember(ctx, inputs, output) -> None:
    g, t, ctx.orders = inputs
    ctx.save_for_backward(g, t)


def _slopes(function, ctx, wanted: Sequence[bool]) -> list[Tensor | None]:
    """d/dg and d/dt of each output (order, ...), those wanted: derivatives one order higher, by the same function."""
    pairs = _pairs(ctx.orders)
    higher = [[(n + 1 - up, q + up) for n, q in pairs] if wanted[up] else [] for up in (0, 1)]
    raised = sorted({*higher[0], *higher[1]})
    if max(n + q for n, q in raised) > _HIGHEST_DERIVATIVE:
        raise NotImplementedError(f"series_over_g has {_HIGHEST_DERIVATIVE} derivatives; one more was asked for")
    derivatives = function(*ctx.saved_tensors, [i for pair in raised for i in pair])
    return [derivatives[[raised.index(pair) for pair in rows]] if rows else None for rows in higher]


def _pulled_back(function, ctx, upstream: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
    by_g, by_t = (
        None if slopes is None else (slopes * upstream).sum(0)
        for slopes in _slopes(function, ctx, ctx.needs_input_grad[:2])
    )
    return by_g, by_t, None


class _Eager(torch.autograd.Function):
    """`_derivatives` in reverse mode, forward mode and vmap."""

    @staticmethod
    def forward(g, t, orders):
        return _derivatives(g, t, orders)

    @staticmethod
    def setup_context(ctx, inputs, output):
        _remember(ctx, inputs, output)
        ctx.save_for_forward(*inputs[:2])

    @staticmethod
    def backward(ctx, upstream):  # pyright: ignore[reportIncompatibleMethodOverride]
        return _pulled_back(_Eager.apply, ctx, upstream)

    @staticmethod
    def jvp(ctx, g_tangent, t_tangent, _):  # pyright: ignore[reportIncompatibleMethodOverride]
        by_g, by_t = _slopes(_Eager.apply, ctx, (True, True))
        return by_g * g_tangent + by_t * t_tangent  # pyright: ignore[reportOptionalOperand]

    @staticmethod
    def vmap(info, in_dims, g, t, orders):  # pyright: ignore[reportIncompatibleMethodOverride]
        batched = [
            x.expand(info.batch_size, *x.shape) if dim is None else x.movedim(dim, 0)
            for x, dim in zip((g, t), in_dims[:2], strict=True)
        ]
        return _Eager.apply(*batched, orders), 1


# Opaque to torch.compile: how much is to be done for an entry depends on its numbers.
_captured = torch.library.custom_op(
    "torchbrdf::he_torrance_series",
    _derivatives,
    mutates_args=(),
    schema="(Tensor g, Tensor t, int[] orders) -> Tensor",
)
_captured.register_fake(lambda g, t, orders: g.new_empty((len(orders) // 2, *g.shape)))
_captured.register_autograd(lambda ctx, upstream: _pulled_back(_captured, ctx, upstream), setup_context=_remember)


def _fill(derivatives: Tensor, g: Tensor, t: Tensor, orders: list[tuple[int, int]]) -> None:
    """Write the derivatives (order, entry) of S/g at g, t (entry,), each entry in the way of its largest term."""
    scheme = _SCHEMES[g.dtype]
    ends = (*scheme.sums, *(end for end, _ in scheme.expansions[:-1]))
    log_g = g.log()
    place = torch.zeros_like(g, dtype=torch.uint8)
    for m in ends:  # the largest term lies at m or beyond
        place += t >= m**2 * (math.log(m) - log_g)
    order = place.argsort()
    start = 0
    for number, count in enumerate(torch.bincount(place, minlength=len(ends) + 1).tolist()):
        chosen = order[start : start + count]
        start += count
        if count == 0:
            continue
        here = g.index_select(0, chosen), t.index_select(0, chosen)
        if number < len(scheme.sums):
            end = scheme.sums[number]
            means = _sum(*here, orders, m=end, terms=_terms(end, scheme.tail))
        else:
            means = expansion(*here, orders, degree=scheme.expansions[number - len(scheme.sums)][1])
        for row, mean in zip(derivatives, means, strict=True):
            row.index_copy_(0, chosen, mean.to(row.dtype))


@functools.cache
def _terms(m: float, tail: float) -> int:
    """Terms until those of a Poisson distribution of mean m have fallen to `tail`, by Chernoff's bound."""
    n = math.ceil(m)
    while n * math.log(n / m) - n + m < -math.log(tail):
        n += 1
    return n


def _sum(g: Tensor, t: Tensor, orders: list[tuple[int, int]], *, m: float, terms: int) -> list[Tensor]:
    """Means over the first terms for g up to m, by Horner's rule in g over a power of two.

    So each step rounds twice and no more, and the coefficients g^j/j! are neither too large nor too small for float32.
    """
    unit = 2.0 ** round(math.log2(m))
    scaled = g / unit
    most = max(n for n, _ in orders)
    totals = [torch.zeros_like(g) for _ in orders]
    # one room for all terms: to take fresh memory costs more than to compute
    room = torch.empty_like(t)
    above, fresh = ({q: [torch.zeros_like(t) for _ in range(most + 1)] for _, q in orders} for _ in range(2))
    for j in range(terms + most - 1, -1, -1):
        decay = exp_or_zero(torch.mul(t, -1 / (j + 1), out=room))
        weight = unit**j / math.factorial(j) if j < terms else 0.0
        if most == 0:
            for total, (_, q) in zip(totals, orders, strict=True):
                total.mul_(scaled).add_(decay, alpha=weight * _share(j, q))
            continue
        for q in above:
            torch.mul(decay, _share(j, q), out=fresh[q][0])
            for n in range(most):  # the n-th difference means nothing before the n-th step, and is not used
                torch.sub(above[q][n], fresh[q][n], out=fresh[q][n + 1])
        above, fresh = fresh, above
        if j < terms:
            for total, (n, q) in zip(totals, orders, strict=True):
                total.mul_(scaled).add_(above[q][n], alpha=weight)
    over_all = torch.exp(-g)
    return [total.mul_(over_all) for total in totals]


def _share(j: int, q: int) -> float:
    """What stands before e^(-t/(j + 1)) in the derivative of h(j), q times by t."""
    return (-1.0) ** q / (j + 1) ** (2 + q)
