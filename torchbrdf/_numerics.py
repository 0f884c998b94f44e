"""Guards: the only home of epsilons and of branches that exist for rounding's sake.

Each primitive keeps the value exact where the mathematics defines one, and guards the gradient
where the mathematics has a limit that floating point cannot take.
"""

import functools
import math
from collections.abc import Callable

import numpy as np
import torch
from numpy.polynomial import Chebyshev, Polynomial
from torch import Tensor

from torchbrdf._constants import constant

# acos(c)/sqrt(1 - c^2) is analytic on [0, 1]; interpolation there errs by about 6^-degree.
_ANGLE_DEGREE = {torch.float64: 20, torch.float32: 9}
# A normalised vector is of unit length to a few rounding errors; data stored with six digits is not.
_UNIT_TOLERANCE_IN_EPS = 64
# sin^2(phi/2) below which an azimuth from dot products is rounding: some thousand eps in float64, ten in float32.
_TIP = {torch.float64: 1e-12, torch.float32: 1e-6}


@constant
@functools.cache
def _angle_over_sine_polynomial(dtype: torch.dtype) -> tuple[float, ...]:
    """Coefficients, highest power first, of acos(c)/sqrt(1 - c^2) in x = 1 - c, where its series is positive."""

    def ratio(x):  # the half-angle form keeps its digits at c = 1
        return 2 * np.arctan2(np.sqrt(x), np.sqrt(2 - x)) / np.sqrt(x * (2 - x))

    degree = _ANGLE_DEGREE[dtype]
    in_powers = Chebyshev.interpolate(ratio, degree, domain=[0, 1]).convert(kind=Polynomial, domain=[-1, 1])
    return tuple(float(k) for k in in_powers.coef[::-1])


@constant
@functools.cache
def _sine_excess_polynomial(dtype: torch.dtype) -> tuple[float, ...]:
    """Coefficients, highest power first, of (1 - c acos(c)/sqrt(1 - c^2))/(1 - c^2) in x = 2c - 1."""

    def excess(x):
        c = (1 + x) / 2
        sine_squared = (1 - c) * (1 + c)
        angle = 2 * np.arctan2(np.sqrt(1 - c), np.sqrt(1 + c))
        closed = (1 - c * angle / np.sqrt(sine_squared)) / sine_squared
        # hypergeometric series sum_k (2k)!!/(2k + 1)!! sin^2k of angle/(sin cos), times what is left of c
        series, term = np.zeros_like(c), np.ones_like(c) / 3
        for k in range(1, 60):
            series, term = series + term, term * sine_squared * (2 * k) / (2 * k + 3)
        return np.where(sine_squared < 0.3, series, closed)

    in_powers = Chebyshev.interpolate(excess, _ANGLE_DEGREE[dtype]).convert(kind=Polynomial)
    return tuple(float(k) for k in in_powers.coef[::-1])


# Up to so many numbers an operation costs its call: two together cost half as much as one after the other. Beyond, what
# costs is the memory they fill.
FEW = 4096
# Pixels at a time of an image: the numbers in between then stay in the processor's cache.
PIECE = 2**16
SUPPORTED_DTYPES = tuple(_ANGLE_DEGREE)


def horizon(dtype: torch.dtype) -> float:
    """Largest cosine that cannot be told from 0: a dot product of unit vectors is known to eps."""
    return torch.finfo(dtype).eps


def unit_tolerance(dtype: torch.dtype) -> float:
    """How far |v|^2 may be from 1 in a vector that counts as a unit vector."""
    return _UNIT_TOLERANCE_IN_EPS * torch.finfo(dtype).eps


Components = tuple[Tensor, Tensor, Tensor]


def components(vector: Tensor) -> Components:
    """x, y and z (...) of vectors (..., 3), each in one piece of memory: strided ones take five times as long."""
    x, y, z = vector.unbind(-1)
    if torch.compiler.is_compiling():  # the compiled loop reads them where they are
        return x, y, z
    return (x.contiguous(), y.contiguous(), z.contiguous()) if vector.is_contiguous() else (x, y, z)


def dot_of(a: Components, b: Components) -> Tensor:
    """Dot product of vectors given by their components: `sum(-1)` does not fuse when compiled."""
    return torch.addcmul(torch.addcmul(a[0] * b[0], a[1], b[1]), a[2], b[2])


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Dot product of (..., 3) vectors."""
    return dot_of(a.unbind(-1), b.unbind(-1))  # pyright: ignore[reportArgumentType]


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Cross product of (..., 3) vectors that broadcast."""
    ax, ay, az = a.unbind(-1)
    bx, by, bz = b.unbind(-1)
    return torch.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), -1)


def cross_of(a: Components, b: Components) -> Components:
    """Cross product of vectors given by their components: exactly 0 for a vector and itself."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def length(vector: Tensor) -> Tensor:
    """Length (...) of vectors (..., 3), with zero gradient where it is 0."""
    return safe_sqrt(dot(vector, vector))


def safe_sqrt(x: Tensor) -> Tensor:
    """sqrt(x), and 0 with zero gradient where rounding left x at or below 0."""
    empty = x <= 0
    return x.masked_fill(empty, 1.0).sqrt().masked_fill(empty, 0.0)


def sine(cosine: Tensor) -> Tensor:
    """Sine of an angle in [0, pi/2] from its cosine: 0 with zero gradient where the cosine is 1, or a hair above."""
    below_one = number(1.0, cosine) - cosine
    return root(torch.addcmul(below_one, below_one, cosine))  # (1 - c)(1 + c)


def root(x: Tensor) -> Tensor:
    """`safe_sqrt` up to second derivatives, in a fifth of its time: 0 with zero gradient below all normal numbers."""
    value = positive(x).sqrt()
    # puts the exact 0 back: the root of that number is a power of 2, the same in any arithmetic
    return torch.threshold(value, math.sqrt(torch.finfo(x.dtype).tiny), 0.0)


def soft_sqrt(x: Tensor) -> Tensor:
    """sqrt(x) for x >= 0 with all derivatives finite, 0 at x = 0 where x has none itself: one pass, for large arrays.

    The smallest normal number is added below the root, which changes no digit of a root above 1e-130 (float32: 1e-15).
    """
    return (x + torch.finfo(x.dtype).tiny).sqrt()


def half_turn_sine(cosine: Tensor, sine: Tensor) -> Tensor:
    """sin(phi/2) (...) in [0, 1] from cosine and sine of an azimuth: no digits are lost at 0, a cone's tip.

    Zero gradient where sin^2(phi/2) cannot be told from 0 by the cosine alone; the value is kept.
    """
    squared = ((1 - cosine) * (1 - cosine) + sine * sine) / 4
    tip = squared <= _TIP[squared.dtype]
    return torch.where(tip, safe_sqrt(squared.detach()), squared.masked_fill(tip, 1.0).sqrt())


def safe_divide(numerator: Tensor, denominator: Tensor, *, where: Tensor) -> Tensor:
    """numerator / denominator where the mask holds, else 0 with zero gradient; masked before dividing."""
    return (numerator / denominator.masked_fill(~where, 1.0)).masked_fill(~where, 0.0)


def safe_atan2(y: Tensor, x: Tensor) -> Tensor:
    """Polar angle of (x, y) in (-pi, pi]; 0 with zero gradient at the origin, where it has no meaning. [rad]"""
    # The larger coordinate is divided out, which the angle does not notice: the derivative has the squares below it,
    # and they may underflow.
    scale = torch.maximum(x.abs(), y.abs()).detach()
    origin = scale < torch.finfo(scale.dtype).tiny
    scale = scale.masked_fill(origin, 1.0)
    return torch.atan2((y / scale).masked_fill(origin, 0.0), (x / scale).masked_fill(origin, 1.0))


def arcsec(x: Tensor) -> Tensor:
    """acos(1/x) for x > 1 and 0 below, with zero gradient at x = 1. [rad] in [0, pi/2)

    By atan, which keeps the digits near x = 1 that acos(1/x) loses.
    """
    return torch.atan(safe_sqrt((x - 1) * (x + 1)))


def arccsc(x: Tensor) -> Tensor:
    """asin(1/x) for x > 1 and pi/2 below: the complement of `arcsec`, exact for large x. [rad] in (0, pi/2]"""
    return torch.atan2(torch.ones_like(x), safe_sqrt((x - 1) * (x + 1)))


def sinc(x: Tensor) -> Tensor:
    """sin(x)/x, 1 at 0, smooth to every order in reverse and forward mode."""
    return torch.sinc(x / math.pi)


def positive_part(x: Tensor) -> Tensor:
    """max(x, 0) with the derivative 1/2 at 0, the mean of both sides: what |x| beside it takes for its own."""
    return torch.maximum(x, x.new_zeros(()))


def positive(x: Tensor) -> Tensor:
    """x, and the smallest normal number where x is below it: what a logarithm or a root may be given."""
    return x.clamp(min=torch.finfo(x.dtype).tiny)


def quiet_width(dtype: torch.dtype) -> float:
    """Width w (in standard deviations) beyond which exp(-w*w/2) underflows. [-]"""
    return math.sqrt(-2 * math.log(torch.finfo(dtype).tiny))


def angle_over_sine(cosine: Tensor) -> Tensor:
    """theta / sin(theta) for cos(theta) in [0, 1]: 1 at theta = 0, smooth there, no acos.

    Relative error below 5e-15 in float64 and 2e-7 in float32.
    """
    return polynomial(_angle_over_sine_polynomial(cosine.dtype), number(1.0, cosine) - cosine)


def sine_excess(cosine: Tensor) -> Tensor:
    """(sin(theta) - theta cos(theta))/sin^3(theta) for cos(theta) in [0, 1]: 1/3 at theta = 0, smooth there."""
    return polynomial(_sine_excess_polynomial(cosine.dtype), 2 * cosine - 1)


def polynomial(coefficients: tuple[float, ...], x: Tensor) -> Tensor:
    """Sum of coefficients, highest power first, times powers of x (...), by Horner's rule."""
    if torch.compiler.is_compiling():
        total = x * coefficients[0] + coefficients[1]
        for coefficient in coefficients[2:]:
            total = total * x + coefficient
        return total
    total, *rest = _numbers(coefficients, x.dtype, x.device)
    for coefficient in rest:  # one operation a power in place of two
        total = torch.addcmul(coefficient, total, x)
    return total


def quotients(x: Tensor, rows: tuple[tuple[float, float, float], ...]) -> tuple[Tensor, ...]:
    """(a x + b)/(x + c) (...) for each row (a, b, c), in one go."""
    if torch.compiler.is_compiling() or x.numel() > FEW:
        return tuple((a * x + b) / (x + c) for a, b, c in rows)
    a, b, c = _columns(rows, x.ndim, x.dtype, x.device)
    return (torch.addcmul(b, a, x) / (x + c)).unbind(0)


@functools.lru_cache(maxsize=64)
def _columns(
    rows: tuple[tuple[float, ...], ...], ndim: int, dtype: torch.dtype, device: torch.device
) -> tuple[Tensor, ...]:
    """The columns of a table, each (rows, 1, ...) with as many axes as a row and `ndim` more."""
    with torch.inference_mode(False):
        columns = torch.tensor(rows, dtype=dtype, device=device).T.contiguous().unbind()
        return tuple(column.view(-1, *(1,) * ndim) for column in columns)


def in_pieces(compute: Callable[..., tuple[Tensor, ...]], *inputs: Tensor, own: int = 0) -> tuple[Tensor, ...]:
    """compute(*inputs), tensors (...) made pixel by pixel: of an image some pixels at a time.

    Fresh memory costs more than arithmetic; so each step takes the memory of the one before. As a whole where
    derivatives are recorded, which keep the steps, or where shapes differ.

    Args:
        inputs: each (...) with `own` more axes, or those axes alone.
    """
    if torch.compiler.is_compiling():
        return compute(*inputs)
    wide = max(inputs, key=lambda t: t.ndim)
    shape = wide.shape[: wide.ndim - own]
    recorded = torch.is_grad_enabled() and any(t.requires_grad for t in inputs)
    if shape.numel() <= 2 * PIECE or recorded:
        return compute(*inputs)
    if not all(t.ndim == own or (t.shape[: t.ndim - own] == shape and t.is_contiguous()) for t in inputs):
        return compute(*inputs)
    count = -(-shape.numel() // PIECE)
    rows = [[t] * count if t.ndim == own else t.flatten(0, len(shape) - 1).split(PIECE) for t in inputs]
    results = zip(*(compute(*piece) for piece in zip(*rows, strict=True)), strict=True)
    # what none of the wide inputs enters is () in each piece
    return tuple(torch.cat(parts).view(shape) if parts[0].ndim else parts[0] for parts in results)


def number(value: float, like: Tensor) -> Tensor:
    """A number as a tensor () to compute with: a Python number is made one by each operation, for twice its price."""
    if torch.compiler.is_compiling():
        return torch.full((), value, dtype=like.dtype, device=like.device)
    return _numbers((value,), like.dtype, like.device)[0]


@functools.lru_cache(maxsize=256)
def _numbers(values: tuple[float, ...], dtype: torch.dtype, device: torch.device) -> tuple[Tensor, ...]:
    with torch.inference_mode(False):  # made there they could not enter a derivative later
        return tuple(torch.tensor(value, dtype=dtype, device=device) for value in values)


def angle(sine: Tensor, cosine: Tensor) -> Tensor:
    """Angle in [0, pi] from its sine >= 0 and cosine; zero gradient where the sine is 0."""
    flat = sine <= 0
    inside = torch.atan2(sine.masked_fill(flat, 1.0), cosine.masked_fill(flat, 0.0))
    ends = torch.where(cosine < 0, torch.full_like(cosine, np.pi), torch.zeros_like(cosine))
    return torch.where(flat, ends.detach(), inside)


def safe_power(base: Tensor, exponent: Tensor) -> Tensor:
    """base^exponent for base > 0; else 0 with zero gradient, and 1 where the exponent is 0."""
    empty = base <= 0
    value = base.masked_fill(empty, 1.0) ** exponent
    return torch.where(empty, (exponent == 0).to(value), value)


def power_of_complement(deficit: Tensor, exponent: Tensor) -> Tensor:
    """(1 - deficit)^exponent for 0 <= deficit < 1, with all digits of a small deficit; beyond as `safe_power`."""
    empty = deficit >= 1
    value = (exponent * torch.log1p(-deficit.masked_fill(empty, 0.0))).exp()
    return torch.where(empty, (exponent == 0).to(value), value)


def log_cosine_over_sine_squared(cosine: Tensor, sine_squared: Tensor) -> Tensor:
    """log(cos)/sin^2 for cos > 0: -1/2 at 0, without loss of digits there."""
    steep = sine_squared < 0.5
    small = torch.where(steep, sine_squared, torch.full_like(sine_squared, 0.5))
    flat = small <= 0
    near = 0.5 * torch.log1p(-small) / small.masked_fill(flat, 1.0)
    near = torch.where(flat, -0.5 - 0.25 * sine_squared, near)
    far = torch.where(steep, torch.full_like(cosine, 0.5), cosine).log() / sine_squared.masked_fill(steep, 1.0)
    return torch.where(steep, near, far)


def holds(condition: Tensor) -> bool:
    """Whether every entry is true; taken on trust where tensors carry no numbers (compile, vmap)."""
    if torch.compiler.is_compiling():
        return True
    try:
        return bool(condition.all())
    except RuntimeError:  # a batched tensor inside torch.func.vmap cannot be read
        return True
