"""Surfaces of mirror-like facets: the half vector, facet distributions, masking and shadowing.

The half vector comes from the vectors, or from components along the tangent, and keeps its digits. From dot products
alone (`Cosines.from_products`) its inclination is a difference and known to about eps/alpha^2 (relative).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.polynomial import Chebyshev, Polynomial
from torch import Tensor

from torchbrdf._numerics import angle_over_sine, components, dot_of, in_pieces, number, polynomial, safe_divide
from torchbrdf.directions import Cosines
from torchbrdf.quadrature import gauss_legendre_rule
from torchbrdf.v_cavity import mirror_attenuation

# exp(-x^2/2) beyond is below 1e-17 of what lies before.
_GAUSSIAN_END = 9.0
_NODES, _WEIGHTS = gauss_legendre_rule(48)
_NEWTON_STEPS = 6
_BISECTIONS = 54
# T below which Beckmann's Lambda is below 1e-30: nothing is hidden.
_BECKMANN_OPEN = 1 / 64
# Up to this sigma, a little beyond the pi/2 of the models, and of these degrees are the two polynomials in sigma^2 of
# `slope_area_norm`.
_WIDEST = 2.0
_SLOPE_AREA_DEGREES = {torch.float64: (14, 17), torch.float32: (8, 8)}
# sigma^2 below which exp(-pi^2/8 sigma^2) is below 1e-53.
_NOTHING_BEYOND = 0.01
# A tail as exp(-pi u/2) is below the rounding of float64 beyond; unit panels of as many nodes each up to there.
_TAIL_END, _TAIL_NODES = 25, 12


def _up_to_infinity(s2: np.ndarray) -> np.ndarray:
    """Integral of exp(-theta^2/2 s2) sin(theta) over all theta > 0 in units of s2: sum_k (-s2)^k/(2k + 1)!!."""
    total, term = np.zeros_like(s2), np.ones_like(s2)
    for k in range(1, 40):
        total, term = total + term, -term * s2 / (2 * k + 1)
    return total


def _beyond(s2: np.ndarray) -> np.ndarray:
    """The part of it beyond pi/2 over exp(-pi^2/8 s2): the integral of exp(-pi u/2 - s2 u^2/2) cos(s2 u) over u > 0."""
    x, w = (np.array(rule) for rule in gauss_legendre_rule(_TAIL_NODES))
    u, s2 = np.arange(_TAIL_END)[:, None] + x, s2[:, None, None]
    return (w * np.exp(-math.pi / 2 * u - s2 * u * u / 2) * np.cos(s2 * u)).sum((-1, -2))


def _powers(function: Callable[[np.ndarray], np.ndarray], degree: int) -> tuple[float, ...]:
    """Coefficients, highest power first, of a function of sigma^2 on [0, 4]."""
    series = Chebyshev.interpolate(function, degree, domain=[0, _WIDEST**2])
    return tuple(float(k) for k in series.convert(kind=Polynomial, domain=[-1, 1]).coef[::-1])


_SLOPE_AREA = {
    dtype: (_powers(_up_to_infinity, whole), _powers(_beyond, beyond))
    for dtype, (whole, beyond) in _SLOPE_AREA_DEGREES.items()
}


@dataclass(frozen=True)
class HalfVector:
    """The half vector h = (light + view)/|light + view|, as far as facets need it. Finite below the horizon.

    Attributes:
        cos: normal . h (...), in (0, 1]. [-]
        sine_squared: 1 - cos^2 (...), exactly 0 in the mirror direction. [-]
        cos_light: light . h = view . h (...). [-]
        tangent, bitangent: components of h in the surface (...); None when no tangent was given.
    """

    cos: Tensor
    sine_squared: Tensor
    cos_light: Tensor
    tangent: Tensor | None = None
    bitangent: Tensor | None = None

    @classmethod
    def of(cls, cosines: Cosines) -> "HalfVector":
        up = cosines.light + cosines.view
        if cosines.tangent is not None:
            return cls(*in_pieces(_along_tangent, *cosines.tangent_plane, up))
        if cosines.vectors is not None:
            (flat,) = in_pieces(_planar_squared, *cosines.vectors, own=1)
            flat = flat * cosines.lit
            squared = torch.addcmul(flat, up, up)
        else:
            # rounding can leave |l + v|^2 below the square of its own component along the normal
            squared = torch.maximum(2 * (1 + cosines.phase), up * up)
            flat = squared - up * up
        length = squared.sqrt()
        return cls(up / length, flat / squared, length / 2)

    def tilt_squared(self) -> Tensor:
        """Squared angle between normal and half vector (...). [rad^2]"""
        ratio = angle_over_sine(self.cos)
        return self.sine_squared * (ratio * ratio)

    def stretched(self, alpha_x: Tensor, alpha_y: Tensor) -> Tensor:
        """(h_x/alpha_x)^2 + (h_y/alpha_y)^2 (...). Raises ValueError without a tangent."""
        if self.tangent is None or self.bitangent is None:
            raise ValueError("an anisotropic distribution needs a tangent: pass tangent=... to Cosines.of.")
        return (self.tangent / alpha_x) ** 2 + (self.bitangent / alpha_y) ** 2


def _along_tangent(
    light_tangent: Tensor, light_bitangent: Tensor, view_tangent: Tensor, view_bitangent: Tensor, up: Tensor
) -> tuple[Tensor, ...]:
    """The half vector from a `TangentPlane` and the part of light + view along the normal, each (...)."""
    along, across = light_tangent + view_tangent, light_bitangent + view_bitangent
    flat = torch.addcmul(along * along, across, across)
    squared = torch.addcmul(flat, up, up)
    length = squared.sqrt()
    return up / length, flat / squared, length / 2, along / length, across / length


def _planar_squared(normal: Tensor, light: Tensor, view: Tensor) -> tuple[Tensor]:
    """Squared length of the part of light + view along the surface (...)."""
    n, s, v = components(normal), components(light), components(view)
    total = s[0] + v[0], s[1] + v[1], s[2] + v[2]
    along = dot_of(total, n)
    x, y, z = (torch.addcmul(t, along, axis, value=-1) for t, axis in zip(total, n, strict=True))
    return (dot_of((x, y, z), (x, y, z)),)


def v_cavity_masking(cosines: Cosines, half: HalfVector) -> Tensor:
    r"""Share of a facet of a symmetric V-cavity that is lit and seen, when it mirrors light into view.

    .. math:: G = \min\Big(1, \frac{2 (n \cdot h) \min(n \cdot l, n \cdot v)}{l \cdot h}\Big)

    Returns: G (...), in (0, 1]. [-] 1 in the exact mirror direction.
    Deviations: the Oren-Nayar texts print Max for the outer bracket; the derivation, and energy, ask for Min.
    Source: Torrance & Sparrow 1967, "Theory for off-specular reflection from roughened surfaces", DOI
        10.1364/JOSA.57.001105; Oren & Nayar 1994, eqs. (33), (38) of the long version (`v_cavity`).
    """
    return mirror_attenuation(half.cos_light, cos_alpha=cosines.alpha, cos_facet=half.cos)


def slope_area_norm(sigma: Tensor) -> Tensor:
    r"""Solid angle (...) by which exp(-theta^2/2 sigma^2) over the hemisphere is normalised.

    .. math::
        1/c = 2 \pi \int_0^{\pi/2} e^{-\theta^2/2\sigma^2} \sin\theta\, d\theta
            = 2 \pi \sigma^2 [d(\sigma^2) - e^{-\pi^2/8\sigma^2} h(\sigma^2)]

    with d the integral to infinity over sigma^2, and h what lies beyond pi/2 of it (`_beyond`): two smooth functions,
    by polynomials. Relative error below 1e-14 in float64 and 4e-7 in float32 for sigma [rad] in (0, 2]; 2 pi sigma^2,
    the usual shortcut, is 9 % off at 0.5. [sr] Gradients of all orders.
    """
    s2 = sigma * sigma
    whole, beyond = (polynomial(coefficients, s2) for coefficients in _SLOPE_AREA[sigma.dtype])
    share = (number(-(math.pi**2) / 8, s2) / s2.clamp(min=_NOTHING_BEYOND)).exp()
    return number(2 * math.pi, s2) * s2 * (whole - share * beyond)


def _slope_area_integral(sigma: Tensor, end: Tensor) -> Tensor:
    """2 pi/sigma^2 times the integral of exp(-theta^2/2 sigma^2) sin(theta) from 0 to end [rad] (...)."""
    nodes, weights = sigma.new_tensor(_NODES), sigma.new_tensor(_WEIGHTS)
    s = sigma[..., None]
    last = (end[..., None] / s).clamp(max=_GAUSSIAN_END)
    x = last * nodes
    integrand = (-0.5 * x * x).exp() * x * torch.sinc(s * x / math.pi)
    return (2 * math.pi * weights * last * integrand).sum(-1)


def slope_area_angle(u: Tensor, sigma: Tensor) -> Tensor:
    """Facet angle (...) [rad] below which a share u (...) in [0, 1) of `slope_area` lies: its inverse integral.

    Newton's method in the square of the angle, in which the integral is nearly that of an exponential.
    """
    s2 = sigma * sigma
    right = torch.full_like(u, math.pi / 2)
    total = _slope_area_integral(sigma.expand_as(u), right)
    end = (math.pi**2 / 4 / s2).clamp(max=_GAUSSIAN_END**2).expand_as(u)
    y = -2 * torch.log1p(u * torch.expm1(-end / 2))  # (theta/sigma)^2, exact where sin(theta) = theta
    for _ in range(_NEWTON_STEPS):
        theta = y.sqrt() * sigma
        slope = math.pi * (-y / 2).exp() * torch.sinc(theta / math.pi)
        step = (_slope_area_integral(sigma.expand_as(u), theta) - u * total) / slope
        y = torch.minimum((y - step).relu(), end)
    return y.sqrt() * sigma


def visible_azimuth(u: Tensor, slope: Tensor) -> Tensor:
    """Azimuth from the view (...) [rad] of density clip(1 + slope cos(phi), 0, 2)/(2 pi): V-cavity facets in sight.

    `slope` is tan(facet angle) tan(view angle) (...) >= 0. By bisection, to rounding.
    """
    side = torch.where(u < 0.5, torch.ones_like(u), -torch.ones_like(u))
    target = math.pi * torch.where(u < 0.5, 2 * u, 2 * u - 1)
    # beyond the edge the partner is out of sight and the facet takes its light: density 2, or 0
    edge = torch.where(slope > 1, torch.acos(1 / slope.clamp(min=1.0)), torch.zeros_like(slope))
    low, high = edge, math.pi - edge
    offset = edge - slope * edge.sin()
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        early = middle + slope * middle.sin() + offset < target
        low, high = torch.where(early, middle, low), torch.where(early, high, middle)
    return side * torch.where(target < 2 * edge, target / 2, (low + high) / 2)


def slope_area(half: HalfVector, *, sigma: Tensor) -> Tensor:
    r"""Share of projected area per solid angle of facet normals, :math:`P = c\,e^{-\theta^2/2\sigma^2}` (...). [1/sr]

    Args:
        sigma: roughness (...). [rad] > 0
    Source: Torrance & Sparrow 1967 (`v_cavity_masking`); slope-area convention of Oren & Nayar 1994, eqs. (6), (26).
    """
    return (-0.5 * half.tilt_squared() / (sigma * sigma)).exp() / slope_area_norm(sigma)


def ggx_distribution(half: HalfVector, *, alpha: Tensor) -> Tensor:
    r"""Facets per area and solid angle, :math:`D = \frac{1}{\pi \alpha^2 (\sin^2/\alpha^2 + \cos^2)^2}` (...). [1/sr]

    Source: Trowbridge & Reitz 1975, "Average irregularity representation of a rough surface for ray reflection", DOI
        10.1364/JOSA.65.000531; Walter, Marschner, Li & Torrance 2007, "Microfacet models for refraction through rough
        surfaces", DOI 10.2312/EGWR/EGSR07/195-206, eq. (33).
    """
    return _ggx(half, half.sine_squared / (alpha * alpha), alpha * alpha)


def anisotropic_ggx_distribution(half: HalfVector, *, alpha_x: Tensor, alpha_y: Tensor) -> Tensor:
    """`ggx_distribution` with widths alpha_x along the tangent and alpha_y across it (...). [1/sr]"""
    return _ggx(half, half.stretched(alpha_x, alpha_y), alpha_x * alpha_y)


def _ggx(half: HalfVector, stretched: Tensor, area: Tensor) -> Tensor:
    q = stretched + half.cos * half.cos
    return (number(math.pi, area) * area * (q * q)).reciprocal()


def beckmann_distribution(half: HalfVector, *, alpha: Tensor) -> Tensor:
    r"""Facets per area and solid angle, :math:`D = \frac{e^{-\tan^2/\alpha^2}}{\pi \alpha^2 \cos^4}` (...). [1/sr]

    Source: Beckmann & Spizzichino 1963, The Scattering of Electromagnetic Waves from Rough Surfaces; Cook & Torrance
        1982, "A reflectance model for computer graphics", DOI 10.1145/357290.357293.
    """
    return _beckmann(half, half.sine_squared / (alpha * alpha), alpha * alpha)


def anisotropic_beckmann_distribution(half: HalfVector, *, alpha_x: Tensor, alpha_y: Tensor) -> Tensor:
    """`beckmann_distribution` with widths alpha_x along the tangent and alpha_y across it (...). [1/sr]"""
    return _beckmann(half, half.stretched(alpha_x, alpha_y), alpha_x * alpha_y)


def _beckmann(half: HalfVector, stretched: Tensor, area: Tensor) -> Tensor:
    cos_squared = half.cos * half.cos
    # in one exponent: cos^-4 overflows where the exponential has long vanished
    return (-stretched / cos_squared - 2 * cos_squared.log()).exp() / area / math.pi


def ggx_lambda(slope_squared: Tensor) -> Tensor:
    r"""Smith's Lambda of GGX: shadowed over lit area, :math:`T / 2 (1 + \sqrt{1 + T})` (...). [-]

    Args:
        slope_squared: T = (alpha tan(theta))^2, or its anisotropic form (...). [-] >= 0
    """
    return slope_squared / (2 * (1 + (1 + slope_squared).sqrt()))


def beckmann_lambda(slope_squared: Tensor) -> Tensor:
    r"""Smith's Lambda of Beckmann: :math:`\tfrac12 e^{-a^2} (1/a\sqrt\pi - \mathrm{erfcx}(a))`, a = T^-1/2 (...). [-]

    Args:
        slope_squared: T = (alpha tan(theta))^2, or its anisotropic form (...). [-] >= 0
    """
    t = slope_squared.clamp(min=_BECKMANN_OPEN)
    root = t.sqrt()
    # e^-a^2 erfcx(a) = erfc(a): the difference is known to the rounding of 1, which Lambda is added to
    return 0.5 * ((-1 / t).exp() * root * (1 / math.sqrt(math.pi)) - torch.erfc(1 / root))


def smith_correlated(cosines: Cosines, half: HalfVector, lambda_light: Tensor, lambda_view: Tensor) -> Tensor:
    """Masking and shadowing by one height field: 1/(1 + Lambda_l + Lambda_v) (...). [-]"""
    return (1 + lambda_light + lambda_view).reciprocal()


def smith_separable(cosines: Cosines, half: HalfVector, lambda_light: Tensor, lambda_view: Tensor) -> Tensor:
    """Masking and shadowing as if independent: the product of both (...). [-]"""
    return ((1 + lambda_light) * (1 + lambda_view)).reciprocal()


def v_cavities(cosines: Cosines, half: HalfVector, lambda_light: Tensor, lambda_view: Tensor) -> Tensor:
    """`v_cavity_masking` in the place of Smith's functions (...). [-]"""
    return v_cavity_masking(cosines, half)


Masking = Callable[[Cosines, HalfVector, Tensor, Tensor], Tensor]


def tangent_squared(cosine: Tensor) -> Tensor:
    """tan^2 of a polar angle with cosine > 0 (...)."""
    return safe_divide(((1 - cosine) * (1 + cosine)).relu(), cosine * cosine, where=cosine > 0)
