"""The He-Torrance equations as printed (repaired), with vectors, roots and sums: written apart from the library."""

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import erfc, gammaln

Z = np.array([0.0, 0.0, 1.0])


class Surface(NamedTuple):
    sigma0: float
    tau: float
    wavelength: float
    index: complex


def polar(theta: float, phi: float) -> np.ndarray:
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def hidden(theta: float, surface: Surface) -> float:
    """K of (82)."""
    return math.tan(theta) * erfc(surface.tau / (2 * surface.sigma0 * math.tan(theta)))


def z0(k_sum: float, sigma0: float) -> float:
    """Root of (81) by bracketing."""

    def residual(z):
        return math.sqrt(math.pi / 2) * z - sigma0 / 4 * k_sum * math.exp(-(z**2) / (2 * sigma0**2))

    return brentq(residual, 0.0, sigma0 * (1 + k_sum), xtol=1e-300, rtol=1e-15)


def smith(theta: float, surface: Surface) -> float:
    """S_1 of (24), (25)."""
    b = surface.tau / (2 * surface.sigma0 * math.tan(theta))
    shadow = 0.5 * (math.exp(-b * b) / (math.sqrt(math.pi) * b) - erfc(b))
    return (1 - 0.5 * erfc(b)) / (1 + shadow)


def series(g: float, t: float) -> float:
    """Sum of (78), term by term in logarithms."""
    m = np.arange(1, int(2 * g + 60 * math.sqrt(g) + 20 * t ** (2 / 3) + 200), dtype=float)
    return float(np.exp(m * math.log(g) - g - gammaln(m + 1) - np.log(m) - t / m).sum())


def amplitudes(cos: float, index: complex) -> tuple[complex, complex]:
    """F_s and F_p by Snell's law."""
    across = np.sqrt(complex(index) ** 2 - (1 - cos**2))
    f_s = (cos - across) / (cos + across)
    f_p = (index**2 * cos - across) / (index**2 * cos + across)
    return f_s, f_p


def printed(light: np.ndarray, view: np.ndarray, surface: Surface) -> tuple[float, np.ndarray]:
    """The lobe of a perfect reflector [1/sr] and the Jones matrix J = -M/N2 of (61)-(65), for the normal z."""
    k_i, k_r = -light, view
    k = 2 * math.pi / surface.wavelength
    v = k * (k_r - k_i)
    angles = [math.acos(d[2]) for d in (light, view)]
    sigma = surface.sigma0 / math.sqrt(
        1 + (z0(sum(hidden(a, surface) for a in angles), surface.sigma0) / surface.sigma0) ** 2
    )
    shadow = math.prod(smith(a, surface) for a in angles)
    g = (k * sigma * (light[2] + view[2])) ** 2
    t = (v[0] ** 2 + v[1] ** 2) * surface.tau**2 / 4
    d = math.pi**2 * surface.tau**2 / (4 * surface.wavelength**2) * series(g, t)
    s_i, s_r = (np.cross(a, Z) / np.linalg.norm(np.cross(a, Z)) for a in (k_i, k_r))
    p_i, p_r = np.cross(s_i, k_i), np.cross(s_r, k_r)
    n2 = np.linalg.norm(np.cross(k_r, k_i)) ** 2
    bracket = ((s_r @ k_i) ** 2 + (p_r @ k_i) ** 2) * ((s_i @ k_r) ** 2 + (p_i @ k_r) ** 2)
    geometry = (v @ v / v[2] / k) ** 2 / n2**2 * bracket
    lobe = geometry * shadow * d / (math.pi * light[2] * view[2])
    f_s, f_p = amplitudes(float(np.linalg.norm(k_r - k_i)) / 2, surface.index)
    a, b, c, e = s_i @ k_r, p_i @ k_r, s_r @ k_i, p_r @ k_i
    m = np.array(
        [
            [f_s * b * e + f_p * a * c, -(f_s * a * e - f_p * b * c)],
            [-(f_s * b * c - f_p * a * e), f_s * a * c + f_p * b * e],
        ]
    )
    return lobe, -m / n2
