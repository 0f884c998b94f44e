r"""The D series S(g, t) far from its first terms: a saddle-point expansion, uniform in t, with its derivatives.

The largest term of S = sum_m g^m e^-g/(m! m) e^(-t/m) lies at

.. math:: m = g\,e^{w/2}, \quad w\,e^w = 2t/g^2

and with v = 1/(1 + w), y = 1/m the sum is

.. math::
    S = e^\Phi\,y\,\sqrt v\,P(v, y), \quad \Phi = -\frac tm - m\left(e^{-w/2} - 1 + \frac w2\right), \quad
    P = 1 + \sum_k a_k(v)\,y^k.

Multiplying by g d/dg + g turns g^m e^-g into m g^m e^-g, and -d/dt turns e^(-t/m) into e^(-t/m)/m, so that
(g d/dg + g)(-d/dt) S = S. The envelope theorem (dPhi/dt = -y, dPhi/dg = m/g - 1) makes of it the recurrence

.. math::
    a_{k+1}' = \frac b2 + \frac{(k+2)\,b}{2v} - (1 - v)\,b', \quad b = ((k + 1)\,v + v^2)\,a_k + 2 v^3 a_k'

with a_k(1) = k!, the values at t = 0. It gives every order exactly; derivatives of S/g stay of the form e^Phi times a
polynomial in v, y and e = m - g, so that they are as accurate as S itself.
"""

import functools
import math

import torch
from numpy.polynomial import Polynomial
from torch import Tensor

from torchbrdf.models.he_torrance.roughness import lambert_w

_V = Polynomial([0.0, 1.0])
# w = 65 at this x: terms beyond m = 30 are then below e^-1900, which is 0 in float64 too.
_LARGEST_X = 1e30


def expansion(g: Tensor, t: Tensor, orders: list[tuple[int, int]], *, degree: int) -> list[Tensor]:
    """Derivatives of S/g, n times by g and q times by t for each (n, q) of the orders, (...).

    Args:
        g, t: (...), with the largest term at m above 30, so that g > 0.
        orders: n + q <= 2.
        degree: highest power of 1/m. The relative error is about a_(degree + 1)/m^(degree + 1).
    """
    w = lambert_w((2 * (t / g) / g).clamp(max=_LARGEST_X))
    m = (g * (w / 2).exp()).clamp(min=1.0)
    v, y = 1 / (1 + w), 1 / m
    exponent = -t / m - m * (torch.expm1(-w / 2) + w / 2)
    scale = exp_or_zero(exponent) * y * v.sqrt() / g
    means = []
    for n, q in orders:
        P = [_evaluate(_polynomials(degree, i, q), v, y) for i in range(n + 1)]
        value = scale * P[0]
        if n > 0:
            e = g * torch.expm1(w / 2)
            value = scale / g * (e * P[0] + P[1])
            if n > 1:
                value = scale / g**2 * ((e**2 - m * w * v) * P[0] + (2 * e - 1) * P[1] + P[2])
        means.append(value)
    return means


def exp_or_zero(x: Tensor) -> Tensor:
    """exp(x) in place of x, and 0 where it would be below the smallest normal number: those are 30 times slower."""
    return torch.threshold_(x, math.log(torch.finfo(x.dtype).tiny), -math.inf).exp_()


@functools.cache
def coefficients(degree: int) -> tuple[Polynomial, ...]:
    """a_0 = 1 to a_degree as polynomials in v."""
    polynomials = [Polynomial([1.0])]
    for k in range(degree):
        b = _lowered(polynomials[k], k)
        rising = (b / 2 + (k + 2) / 2 * (b // _V) - (1 - _V) * b.deriv()).integ()
        polynomials.append(rising + (math.factorial(k + 1) - rising(1.0)))
    return tuple(polynomials)


def _lowered(a: Polynomial, k: int) -> Polynomial:
    """b of the recurrence: what -d/dt makes of a(v) y^k in S, beyond y^(k + 1) a, is y^(k + 2) b."""
    return ((k + 1) * _V + _V**2) * a + 2 * _V**3 * a.deriv()


@functools.cache
def _polynomials(degree: int, n: int, q: int) -> tuple[tuple[float, ...], ...]:
    """Coefficients [power of y][power of v] of G^n T^q P.

    T P is what d/dt makes of P in S/g. G P is what g d/dg does apart from its action on Phi and from e.
    Powers of y above degree + q are incomplete and left out.
    """
    rows = list(coefficients(degree))
    for _ in range(q):
        before, rows = rows, [Polynomial([0.0])] * (len(rows) + 2)
        for k, a in enumerate(before):
            rows[k + 1] = rows[k + 1] - a
            rows[k + 2] = rows[k + 2] - _lowered(a, k)
    for _ in range(n):
        rows = [2 * (1 - _V) * _V**2 * a.deriv() - (1 + k * _V + _V**2) * a for k, a in enumerate(rows)]
    return tuple(tuple(float(c) for c in a.trim().coef) for a in rows[: degree + q + 1])


def _evaluate(rows: tuple[tuple[float, ...], ...], v: Tensor, y: Tensor) -> Tensor:
    total = torch.zeros_like(v)
    for row in reversed(rows):
        inner = torch.full_like(v, row[-1])
        for coefficient in reversed(row[:-1]):
            inner.mul_(v).add_(coefficient)
        total.mul_(y).add_(inner)
    return total
