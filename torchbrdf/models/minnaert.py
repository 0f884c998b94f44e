"""Minnaert's law of the Moon."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.parameters import ALBEDO, EXPONENT, Constrained, ParameterValue
from torchbrdf.sampling import power_cosine


def minnaert(cosines: Cosines, *, albedo: Tensor, k: Tensor) -> Tensor:
    r"""Reflectance as a power of both cosines.

    .. math:: f_r = \rho\,\frac{k + 1}{2 \pi}\,(\cos\theta_i \cos\theta_r)^{k - 1}

    Args:
        cosines: of light and view, each (...).
        albedo: rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        k: limb darkening, scalar or (...). [-] >= 0; 1 is Lambert.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo or k leave their domains.
    Deviations: the directional albedo is rho cos^(k-1): for k < 1 it exceeds 1 without bound towards grazing.
    Source: Minnaert 1941, "The reciprocity principle in lunar photometry", DOI 10.1086/144279; named by Oren & Nayar
        1994, DOI 10.1145/192161.192213. The planetary form I/F = B0 cos_i^k cos_r^(k-1) has B0 = rho (k + 1)/2.
    """
    ALBEDO.check("minnaert: albedo", albedo)
    EXPONENT.check("minnaert: k", k)
    return cosines.zero_below_horizon(_minnaert(cosines, torch.atleast_1d(albedo), k[..., None]))


def _minnaert(cosines: Cosines, albedo: Tensor, k: Tensor) -> Tensor:
    return albedo * (k + 1) / (2 * math.pi) * ((cosines.light * cosines.view)[..., None]) ** (k - 1)


@final
class Minnaert(BRDF):
    """Minnaert's law as a module; see `minnaert` for equation, units and deviations.

    Args:
        albedo: rho, scalar, (channel,) or (..., channel). [-]
        k: limb darkening, scalar or (...). [-]
    Components: direct.
    """

    albedo: Constrained = Constrained(ALBEDO)
    k: Constrained = Constrained(EXPONENT)

    def __init__(self, *, albedo: ParameterValue = 0.5, k: ParameterValue = 1.2):
        super().__init__()
        self.albedo = albedo
        self.k = k

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        return {"direct": _minnaert(cosines, torch.atleast_1d(self.albedo), self.k[..., None])}

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """rho cos^(k-1), in closed form; `nodes` is not used."""
        return torch.atleast_1d(self.albedo) * cos_view[..., None] ** (self.k[..., None] - 1)

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        light = power_cosine(u, self.k).expand(torch.broadcast_shapes(view.shape, (*u.shape[:-1], 3)))
        return light, torch.zeros_like(light[..., 0], dtype=torch.bool)

    def density(self, cosines: Cosines) -> Tensor:
        return (self.k + 1) / (2 * math.pi) * cosines.light**self.k
