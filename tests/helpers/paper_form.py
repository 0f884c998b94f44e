"""(27), (28) and (30) of the paper as printed, in angles; (19) by its strings."""

import math
from itertools import product

import mpmath
import torch

PI = math.pi
NORMAL = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)


def by_angles(theta_i, theta_r, dphi, rho, sigma, *, m=math):
    """(27) and (28) as printed, direct and interreflected part. `m`: math, or mpmath."""
    alpha, beta = max(theta_i, theta_r), min(theta_i, theta_r)
    c, s2 = m.cos(dphi), sigma**2
    c1 = 1 - s2 / (2 * (s2 + 0.33))
    c2 = 0.45 * s2 / (s2 + 0.09) * (m.sin(alpha) if c >= 0 else m.sin(alpha) - (2 * beta / m.pi) ** 3)
    c3 = 0.125 * (s2 / (s2 + 0.09)) * (4 * alpha * beta / m.pi**2) ** 2
    direct = rho / m.pi * (c1 + c * c2 * m.tan(beta) + (1 - abs(c)) * c3 * m.tan((alpha + beta) / 2))
    bounce = 0.17 * rho**2 / m.pi * s2 / (s2 + 0.13) * (1 - c * (2 * beta / m.pi) ** 2)
    return direct, bounce


def qualitative_by_angles(theta_i, theta_r, dphi, rho, sigma, *, constant=0.33):
    """(30) as printed; footnote 7 puts 0.57 in place of 0.33."""
    a = 1 - 0.5 * sigma**2 / (sigma**2 + constant)
    b = 0.45 * sigma**2 / (sigma**2 + 0.09)
    alpha, beta = max(theta_i, theta_r), min(theta_i, theta_r)
    return rho / PI * (a + b * max(0.0, math.cos(dphi)) * math.sin(alpha) * math.tan(beta))


def direction(theta, phi=0.0):
    return [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]


def crossed_strings(hidden_light, hidden_view, slope):
    """IF of (19) between the lit strip [m_s, 1] of one facet and the visible one [m_v, 1] of the other, by Hottel."""
    with mpmath.workdps(40):
        turn = mpmath.cos(2 * mpmath.mpf(slope))

        def string(x, y):
            return mpmath.sqrt(x * x + 2 * x * y * turn + y * y)

        light, view = mpmath.mpf(hidden_light), mpmath.mpf(hidden_view)
        return float(mpmath.pi / 2 * (string(1, light) + string(view, 1) - string(1, 1) - string(light, view)))


ANGLES = [0.0, 0.2, 0.7, 1.2, math.radians(85)]
AZIMUTHS = [0.0, 0.6, PI / 2, 2.5, PI, -2.0, 3.5]
CONFIGURATIONS = list(product(ANGLES, ANGLES, AZIMUTHS))
SIGMAS = [0.0, 0.1, 0.5, 1.2]


def directions_of(configurations):
    light = torch.tensor([direction(i) for i, _, _ in configurations], dtype=torch.float64)
    view = torch.tensor([direction(r, dphi) for _, r, dphi in configurations], dtype=torch.float64)
    return NORMAL, light, view
