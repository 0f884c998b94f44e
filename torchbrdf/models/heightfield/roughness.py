"""Two names for one width: sigma of the Oren-Nayar models and the rms slope of a Gaussian heightfield.

Both describe how far facets tilt; they are the same roughness where the mean square slope angle is the same,

    int r exp(-r^2/2) atan(s r)^2 dr = E[theta^2] under exp(-theta^2/2 sigma^2) sin(theta) on [0, pi/2].

s/sigma is a smooth, even function of sigma, and sigma/s of s. Each is solved for once, as a Chebyshev series in
x^2/(x^2 + knee^2): differentiable to every order, without iterations.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import torch
from numpy.polynomial import Chebyshev
from torch import Tensor

from torchbrdf._constants import constant
from torchbrdf.parameters import ROUGHNESS, Interval
from torchbrdf.quadrature import gauss_legendre_rule

_DEGREE = 64  # of the series: their last coefficients are below 1e-13
_KNEE = 0.8  # of both variables: the smallest coefficients for both series
_NODES = 96
_WIDTH = 9.0  # standard deviations of a slope: r exp(-r^2/2) is below the rounding of float64 beyond
_NEWTON_STEPS = 12


def _mean_square_angle_of_slopes(slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """E[theta^2] of Gaussian slopes of rms `slope` per axis, and its derivative by the slope. [rad^2]"""
    x, w = (np.array(rule) for rule in gauss_legendre_rule(_NODES))
    u = x * np.arcsinh(_WIDTH)  # r = sinh(u) moves the poles of atan(s r) away from the axis
    r, weight = np.sinh(u), w * np.arcsinh(_WIDTH) * np.cosh(u)
    mass = weight * r * np.exp(-r * r / 2)
    steep = slope[:, None] * r
    return (mass * np.arctan(steep) ** 2).sum(-1), (mass * 2 * np.arctan(steep) * r / (1 + steep**2)).sum(-1)


def _mean_square_angle_of_sigma(sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """E[theta^2] under exp(-theta^2/2 sigma^2) sin(theta), and its derivative by sigma. [rad^2]"""
    x, w = (np.array(rule) for rule in gauss_legendre_rule(_NODES))
    top = np.minimum(math.pi / 2, _WIDTH * sigma)[:, None]
    theta = x * top
    mass = w * top * np.exp(-((theta / sigma[:, None]) ** 2) / 2) * np.sin(theta)
    mass = mass / mass.sum(-1, keepdims=True)
    second, fourth = (mass * theta**2).sum(-1), (mass * theta**4).sum(-1)
    return second, (fourth - second * second) / sigma**3


def _solved(target: np.ndarray, start: np.ndarray, moment: Callable) -> np.ndarray:
    """Where the root mean square angle of `moment` is `target`, by Newton's method: it is nearly linear."""
    x = start
    for _ in range(_NEWTON_STEPS):
        value, slope = moment(x)
        root = np.sqrt(value)
        x = x - (root - target) * 2 * root / slope
    return x


def _share(x):
    """x^2/(x^2 + knee^2), the variable of the series."""
    return x * x / (x * x + _KNEE * _KNEE)


def _series_of(ratio: Callable[[np.ndarray], np.ndarray], top: float) -> tuple[float, ...]:
    """Chebyshev coefficients of ratio(x), x in [0, top], in 2 share(x)/share(top) - 1."""

    def in_variable(v: np.ndarray) -> np.ndarray:
        share = _share(top) * (1 + v) / 2
        return ratio(_KNEE * np.sqrt(share / (1 - share)))

    return tuple(Chebyshev.interpolate(in_variable, _DEGREE).coef.tolist())


def _slope_of(sigma: np.ndarray) -> np.ndarray:
    return _solved(np.sqrt(_mean_square_angle_of_sigma(sigma)[0]), 0.9 * sigma, _mean_square_angle_of_slopes)


def _sigma_of(slope: np.ndarray) -> np.ndarray:
    return _solved(np.sqrt(_mean_square_angle_of_slopes(slope)[0]), slope, _mean_square_angle_of_sigma)


LARGEST_RMS_SLOPE = float(_slope_of(np.array([math.pi / 2]))[0])  # 1.482: sigma ends at 90 degrees
RMS_SLOPE = Interval(0.0, LARGEST_RMS_SLOPE, even=True)


@constant
@lru_cache(maxsize=1)
def _slope_series() -> tuple[float, ...]:
    return _series_of(lambda sigma: _slope_of(sigma) / sigma, ROUGHNESS.high)


@constant
@lru_cache(maxsize=1)
def _sigma_series() -> tuple[float, ...]:
    return _series_of(lambda slope: _sigma_of(slope) / slope, LARGEST_RMS_SLOPE)


def _chebyshev(coefficients: tuple[float, ...], x: Tensor) -> Tensor:
    """Sum of a Chebyshev series at x (...), by Clenshaw's recurrence."""
    ahead, here = torch.zeros_like(x), torch.zeros_like(x)
    for c in reversed(coefficients[1:]):
        ahead, here = here, 2 * x * here - ahead + c
    return x * here - ahead + coefficients[0]


def rms_slope_from_sigma(sigma: Tensor) -> Tensor:
    """Rms slope s per axis (...) of the Gaussian heightfield as rough as sigma (...) in [0, pi/2] [rad]. [-]

    s = sigma (1 + O(sigma^2)); s = 1.482 at sigma = pi/2. Raises ValueError outside the domain.

    >>> rms_slope_from_sigma(torch.deg2rad(torch.tensor([10.0, 30.0, 90.0])))
    tensor([0.1807, 0.6700, 1.4820])
    """
    ROUGHNESS.check("rms_slope_from_sigma: sigma", sigma)
    # At least 1-D inside: forward differentiation of "number * 0-d float32 tensor" yields float64.
    x = torch.atleast_1d(sigma)
    ratio = _chebyshev(_slope_series(), 2 / _share(ROUGHNESS.high) * _share(x) - 1)
    return (x * ratio).reshape(sigma.shape)


def sigma_from_rms_slope(rms_slope: Tensor) -> Tensor:
    """Roughness sigma (...) [rad] of the Oren-Nayar models as rough as a Gaussian heightfield of rms slope s per axis.

    The inverse of `rms_slope_from_sigma`. Raises ValueError outside [0, 1.482]: no sigma is rougher than pi/2.
    """
    RMS_SLOPE.check("sigma_from_rms_slope: rms_slope", rms_slope)
    x = torch.atleast_1d(rms_slope)
    ratio = _chebyshev(_sigma_series(), 2 / _share(LARGEST_RMS_SLOPE) * _share(x) - 1)
    return (x * ratio).reshape(rms_slope.shape)


def rms_slope_from_beckmann_alpha(alpha: Tensor) -> Tensor:
    """Rms slope per axis alpha/sqrt(2) (...) of Beckmann's distribution, which is this Gaussian: exact. [-]"""
    return alpha / math.sqrt(2)
