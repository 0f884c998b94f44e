"""exp, log and the scaled complementary error function in LLVM's text: arithmetic vectorises, calls do not.

Right to a few units in the last digit over the whole range of their arguments, as `tests` measures.
"""

import math
import struct
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import torch
from numpy.polynomial import Chebyshev, Polynomial

# (1 + 2 x) exp(x^2) erfc(x) is smooth in (x - K)/(x + K) from 0 to infinity (Shepherd & Laframboise 1981, "Chebyshev
# approximation of (1 + 2x) exp(x^2) erfc x in 0 <= x < inf", Mathematics of Computation 36, 249-253).
_K = 3.75


class Real(NamedTuple):
    """A floating-point type as LLVM knows it.

    Attributes:
        name: of the type.
        bits: of a number.
        mantissa: stored bits of the mantissa.
        bias: of the exponent.
        exp_terms: of the exponential series up to log(2)/2, until the next changes nothing.
        log_terms: of the series of the inverse hyperbolic tangent up to 3 - 2 sqrt(2), likewise.
        erfc_degree: of the polynomial of the complementary error function, likewise.
        steepest: exponents between which exp is neither 0 nor infinite.
        coarse: log(2) to so few digits that its product with an exponent is exact.
    """

    name: str
    bits: int
    mantissa: int
    bias: int
    exp_terms: int
    log_terms: int
    erfc_degree: int
    steepest: tuple[float, float]
    coarse: float


REALS = {
    torch.float32: Real("float", 32, 23, 127, 8, 5, 11, (-104.0, 89.0), math.floor(math.log(2) * 2**9) / 2**9),
    torch.float64: Real("double", 64, 52, 1023, 14, 11, 20, (-746.0, 710.0), math.floor(math.log(2) * 2**32) / 2**32),
}
_LOG_2_REST = 1.9082149292705877e-10  # log(2) - 0x1.62e42feep-1, more digits than the difference of doubles has


def literal(value: float, real: Real) -> str:
    """The number nearest to a value: LLVM writes both types by the bits of a double."""
    if real.bits == 32 and math.isfinite(value):
        value = struct.unpack("f", struct.pack("f", value))[0]
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"


def bits(value: float, real: Real) -> int:
    """The bits of the number nearest to a value, read as a whole number."""
    whole, number = ("i", "f") if real.bits == 32 else ("q", "d")
    return struct.unpack(whole, struct.pack(number, value))[0]


class _Text:
    """Instructions that lead to one result."""

    def __init__(self, result: str, real: Real):
        self.lines: list[str] = []
        self.real, self.kind, self.whole = real, real.name, f"i{real.bits}"
        self._result = result

    def number(self, value: float) -> str:
        return literal(value, self.real)

    def made(self, instruction: str) -> str:
        name = f"{self._result}_{len(self.lines)}"
        self.lines.append(f"{name} = {instruction}")
        return name

    def op(self, operation: str, a: str, b: str, *, contract: bool = True) -> str:
        return self.made(f"{operation}{' contract' if contract else ''} {self.kind} {a}, {b}")

    def integer(self, operation: str, a: str, b: str | int) -> str:
        return self.made(f"{operation} {self.whole} {a}, {b}")

    def chosen(self, condition: str, a: str, b: str, yes: str, no: str) -> str:
        """yes where a compares so with b, else no."""
        truth = self.made(f"fcmp {condition} {self.kind} {a}, {b}")
        return self.made(f"select i1 {truth}, {self.kind} {yes}, {self.kind} {no}")

    def bits_of(self, x: str) -> str:
        return self.made(f"bitcast {self.kind} {x} to {self.whole}")

    def of_bits(self, n: str) -> str:
        return self.made(f"bitcast {self.whole} {n} to {self.kind}")

    def polynomial(self, coefficients: Sequence[float], x: str) -> str:
        """Lowest power first."""
        *rest, highest = coefficients
        total = self.number(highest)
        for coefficient in reversed(rest):
            total = self.op("fadd", self.op("fmul", total, x), self.number(coefficient))
        return total

    def times_log_2(self, n: str, x: str) -> tuple[str, str]:
        """x - n log(2) in steps that keep its digits, and what was left out of the first: to be added for the log."""
        coarse = self.op("fmul", n, self.number(self.real.coarse))
        fine = self.op("fmul", n, self.number(self._fine))
        return self.op("fsub", self.op("fsub", x, coarse), fine), coarse

    @property
    def _fine(self) -> float:
        return math.log(2) - self.real.coarse if self.real.bits == 32 else _LOG_2_REST

    def ends_as(self, value: str) -> list[str]:
        """The instructions, the last of which has the name of the result."""
        return [*self.lines, f"{self._result} = select i1 true, {self.kind} {value}, {self.kind} {value}"]


def exponential(result: str, x: str, real: Real) -> list[str]:
    """2^n times the exponential series of the rest."""
    t = _Text(result, real)
    low, high = (t.number(end) for end in real.steepest)
    kept = t.chosen("olt", x, low, low, x)
    kept = t.chosen("ogt", kept, high, high, kept)
    # a sum with it is rounded to a whole number, which its last bits hold
    magic = 1.5 * 2.0**real.mantissa
    held = t.op("fadd", t.op("fmul", kept, t.number(1 / math.log(2)), contract=False), t.number(magic))
    rest, _ = t.times_log_2(t.op("fsub", held, t.number(magic), contract=False), kept)
    series = t.polynomial([1 / math.factorial(k) for k in range(real.exp_terms)], rest)
    whole = t.integer("sub", t.bits_of(held), bits(magic, real))
    # 2^n as a product of two, of which neither overflows
    half = t.integer("ashr", whole, 1)
    for n in (half, t.integer("sub", whole, half)):
        power = t.of_bits(t.integer("shl", t.integer("add", n, real.bias), real.mantissa))
        series = t.op("fmul", series, power, contract=False)
    return t.ends_as(series)


def logarithm(result: str, x: str, real: Real) -> list[str]:
    """n log(2) + 2 atanh((m - 1)/(m + 1)) of x = 2^n m; -infinity at 0, NaN below."""
    t = _Text(result, real)
    one, zero = t.number(1.0), t.number(0.0)
    smallest, shift = 2.0 ** (1 - real.bias), real.mantissa + 1
    scaled = t.op("fmul", x, t.number(2.0**shift), contract=False)  # what lies below the normal numbers
    normal = t.chosen("olt", x, t.number(smallest), scaled, x)
    offset = t.chosen("olt", x, t.number(smallest), t.number(float(-shift)), zero)
    shown = t.bits_of(normal)
    n = t.integer("ashr", t.integer("sub", shown, bits(0.5**0.5, real)), real.mantissa)
    m = t.of_bits(t.integer("sub", shown, t.integer("shl", n, real.mantissa)))
    exponent = t.op("fadd", t.made(f"sitofp {t.whole} {n} to {t.kind}"), offset)
    ratio = t.op("fdiv", t.op("fsub", m, one), t.op("fadd", m, one))
    series = t.polynomial([2 / (2 * k + 1) for k in range(real.log_terms)], t.op("fmul", ratio, ratio))
    fine = t.op("fmul", exponent, t.number(t._fine))
    near = t.op("fadd", t.op("fmul", series, ratio), fine)
    value = t.op("fadd", t.op("fmul", exponent, t.number(real.coarse)), near)
    value = t.chosen("oeq", x, zero, t.number(-math.inf), value)
    value = t.chosen("oeq", x, t.number(math.inf), x, value)
    return t.ends_as(t.chosen("olt", x, zero, t.number(math.nan), t.chosen("une", x, x, x, value)))


def scaled_complement(result: str, x: str, real: Real) -> list[str]:
    """exp(x^2) erfc(x) for x >= 0."""
    t = _Text(result, real)
    place = t.op("fdiv", t.op("fsub", x, t.number(_K)), t.op("fadd", x, t.number(_K)))
    growth = t.op("fadd", t.op("fadd", x, x), t.number(1.0))
    return t.ends_as(t.op("fdiv", t.polynomial(_complement_polynomial(real.erfc_degree), place), growth))


@cache
def _complement_polynomial(degree: int) -> tuple[float, ...]:
    """Coefficients, lowest power first, of (1 + 2 x) exp(x^2) erfc(x) in (x - K)/(x + K)."""

    def smooth(place: np.ndarray) -> np.ndarray:
        x = torch.from_numpy(_K * (1 + place) / (1 - place))
        return ((1 + 2 * x) * torch.special.erfcx(x)).numpy()

    return tuple(float(k) for k in Chebyshev.interpolate(smooth, degree).convert(kind=Polynomial).coef)


ELEMENTARY: dict[str, Callable[[str, str, Real], list[str]]] = {
    "exp": exponential,
    "log": logarithm,
    "erfcx": scaled_complement,
}
