"""Qualitative model of Oren & Nayar 1994, eq. (30): the two-term form in common use."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf._numerics import positive_part
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.fields import FieldBRDF
from torchbrdf.linear import LinearBRDF
from torchbrdf.models.rungs import Member, lambert, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue
from torchbrdf.sampling import CltcSampled, equivalent_roughness


def qualitative(cosines: Cosines, *, albedo: Tensor, sigma: Tensor, a_constant: float = 0.33) -> Tensor:
    r"""Reflectance of V-cavities with Gaussian slopes, first-order form without interreflection.

    .. math::
        f_r = \frac{\rho}{\pi}\,[A + B \max(0, \cos\Delta\phi) \sin\alpha \tan\beta], \quad
        A = 1 - \frac{\sigma^2}{2(\sigma^2 + 0.33)}, \quad B = \frac{0.45\,\sigma^2}{\sigma^2 + 0.09}

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
        a_constant: 0.33; footnote 7 of the source offers 0.57 to make up for the missing interreflection.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo or sigma leave their domains.
    Deviations: from the exact model with all bounces 15 % rms and 219 % (0.33) or 250 % (0.57) at worst
        (forward, grazing; up to 85 deg, sigma 5..60 deg, rho 0.3..0.9; `examples/benchmarks/ladder.py`).
        At the kink cos(dphi) = 0 the subgradient is the mean of both sides.
    Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, eq. (30), and
        footnote 7 of its long version (1995, DOI 10.1007/BF01679684).
    """
    ALBEDO.check("qualitative: albedo", albedo)
    ROUGHNESS.check("qualitative: sigma", sigma)
    return torch.atleast_1d(albedo) * (field(cosines, sigma, a_constant) * cosines.lit)[..., None]


def field(cosines: Cosines, sigma: Tensor, a_constant: float) -> Tensor:
    """Reflectance of white facets (...). [1/sr]"""
    s2 = sigma * sigma
    _, backward = geometry_terms(cosines)
    flat = 1 / math.pi - (0.5 / math.pi) * s2 / (s2 + a_constant)
    return flat + (0.45 / math.pi) * s2 / (s2 + 0.09) * backward


def geometry_terms(cosines: Cosines) -> tuple[Tensor, Tensor]:
    """1 and max(0, cos(dphi)) sin(alpha) tan(beta), each (...), without an angle."""
    return torch.ones_like(cosines.beta), positive_part(cosines.in_plane) / cosines.beta


def qualitative_coefficients(albedo: Tensor, sigma: Tensor, a_constant: float) -> Tensor:
    """rho/pi times (A, B): (..., channel, 2)."""
    albedo = torch.atleast_1d(albedo)
    s2 = (sigma * sigma)[..., None]
    a = 1 - 0.5 * s2 / (s2 + a_constant)
    b = 0.45 * s2 / (s2 + 0.09)
    return torch.stack(torch.broadcast_tensors(albedo * a / math.pi, albedo * b / math.pi), -1)


@final
class QualitativeOrenNayar(CltcSampled, FieldBRDF, LinearBRDF):
    """Qualitative model as a module; see `qualitative` for equation, units and deviations.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad]
        a_constant: constant in A; 0.57 makes up in part for the missing interreflection.
    Components: direct.
    Raises: ValueError outside the domains.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        sigma: ParameterValue = 0.3,
        a_constant: float = 0.33,
    ):
        super().__init__()
        if not a_constant > 0:
            raise ValueError(f"QualitativeOrenNayar.a_constant must be positive (0.33 or 0.57); found {a_constant}.")
        self.albedo = albedo
        self.sigma = sigma
        self.a_constant = a_constant

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def fields(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return (field(cosines, self.sigma, self.a_constant),)

    def parts_of(self, *fields: Tensor) -> dict[str, Tensor]:
        return {"direct": torch.atleast_1d(self.albedo) * fields[0]}

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return geometry_terms(cosines)

    def component_coefficients(self) -> dict[str, Tensor]:
        return {"direct": qualitative_coefficients(self.albedo, self.sigma, self.a_constant)}

    def members(self) -> list[Member]:
        """The ladder up to this model."""
        return [lambert(self), Member(f"qualitative ({self.a_constant:g})", (effects.ROUGHNESS,), self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())
