"""Phong's highlight: the radiance that Fleet & Hertzmann 2006 teach, and three BRDFs with the same lobe."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import dot, power_of_complement
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.parameters import ALBEDO, EXPONENT, Constrained, ParameterValue
from torchbrdf.sampling import choose, cosine_hemisphere, mirrored, power_cosine, towards


def mirror_deficit(cosines: Cosines) -> Tensor:
    """1 less the cosine between the view v and the mirror image m of the light (...): |v - m|^2/2. [-] in [0, 2]

    A large exponent multiplies its error. From the vectors it keeps all digits; from dot products alone,
    1 + l.v - 2 (n.l)(n.v), it is known to the rounding of 1.
    """
    if cosines.vectors is None:
        return (1 + cosines.phase - 2 * cosines.light * cosines.view).relu()
    normal, light, view = cosines.vectors
    total = light + view
    along = total - dot(total, normal)[..., None] * normal
    across = cosines.light - cosines.view
    return ((dot(along, along) + across * across) / 2).masked_fill(~cosines.above_horizon, 0.0)


def phong_radiance(
    cosines: Cosines,
    *,
    diffuse: Tensor,
    ambient: Tensor,
    specular: Tensor,
    exponent: Tensor,
    light: Tensor | float = 1.0,
    ambient_light: Tensor | float = 1.0,
    highlight: Tensor | float = 1.0,
) -> Tensor:
    r"""Phong's shading formula: a radiance, not a BRDF.

    .. math:: L = r_d I_d \max(0, n \cdot l) + r_a I_a + r_s I_s \max(0, m \cdot v)^\alpha

    with m the mirror image of the light.

    Args:
        cosines: of light, view and phase angle, each (...).
        diffuse, ambient, specular: r_d, r_a, r_s, scalar, (channel,) or (..., channel).
        exponent: alpha, scalar or (...). [-] >= 0
        light, ambient_light, highlight: I_d, I_a, I_s, in the unit of the radiance.
    Returns: L (..., channel). Below the horizon of light or view the ambient part alone.
    Deviations: as printed the highlight leaks through surfaces turned away from the light; here it does not.
        0^0 = 1.
    Source: Phong 1975, "Illumination for computer generated pictures", DOI 10.1145/360825.360839; in this form Fleet &
        Hertzmann 2006, "Computer Graphics Lecture Notes", University of Toronto, eqs. (39), (40).
    """
    lobe = power_of_complement(mirror_deficit(cosines)[..., None], exponent[..., None])
    lit = torch.atleast_1d(diffuse) * light * cosines.light[..., None] + torch.atleast_1d(specular) * highlight * lobe
    return cosines.zero_below_horizon(lit) + torch.atleast_1d(ambient) * ambient_light


class _Phong(BRDF):
    """Lambert plus a power of the cosine to the mirror direction; subclasses normalise it."""

    diffuse: Constrained = Constrained(ALBEDO)
    specular: Constrained = Constrained(ALBEDO)
    exponent: Constrained = Constrained(EXPONENT)

    def __init__(
        self,
        *,
        diffuse: ParameterValue = 0.4,
        specular: ParameterValue = 0.2,
        exponent: ParameterValue = 20.0,
    ):
        super().__init__()
        self.diffuse = diffuse
        self.specular = specular
        self.exponent = exponent

    def lobe_factor(self, cosines: Cosines, exponent: Tensor) -> Tensor:
        """What the cosine to the exponent is multiplied by (..., 1); the exponent is (..., 1)."""
        raise NotImplementedError

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        exponent = self.exponent[..., None]
        lobe = power_of_complement(mirror_deficit(cosines)[..., None], exponent)
        return {
            "diffuse": torch.atleast_1d(self.diffuse) / math.pi * torch.ones_like(lobe),
            "specular": torch.atleast_1d(self.specular) * self.lobe_factor(cosines, exponent) * lobe,
        }

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        glossy, u1 = choose(u[..., 0], self._share().expand_as(u[..., 0]))
        u = torch.stack((u1, u[..., 1]), -1)
        up = torch.zeros_like(view)
        up[..., 2] = 1.0
        lobe = towards(mirrored(view, up), power_cosine(u, self.exponent))
        light = torch.where(glossy[..., None], lobe, cosine_hemisphere(u))
        return light, torch.zeros_like(glossy)

    def density(self, cosines: Cosines) -> Tensor:
        lobe = (self.exponent + 1) / (2 * math.pi) * power_of_complement(mirror_deficit(cosines), self.exponent)
        return self._share() * lobe + (1 - self._share()) * cosines.light / math.pi

    def _share(self) -> Tensor:
        diffuse, specular = (torch.atleast_1d(k).mean(-1).detach() for k in (self.diffuse, self.specular))
        return (specular / (diffuse + specular)).nan_to_num(0.0)


@final
class Phong(_Phong):
    r"""The BRDF that makes Phong's radiance under one light: kept to show why it is no material.

    .. math:: f_r = \frac{k_d}{\pi} + k_s \frac{\max(0, m \cdot v)^n}{n \cdot l}

    Args:
        diffuse, specular: k_d, k_s, scalar, (channel,) or (..., channel). [-] in [0, 1]
        exponent: n, scalar or (...). [-] >= 0
    Components: diffuse, specular.
    Deviations: not reciprocal, and unbounded at grazing light. Prefer `ModifiedPhong` or `MaxCosinePhong`.
    Source: Phong 1975 (`phong_radiance`); Fleet & Hertzmann 2006, eq. (39), divided by the irradiance.
    """

    def lobe_factor(self, cosines: Cosines, exponent: Tensor) -> Tensor:
        return 1 / cosines.light[..., None]


@final
class ModifiedPhong(_Phong):
    r"""Phong's lobe, normalised: reciprocal, and conserving for k_d + k_s <= 1.

    .. math:: f_r = \frac{k_d}{\pi} + k_s \frac{n + 2}{2\pi} \max(0, m \cdot v)^n

    Args:
        diffuse, specular: k_d, k_s, scalar, (channel,) or (..., channel). [-] in [0, 1]
        exponent: n, scalar or (...). [-] >= 0
    Components: diffuse, specular.
    Deviations: the specular albedo is k_s at normal incidence and falls as the cosine: dark at grazing.
    Source: Lafortune & Willems 1994, "Using the modified Phong reflectance model for physically based rendering",
        Report CW 197, KU Leuven.
    """

    def lobe_factor(self, cosines: Cosines, exponent: Tensor) -> Tensor:
        return (exponent + 2) / (2 * math.pi)


@final
class MaxCosinePhong(_Phong):
    r"""Phong's lobe over the larger cosine: reciprocal, conserving, and bright at grazing.

    .. math:: f_r = \frac{k_d}{\pi} + k_s \frac{n + 1}{2\pi} \frac{\max(0, m \cdot v)^n}{\max(n \cdot l, n \cdot v)}

    Args:
        diffuse, specular: k_d, k_s, scalar, (channel,) or (..., channel). [-] in [0, 1]; sum <= 1 conserves
        exponent: n, scalar or (...). [-] >= 0
    Components: diffuse, specular.
    Source: Neumann, Neumann & Szirmay-Kalos 1999, "Compact metallic reflectance models", Computer Graphics Forum 18(3),
        161-172.
    """

    def lobe_factor(self, cosines: Cosines, exponent: Tensor) -> Tensor:
        return (exponent + 1) / (2 * math.pi) / cosines.beta[..., None]
