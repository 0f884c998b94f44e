"""Functional approximation of the integral of Oren & Nayar 1994, eqs. (27)-(29) of the long version."""

import math
from functools import partial
from typing import Any, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf._numerics import quotients
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.fields import FieldBRDF
from torchbrdf.linear import LinearBRDF
from torchbrdf.models.oren_nayar.qualitative import QualitativeOrenNayar
from torchbrdf.models.rungs import Member, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue, kept
from torchbrdf.sampling import CltcSampled, equivalent_roughness

# (4/pi^2)^2 of C3 and (2/pi)^2 of the second bounce, with beta squared.
_ANGLES, _BOUNCE = (4 / math.pi**2) ** 2, (2 / math.pi) ** 2
_C2, _C3 = 0.45, 0.125 * _ANGLES
# C1/pi, what C2 and C3 share, and the strength of the second bounce, each (a sigma^2 + b)/(sigma^2 + c).
_QUOTIENTS = ((0.5 / math.pi, 0.33 / math.pi, 0.33), (_C2 / math.pi, 0.0, 0.09), (0.17 / math.pi, 0.0, 0.13))


def oren_nayar(cosines: Cosines, *, albedo: Tensor, sigma: Tensor) -> Tensor:
    r"""Reflectance of V-cavities with Gaussian slopes, fitted formula, two bounces.

    .. math::
        f_r &= \frac{\rho}{\pi} [C_1 + \cos\Delta\phi\, C_2 \tan\beta
               + (1 - |\cos\Delta\phi|)\, C_3 \tan\tfrac{\alpha+\beta}{2}]
             + 0.17 \frac{\rho^2}{\pi} \frac{\sigma^2}{\sigma^2 + 0.13}
               [1 - \cos\Delta\phi (2\beta/\pi)^2] \\
        C_1 &= 1 - \frac{\sigma^2}{2(\sigma^2 + 0.33)}, \quad
        C_2 = \frac{0.45\,\sigma^2}{\sigma^2 + 0.09}
              [\sin\alpha - (2\beta/\pi)^3 \text{ where } \cos\Delta\phi < 0], \quad
        C_3 = \frac{0.125\,\sigma^2}{\sigma^2 + 0.09} (4\alpha\beta/\pi^2)^2

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo or sigma leave their domains.
    Deviations: a fit. From the exact model with all bounces it errs by 6 % rms and 74 % at worst
        (forward, grazing; up to 85 deg, sigma 5..60 deg, rho 0.3..0.9; `examples/benchmarks/ladder.py`);
        it turns negative at forward grazing for sigma > 0.66 rad (rho -> 0; at cosines of 1e-15 for less, where
        the tangent multiplies what rounding leaves of a difference), and at rho = 1 its directional albedo
        reaches 1.05 at grazing.
    Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
        (1995, DOI 10.1007/BF01679684), eqs. (27)-(29).
    """
    ALBEDO.check("oren_nayar: albedo", albedo)
    ROUGHNESS.check("oren_nayar: sigma", sigma)
    direct, bounced = ((field * cosines.lit).unsqueeze(-1) for field in fields(cosines, sigma))
    albedo = torch.atleast_1d(albedo)
    return albedo * torch.addcmul(direct, albedo, bounced)


def fields(cosines: Cosines, sigma: Tensor, *, c3: bool = True) -> tuple[Tensor, Tensor]:
    """Light reflected once and twice by white facets, Oren & Nayar 1994, eqs. (27) and (28), each (...). [1/sr]"""
    along, turned = cosines.in_pieces(partial(_two_shapes, c3=c3))
    flat, slope, bounce = quotients(sigma * sigma, _QUOTIENTS)
    return torch.addcmul(flat, slope, along), torch.addcmul(bounce, bounce, turned, value=-_BOUNCE)


def geometry_terms(cosines: Cosines, *, c3: bool = True) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """The four functions of geometry in Oren & Nayar 1994, eqs. (27), (28), each (...), without an angle.

    1, cos(dphi) C2 tan(beta) and (1 - |cos(dphi)|) C3 tan((alpha+beta)/2) with the constants and the
    sigma-quotients taken out, and cos(dphi) (2 beta/pi)^2. Every quotient left is bounded or has
    the larger cosine below it. Without `c3` the third is 0.
    """
    along, across, turned = _shapes(cosines, c3=c3)
    ones = torch.ones_like(along)
    return ones, along, 0 * ones if across is None else across * _ANGLES, turned * _BOUNCE


def _two_shapes(cosines: Cosines, *, c3: bool) -> tuple[Tensor, Tensor]:
    """What C2 multiplies, with the term of C3 in it, and the bounce without its power of 2/pi, each (...)."""
    along, across, turned = _shapes(cosines, c3=c3)
    return (along if across is None else torch.add(along, across, alpha=_C3 / _C2)), turned


def _shapes(cosines: Cosines, *, c3: bool) -> tuple[Tensor, Tensor | None, Tensor]:
    """The last three of `geometry_terms`, without the powers of 2/pi of the last two; no second without `c3`."""
    g = cosines
    turned = g.in_plane * g.sine_ratio * (g.beta_over_sine * g.beta_over_sine)
    # tan(beta) cos(dphi) = (in_plane / sin(alpha)) / cos(beta); the cubic only acts where dphi > 90 deg, where
    # |turned| - turned is twice what -turned is (and has half its derivative at 0)
    size = g.sin_beta * g.sin_beta * g.beta_over_sine
    along = torch.addcmul(g.in_plane, turned.abs() - turned, size, value=0.5 * (2 / math.pi) ** 3) / g.beta
    if not c3:
        return along, None, turned
    tan_mean = (g.sin_alpha + g.sin_beta) / (g.alpha + g.beta)
    angles = g.alpha_over_sine * g.beta_over_sine
    return along, g.across_plane * g.sine_product * tan_mean * (angles * angles), turned


def direct_coefficients(albedo: Tensor, sigma: Tensor) -> Tensor:
    """rho times (C1, 0.45 s, 0.125 s, 0)/pi with s = sigma^2/(sigma^2 + 0.09): (..., channel, 4)."""
    albedo = torch.atleast_1d(albedo)
    s2 = (sigma * sigma)[..., None]
    slope = s2 / (s2 + 0.09)
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    return torch.stack(
        torch.broadcast_tensors(*(albedo * k / math.pi for k in (c1, 0.45 * slope, 0.125 * slope, 0 * slope))), -1
    )


def interreflection_coefficients(albedo: Tensor, sigma: Tensor) -> Tensor:
    """0.17 rho^2 sigma^2/(sigma^2 + 0.13) (1, 0, 0, -1)/pi: (..., channel, 4)."""
    albedo = torch.atleast_1d(albedo)
    s2 = (sigma * sigma)[..., None]
    strength = 0.17 * albedo * albedo * s2 / (s2 + 0.13) / math.pi
    nothing = torch.zeros_like(strength)
    return torch.stack((strength, nothing, nothing, -strength), -1)


@final
class OrenNayar(CltcSampled, FieldBRDF, LinearBRDF):
    """Functional approximation as a module; see `oren_nayar` for equation, units and deviations.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad]
        direct: include light reflected once.
        interreflection: include light reflected twice inside a cavity.
        c3: include the term of C3, which acts across the plane of incidence alone.
    Components: direct, interreflection (those included).
    Raises: ValueError outside the domains, or when both parts are switched off.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        sigma: ParameterValue = 0.3,
        direct: bool = True,
        interreflection: bool = True,
        c3: bool = True,
    ):
        super().__init__()
        if not (direct or interreflection):
            raise ValueError("OrenNayar needs direct or interreflection; both are switched off.")
        self.albedo = albedo
        self.sigma = sigma
        self._parts = {"direct": direct, "interreflection": interreflection}
        self.c3 = c3

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def fields(self, cosines: Cosines) -> tuple[Tensor, ...]:
        parts = zip(self._parts.values(), fields(cosines, self.sigma, c3=self.c3), strict=True)
        return tuple(field for included, field in parts if included)

    def parts_of(self, *fields: Tensor) -> dict[str, Tensor]:
        albedo = torch.atleast_1d(self.albedo)
        parts = {"direct": lambda field: albedo * field, "interreflection": lambda field: albedo * (albedo * field)}
        included = (name for name, wanted in self._parts.items() if wanted)
        return {name: parts[name](field) for name, field in zip(included, fields, strict=True)}

    def sum_of(self, *fields: Tensor) -> Tensor:
        if len(fields) < 2:
            return super().sum_of(*fields)
        albedo, (direct, bounced) = torch.atleast_1d(self.albedo), fields
        return albedo * torch.addcmul(direct, albedo, bounced)

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return geometry_terms(cosines, c3=self.c3)

    def component_coefficients(self) -> dict[str, Tensor]:
        parts = {"direct": direct_coefficients, "interreflection": interreflection_coefficients}
        return {name: parts[name](self.albedo, self.sigma) for name, included in self._parts.items() if included}

    def members(self) -> list[Member]:
        """The ladder up to this model, without interreflection where it has none."""
        material: dict[str, Any] = {name: kept(self, name) for name in ("albedo", "sigma")}
        bounce = self._parts["interreflection"]
        plain = (effects.ROUGHNESS, effects.INTERREFLECTION) if bounce else (effects.ROUGHNESS,)
        without = Member("functional without C3", plain, OrenNayar(**material, interreflection=bounce, c3=False))
        own = Member("functional", (*plain, effects.C3_TERM), self) if self.c3 else without._replace(model=self)
        return [*QualitativeOrenNayar(**material).members(), without, own]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members()) if self._parts["direct"] else {}
