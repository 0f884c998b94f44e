"""Burley's diffuse model of Disney's principled shader, and its renormalisation for Frostbite."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.fresnel import fifth_power
from torchbrdf.parameters import ALBEDO, Constrained, Interval, ParameterValue

BURLEY_ROUGHNESS = Interval(0.0, 1.0)


def burley(cosines: Cosines, *, albedo: Tensor, roughness: Tensor, renormalised: bool = False) -> Tensor:
    r"""Diffuse reflectance with a retroreflective rim that grows with roughness, fitted by eye to measurements.

    .. math:: f_r = \frac{\rho}{\pi} [1 + (F_{90} - 1)(1 - \cos\theta_i)^5] [1 + (F_{90} - 1)(1 - \cos\theta_r)^5],
        \quad F_{90} = \tfrac12 + 2 R (l \cdot h)^2

    Renormalised: F_90 = R/2 + 2 R (l . h)^2, and a factor 1 + R (1/1.51 - 1).

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        roughness: R, scalar or (...). [-] in [0, 1]
        renormalised: Frostbite's form, which conserves energy but for the last two degrees before grazing.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo or roughness leave their domains.
    Deviations: as published does not conserve energy (directional albedo 1.46 at cosine 0.05, R = 1). Renormalised
        it stays below 0.97 down to cosine 0.05 and reaches 1.03 at grazing.
    Source: Burley 2012, "Physically based shading at Disney", course DOI 10.1145/2343483.2343493; renormalised: Lagarde
        & de Rousiers 2014, "Moving Frostbite to physically based rendering", course DOI 10.1145/2614028.2615431.
    """
    ALBEDO.check("burley: albedo", albedo)
    BURLEY_ROUGHNESS.check("burley: roughness", roughness)
    return cosines.zero_below_horizon(_burley(cosines, torch.atleast_1d(albedo), roughness[..., None], renormalised))


def _burley(cosines: Cosines, albedo: Tensor, roughness: Tensor, renormalised: bool) -> Tensor:
    half_squared = (1 + cosines.phase[..., None]) / 2
    rim = 2 * roughness * half_squared - 1 + (0.5 * roughness if renormalised else 0.5)
    light, view = (1 + rim * fifth_power(1 - c)[..., None] for c in (cosines.light, cosines.view))
    factor = 1 + roughness * (1 / 1.51 - 1) if renormalised else 1.0
    return albedo * factor / math.pi * (light * view)


@final
class Burley(BRDF):
    """Burley's diffuse model as a module; see `burley` for equation, units and deviations.

    Args:
        albedo: rho, scalar, (channel,) or (..., channel). [-]
        roughness: R, scalar or (...). [-]
        renormalised: Frostbite's form, which conserves energy but for the last two degrees before grazing.
    Components: direct.
    """

    albedo: Constrained = Constrained(ALBEDO)
    roughness: Constrained = Constrained(BURLEY_ROUGHNESS)
    uniform_share = 0.25

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        roughness: ParameterValue = 0.5,
        renormalised: bool = False,
    ):
        super().__init__()
        self.albedo = albedo
        self.roughness = roughness
        self.renormalised = renormalised

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        albedo, roughness = torch.atleast_1d(self.albedo), self.roughness[..., None]
        return {"direct": _burley(cosines, albedo, roughness, self.renormalised)}
