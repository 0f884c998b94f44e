"""Fujii's Oren-Nayar and its energy-preserving extension (FON and EON of Portsmouth, Kutz and Hill)."""

import math
from typing import Any, final

import torch
from torch import Tensor

from torchbrdf._numerics import angle_over_sine, number, safe_sqrt, sine
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.effects import INTERREFLECTION, ROUGHNESS
from torchbrdf.fields import FieldBRDF
from torchbrdf.linear import LinearBRDF
from torchbrdf.models.rungs import Member, lambert, stand_ins
from torchbrdf.parameters import ALBEDO, Constrained, Interval, ParameterValue, kept
from torchbrdf.sampling import CltcSampled

# 1/2 - 2/(3 pi) and 2/3 - 28/(15 pi): the mean of the retro term at grazing, and over the hemisphere.
C1 = 0.5 - 2 / (3 * math.pi)
C2 = 2 / 3 - 28 / (15 * math.pi)
_FITTED_G = (0.0571085289, 0.491881867, -0.332181442, 0.0714429953)
# Relative roughness r; f turns negative above 1.
FON_ROUGHNESS = Interval(0.0, 1.0)


def retro_term(cosines: Cosines) -> Tensor:
    """s/t (...), with s = sin_i sin_r cos(dphi) and t the larger cosine on the side of the light, 1 on the other."""
    s = cosines.in_plane
    return s.relu() / cosines.beta + s.clamp(max=0)


def retro_share(cos: Tensor, *, exact: bool = True) -> Tensor:
    r"""G(mu)/pi: mean of the retro term over the hemisphere, as seen from a direction at cosine mu (...). [-]

    .. math:: G = S (\theta - S \mu) + \tfrac23 S \Big(\mu \frac{1 + S + S^2}{1 + S} - 1\Big), \quad S = \sin\theta

    0 at normal incidence, with zero gradient; C1 at grazing. `exact=False`: a quartic in 1 - mu within 4.7e-4.
    """
    if not exact:
        x = 1 - cos
        first, second, third, fourth = _FITTED_G
        return x * (first + x * (second + x * (third + x * fourth)))
    return _retro_share(cos, sine(cos), angle_over_sine(cos))


def _retro_share(cos: Tensor, s: Tensor, angle_over_s: Tensor) -> Tensor:
    within = s * (angle_over_s - cos)
    return s / math.pi * (within + (2 / 3) * (cos * (s + 1 / (1 + s)) - 1))


def fon_albedo(cos: Tensor, *, roughness: Tensor, exact: bool = True) -> Tensor:
    """Directional albedo of white FON (...), (1 + r G/pi)/(1 + c1 r). [-] in (0, 1], 1 at grazing"""
    return (1 + roughness * retro_share(cos, exact=exact)) / (1 + C1 * roughness)


def fon_average_albedo(roughness: Tensor) -> Tensor:
    """Albedo of white FON under uniform light (...), (1 + c2 r)/(1 + c1 r). [-] in (0, 1]"""
    return (1 + C2 * roughness) / (1 + C1 * roughness)


def eon_albedo_from_white_sky(target: Tensor, *, roughness: Tensor) -> Tensor:
    """The albedo rho (...) with which EON reflects the share `target` (...) of uniform light. [-] in [0, 1]"""
    average = fon_average_albedo(roughness)
    return target / (average + target * (1 - average))


def eon_albedo_from_directional(target: Tensor, cos: Tensor, *, roughness: Tensor, exact: bool = True) -> Tensor:
    """The albedo rho (...) with which EON reflects the share `target` (...) of light at cosine `cos`. [-] in [0, 1]

    The root of a quadratic, in the form that does not cancel.
    """
    average = fon_average_albedo(roughness)
    directional = fon_albedo(cos, roughness=roughness, exact=exact)
    b = directional + target * (1 - average)
    return 2 * target / (b + safe_sqrt(b * b + 4 * target * (average - directional)))


class _RoughDiffuse(CltcSampled, FieldBRDF, LinearBRDF):
    albedo: Constrained = Constrained(ALBEDO)
    roughness: Constrained = Constrained(FON_ROUGHNESS)

    def sampling_roughness(self) -> Tensor:
        return self.roughness

    def fields(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """White FON (...). [1/sr]"""
        (retro,) = cosines.in_pieces(lambda g: (retro_term(g),))
        flat, rough = self._flat_and_rough()
        return (torch.addcmul(flat, rough, retro),)

    def _flat_and_rough(self) -> tuple[Tensor, Tensor]:
        """1 and r over pi (1 + c1 r), each (...)."""
        r = self.roughness
        flat = 1 / (math.pi + (math.pi * C1) * r)
        return flat, flat * r

    def parts_of(self, *fields: Tensor) -> dict[str, Tensor]:
        return {"direct": torch.atleast_1d(self.albedo) * fields[0]}

    def _direct(self) -> tuple[Tensor, Tensor, Tensor]:
        """Coefficients of 1 and of the retro term, and r, all with a trailing channel."""
        r = self.roughness[..., None]
        flat = torch.atleast_1d(self.albedo) / (math.pi * (1 + C1 * r))
        return flat, flat * r, r


@final
class FujiiOrenNayar(_RoughDiffuse):
    r"""Fujii's variant of the qualitative Oren-Nayar model, in the parameters of Portsmouth, Kutz and Hill.

    .. math:: f_r = \frac{\rho}{\pi}\,\frac{1 + r\,s/t}{1 + c_1 r}, \quad
        s = \sin\theta_i \sin\theta_r \cos\Delta\phi,\quad t = \max(\cos\theta_i, \cos\theta_r) \text{ if } s > 0
        \text{ else } 1

    Args:
        albedo: rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        roughness: r, scalar or (...). [-] in [0, 1]; 0 is Lambert.
    Components: direct.
    Deviations: darkens with roughness, as no light is reflected twice: white-sky albedo 0.83 rho at r = 1.
    Source: Fujii 2013, "A tiny improvement of Oren-Nayar reflectance model", at
        mimosa-pudica.net/improved-oren-nayar.html; Portsmouth, Kutz & Hill 2025 (as `EON`).
    """

    def __init__(self, *, albedo: ParameterValue = 0.5, roughness: ParameterValue = 0.5):
        super().__init__()
        self.albedo = albedo
        self.roughness = roughness

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return torch.ones_like(cosines.light), retro_term(cosines)

    def component_coefficients(self) -> dict[str, Tensor]:
        flat, retro, _ = self._direct()
        return {"direct": torch.stack(torch.broadcast_tensors(flat, retro), -1)}

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """rho (1 + r G/pi)/(1 + c1 r), in closed form; `nodes` is not used."""
        return torch.atleast_1d(self.albedo) * fon_albedo(cos_view[..., None], roughness=self.roughness[..., None])

    def members(self) -> list[Member]:
        """The ladder up to this model."""
        return [lambert(self), Member("Fujii", (ROUGHNESS,), self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())


@final
class EON(_RoughDiffuse):
    r"""Energy-preserving Oren-Nayar: FON plus the light it loses, given back in a reciprocal lobe.

    .. math:: f_r = f_{FON} + \frac{\rho_{ms}}{\pi}\,\frac{r}{1 + c_1 r}\,\frac{(c_1 - g_i)(c_1 - g_r)}{c_1 - c_2},
        \quad \rho_{ms} = \frac{\rho^2 \bar E}{1 - \rho (1 - \bar E)}

    with g = G/pi of `retro_share`, E-bar of `fon_average_albedo`. This form of the published
    (1 - E_i)(1 - E_r)/(1 - E-bar) has no 0/0 at r = 0.

    Args:
        albedo: rho, scalar, (channel,) or (..., channel). [-] in [0, 1]; 1 reflects everything.
        roughness: r, scalar or (...). [-] in [0, 1]; 0 is Lambert.
        exact: False takes the quartic for G, as renderers do; the furnace is then 0.9998 to 1.
    Components: direct, interreflection.
    Source: Portsmouth, Kutz & Hill 2025, "EON: A practical energy-preserving rough diffuse BRDF", Journal of Computer
        Graphics Techniques 14(1), arXiv:2410.18026.
    """

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        roughness: ParameterValue = 0.5,
        exact: bool = True,
    ):
        super().__init__()
        self.albedo = albedo
        self.roughness = roughness
        self.exact = exact

    def fields(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """White FON, and what comes of the light it loses (...). [1/sr]"""
        retro, lost = cosines.in_pieces(lambda g: (retro_term(g), self._lost(g)))
        flat, rough = self._flat_and_rough()
        return torch.addcmul(flat, rough, retro), rough * lost

    def parts_of(self, *fields: Tensor) -> dict[str, Tensor]:
        return super().parts_of(fields[0]) | {"interreflection": self._returned() * fields[1]}

    def sum_of(self, *fields: Tensor) -> Tensor:
        rho, average = torch.atleast_1d(self.albedo), fon_average_albedo(self.roughness[..., None])
        direct, returned = fields
        left = torch.addcmul(number(1.0, rho), rho, 1 - average, value=-1)
        return rho * torch.addcdiv(direct, rho * (average * returned), left)

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return torch.ones_like(cosines.light), retro_term(cosines), self._lost(cosines)

    def _lost(self, cosines: Cosines) -> Tensor:
        if not self.exact:
            shares = [retro_share(c, exact=False) for c in (cosines.light, cosines.view)]
        else:
            c = cosines
            polar = ((c.alpha, c.sin_alpha, c.alpha_over_sine), (c.beta, c.sin_beta, c.beta_over_sine))
            shares = [_retro_share(*angle) for angle in polar]
        return (C1 - shares[0]) * (C1 - shares[1]) / (C1 - C2)

    def component_coefficients(self) -> dict[str, Tensor]:
        flat, retro, r = self._direct()
        returned = self._returned() * r / (math.pi * (1 + C1 * r))
        nothing = torch.zeros_like(returned)
        return {
            "direct": torch.stack(torch.broadcast_tensors(flat, retro, nothing), -1),
            "interreflection": torch.stack(torch.broadcast_tensors(nothing, nothing, returned), -1),
        }

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """rho E + rho_ms (1 - E), in closed form; `nodes` is not used."""
        white = fon_albedo(cos_view[..., None], roughness=self.roughness[..., None], exact=self.exact)
        return torch.atleast_1d(self.albedo) * white + self._returned() * (1 - white)

    def average_albedo(self) -> Tensor:
        """Share of uniform light that is reflected (..., channel). [-]"""
        rho, average = torch.atleast_1d(self.albedo), fon_average_albedo(self.roughness[..., None])
        return rho * average / (1 - rho * (1 - average))

    def _returned(self) -> Tensor:
        rho, average = torch.atleast_1d(self.albedo), fon_average_albedo(self.roughness[..., None])
        return rho * rho * average / (1 - rho * (1 - average))

    def members(self) -> list[Member]:
        """The ladder up to this model."""
        material: dict[str, Any] = {name: kept(self, name) for name in ("albedo", "roughness")}
        return [*FujiiOrenNayar(**material).members(), Member("EON", (ROUGHNESS, INTERREFLECTION), self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())
