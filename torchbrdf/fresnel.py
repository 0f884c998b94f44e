"""Reflectance of a smooth interface, as functions of the cosine of incidence and as modules models are built with."""

import math
from abc import ABC, abstractmethod
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import positive, root, safe_sqrt
from torchbrdf.parameters import (
    ABSORPTION_INDEX,
    ALBEDO,
    REFRACTIVE_INDEX,
    Constrained,
    Interval,
    ParameterValue,
    Parametric,
    fixed,
)
from torchbrdf.quadrature import gauss_legendre

# Relative index of a dielectric seen from either side; total internal reflection below 1.
RELATIVE_INDEX = Interval(0.0, math.inf, trailing=1)


def schlick(cos: Tensor, *, f0: Tensor) -> Tensor:
    r"""Reflectance of a smooth interface, fitted.

    .. math:: F = F_0 + (1 - F_0) (1 - c)^5

    Args:
        cos: cosine c of incidence, broadcasts with f0. [-] in [0, 1]
        f0: reflectance at normal incidence. [-] in [0, 1]
    Returns: F, shapes broadcast. [-]
    Deviations: a fit. Up to 0.05 from `dielectric` at eta = 1.5 (near 80 degrees), more for metals.
    Source: Schlick 1994, "An inexpensive BRDF model for physically-based rendering", DOI 10.1111/1467-8659.1330233.
    """
    return f0 + (1 - f0) * fifth_power(1 - cos)


def fifth_power(x: Tensor) -> Tensor:
    """max(0, x)^5; rounding can leave 1 - cos below 0."""
    x = x.relu()
    squared = x * x
    return squared * squared * x


def f0_from_index(eta: Tensor) -> Tensor:
    """Reflectance at normal incidence from the relative index: ((eta - 1)/(eta + 1))^2."""
    return ((eta - 1) / (eta + 1)) ** 2


def dielectric(cos: Tensor, *, eta: Tensor) -> Tensor:
    r"""Unpolarised reflectance of a smooth interface between transparent media, exact.

    .. math::
        F = \tfrac12 \left[\Big(\frac{c-g}{c+g}\Big)^2 + \Big(\frac{\eta^2 c - g}{\eta^2 c + g}\Big)^2\right],
        \quad g = \sqrt{\eta^2 - 1 + c^2}

    Args:
        cos: cosine c of incidence, broadcasts with eta. [-] in (0, 1]
        eta: index of the far medium relative to the near one. [-] > 0; below 1 light can be reflected totally.
    Returns: F, shapes broadcast. [-] 1, with zero gradient, beyond the critical angle.
    Deviations: none. Both differences are written as products of eta^2 - 1, so that F keeps its digits
        for eta near 1.
    Source: Fresnel's equations, Born & Wolf 1999, Principles of Optics, DOI 10.1017/CBO9781139644181, section 1.5.2;
        with g as in Cook & Torrance 1982, DOI 10.1145/357290.357293.
    """
    contrast = (eta - 1) * (eta + 1)
    g_squared = contrast + cos * cos
    g = safe_sqrt(g_squared)
    eta_squared = eta * eta
    s = contrast / (cos + g) ** 2
    p = contrast * ((eta_squared + 1) * cos * cos - 1) / (eta_squared * cos + g) ** 2
    return (0.5 * (s * s + p * p)).masked_fill(g_squared <= 0, 1.0)


def conductor(cos: Tensor, *, eta: Tensor, k: Tensor) -> Tensor:
    r"""Unpolarised reflectance of a smooth absorbing interface of index eta + i k, exact.

    Real arithmetic: :math:`a + i b = \sqrt{(\eta + i k)^2 - 1 + c^2}`, :math:`s^2 = 1 - c^2`,

    .. math::
        R_s = \frac{(c-a)^2 + b^2}{(c+a)^2 + b^2}, \quad
        R_p = R_s \frac{(c a - s^2)^2 + c^2 b^2}{(c a + s^2)^2 + c^2 b^2}, \quad F = \tfrac12 (R_s + R_p)

    Args:
        cos: cosine c of incidence, broadcasts with eta and k. [-] in (0, 1]
        eta, k: real and imaginary part of the relative index. [-] >= 0
    Returns: F, shapes broadcast. [-]
    Deviations: none; k = 0 is `dielectric`.
    Source: Born & Wolf 1999, Principles of Optics, 7th edition, DOI 10.1017/CBO9781139644181, ch. 14.
    """
    sine_squared = ((1 - cos) * (1 + cos)).relu()
    a_squared, b_squared = _refracted_squares(cos, eta, k)
    a = root(a_squared)
    r_s = ((cos - a) ** 2 + b_squared) / ((cos + a) ** 2 + b_squared)
    absorbed = cos * cos * b_squared
    # R_p/R_s = 1 - 4 c a s^2/(...): also where light falls straight on an index of 0, and both terms of the ratio are 0
    p_below_s = 4 * cos * a * sine_squared / positive((cos * a + sine_squared) ** 2 + absorbed)
    return 0.5 * r_s * (2 - p_below_s)


def conductor_amplitudes(cos: Tensor, *, eta: Tensor, k: Tensor) -> tuple[Tensor, Tensor]:
    r"""Amplitudes of light polarised across (s) and in (p) the plane of incidence, for an index eta + i k.

    .. math::
        F_s = \frac{c - q}{c + q}, \quad F_p = -F_s \frac{c q - s^2}{c q + s^2}, \quad q = \sqrt{(\eta + i k)^2 - s^2}

    Args: as `conductor`.
    Returns: F_s and F_p, complex, shapes broadcast. [-] F_p = -F_s at c = 1: p turns with the ray, for a time factor
        exp(-i w t).
    Deviations: none. (|F_s|^2 + |F_p|^2)/2 is `conductor`.
    Source: Born & Wolf 1999, Principles of Optics, DOI 10.1017/CBO9781139644181, section 1.5.2 with ch. 14.
    """
    q = refracted_cosine(cos, eta, k)
    sine_squared = ((1 - cos) * (1 + cos)).relu()
    s = (cos - q) / (cos + q)
    through = cos * q + sine_squared
    # 1 - 2 s^2/(...), with the smallest normal number for 0/0 where light falls straight on an index of 0
    return s, s * (2 * sine_squared / (through + torch.finfo(cos.dtype).tiny) - 1)


def refracted_cosine(cos: Tensor, eta: Tensor, k: Tensor) -> Tensor:
    """q = sqrt((eta + i k)^2 - 1 + cos^2), complex, in the first quadrant: index times cosine of the refracted ray."""
    a_squared, b_squared = _refracted_squares(cos, eta, k)
    return torch.complex(*torch.broadcast_tensors(safe_sqrt(a_squared), safe_sqrt(b_squared)))


def _refracted_squares(cos: Tensor, eta: Tensor, k: Tensor) -> tuple[Tensor, Tensor]:
    """a^2 and b^2 of a + i b = sqrt((eta + i k)^2 - 1 + cos^2), the smaller without cancellation."""
    real = (eta - 1) * (eta + 1) - k * k + cos * cos
    imaginary = 2 * eta * k
    imaginary_squared = imaginary * imaginary
    modulus = root(real * real + imaginary_squared)
    larger = 0.5 * (modulus + real.abs())
    smaller = imaginary_squared / (4 * positive(larger))
    # chosen by products with 1 and 0, which are exact and take a tenth of the time
    propagating = (real >= 0).to(larger.dtype)
    evanescent = 1 - propagating
    a_squared = torch.addcmul(larger * propagating, smaller, evanescent)
    return a_squared, torch.addcmul(smaller * propagating, larger, evanescent)


def dielectric_average(*, eta: Tensor) -> Tensor:
    r"""Reflectance of a smooth dielectric under uniform light, :math:`2 \int_0^1 F(c)\, c\, dc`, closed form.

    Args:
        eta: relative index. [-] > 1
    Returns: average, shape of eta. [-]
    Raises: ValueError for eta outside [1, inf).
    Deviations: terms of size (eta - 1)^-2 cancel towards eta = 1. Computed in float64 whatever the dtype: relative
        error 1e-13 at 1.5, 1e-9 at 1.01; 0 at eta = 1.
    Source: Walsh 1926, "The reflection factor of a polished glass surface for diffused light".
    """
    REFRACTIVE_INDEX.check("dielectric_average: eta", eta)
    matched = eta <= 1
    n = eta.masked_fill(matched, 2.0).to(torch.float64)
    n2, n4 = n**2, n**4
    average = (
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + n2 * (n2 - 1) ** 2 / (n2 + 1) ** 3 * ((n - 1) / (n + 1)).log()
        - 2 * n**3 * (n2 + 2 * n - 1) / ((n2 + 1) * (n4 - 1))
        + 8 * n4 * (n4 + 1) / ((n2 + 1) * (n4 - 1) ** 2) * n.log()
    )
    return average.to(eta.dtype).masked_fill(matched, 0.0)


class Fresnel(Parametric, ABC):
    """Reflectance of a smooth interface as a part of a BRDF: module from cosines (...) to F (..., channel)."""

    @abstractmethod
    def forward(self, cos: Tensor) -> Tensor:
        """F (..., channel) at the cosine of incidence (...). [-]"""

    @abstractmethod
    def average(self) -> Tensor:
        """F under uniform light, the mean over 2 c dc (..., channel). [-]"""

    def at_every_angle(self) -> "ConstantFresnel | None":
        """Stand-in that reflects as at normal incidence; None where F is the same at every angle anyway."""
        stored = next((t for t in (*self.parameters(), *self.buffers()) if t.is_floating_point()), torch.ones(()))
        value = self(stored.new_ones(())).detach()
        trained = any(p.requires_grad for p in self.parameters())
        return ConstantFresnel(value=value if trained else fixed(value))


@final
class Perfect(Fresnel):
    """Reflects everything: F = 1."""

    def at_every_angle(self) -> None:
        return None

    def forward(self, cos: Tensor) -> Tensor:
        return torch.ones_like(cos)[..., None]

    def average(self) -> Tensor:
        return torch.ones(1)


@final
class ConstantFresnel(Fresnel):
    """The same reflectance at every angle, scalar, (channel,) or (..., channel). [-] in [0, 1]"""

    value: Constrained = Constrained(ALBEDO)

    def __init__(self, *, value: ParameterValue):
        super().__init__()
        self.value = value

    def forward(self, cos: Tensor) -> Tensor:
        return torch.ones_like(cos)[..., None] * torch.atleast_1d(self.value)

    def average(self) -> Tensor:
        return torch.atleast_1d(self.value)

    def at_every_angle(self) -> None:
        return None


@final
class Schlick(Fresnel):
    """`schlick` with reflectance f0 at normal incidence, scalar, (channel,) or (..., channel). [-] in [0, 1]"""

    f0: Constrained = Constrained(ALBEDO)

    def __init__(self, *, f0: ParameterValue = 0.04):
        super().__init__()
        self.f0 = f0

    def forward(self, cos: Tensor) -> Tensor:
        return schlick(cos[..., None], f0=torch.atleast_1d(self.f0))

    def average(self) -> Tensor:
        f0 = torch.atleast_1d(self.f0)
        return (1 + 20 * f0) / 21


@final
class Dielectric(Fresnel):
    """`dielectric` with relative index eta, scalar, (channel,) or (..., channel). [-] > 1"""

    eta: Constrained = Constrained(REFRACTIVE_INDEX)

    def __init__(self, *, eta: ParameterValue = 1.5):
        super().__init__()
        self.eta = eta

    def forward(self, cos: Tensor) -> Tensor:
        return dielectric(cos[..., None], eta=torch.atleast_1d(self.eta))

    def average(self) -> Tensor:
        return dielectric_average(eta=torch.atleast_1d(self.eta))


@final
class Conductor(Fresnel):
    """`conductor` with complex index eta + i k, each scalar, (channel,) or (..., channel). [-] >= 0"""

    eta: Constrained = Constrained(RELATIVE_INDEX)
    k: Constrained = Constrained(ABSORPTION_INDEX)

    def __init__(self, *, eta: ParameterValue = 0.2, k: ParameterValue = 3.5):
        super().__init__()
        self.eta = eta
        self.k = k

    def forward(self, cos: Tensor) -> Tensor:
        return conductor(cos[..., None], eta=torch.atleast_1d(self.eta), k=torch.atleast_1d(self.k))

    def average(self, *, nodes: int = 32) -> Tensor:
        """By Gauss-Legendre quadrature: there is no closed form. Error below 1e-9 for metals."""
        eta, k = torch.atleast_1d(self.eta), torch.atleast_1d(self.k)
        c, w = (t.reshape(nodes, *(1,) * eta.ndim) for t in gauss_legendre(nodes, eta))
        return (conductor(c, eta=eta, k=k) * 2 * c * w).sum(0)
