"""The exact V-cavity rough surface as a reciprocal fit without angles: some hundred nanoseconds a pixel."""

import json
import math
from pathlib import Path
from typing import Any, Literal, NamedTuple, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.fields import FieldBRDF
from torchbrdf.models.network import Network, bounded, pixel_by_pixel
from torchbrdf.models.oren_nayar.coordinates import Coordinates, coordinates, slope_squared
from torchbrdf.models.oren_nayar.functional import OrenNayar
from torchbrdf.models.rungs import Member, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue, kept
from torchbrdf.sampling import CltcSampled, equivalent_roughness

Bounces = Literal[2, "all"]
_BOUNCES = (2, "all")
_LARGEST_KEPT = 0.98  # of light that a bounce in a cavity hands on to the next


class CavityFields(NamedTuple):
    """What unit albedo returns after one, two and three bounces, each (...) [1/sr], and what becomes of the rest.

    The third bounce and all later ones are (third - rho later)/((1 - rho kept)(1 - rho kept/2)).
    """

    direct: Tensor
    two_bounce: Tensor
    third: Tensor
    later: Tensor
    kept: Tensor  # [-]


_FIT = Network.of(json.loads(Path(__file__).with_name("fast_rough_surface.json").read_text()))


def cavity_fields(cosines: Cosines, sigma: Tensor) -> CavityFields:
    """The fields (...) at directions (...), for sigma (...) [rad]; finite below the horizon."""
    c = cosines
    # At least 1-D: forward differentiation of "number * 0-d float32 tensor" yields float64.
    squared = slope_squared(torch.atleast_1d(sigma)).reshape(sigma.shape)
    return CavityFields(*pixel_by_pixel(_fields, c.light, c.view, c.phase, c.azimuth_sine, squared))


def _fields(light: Tensor, view: Tensor, phase: Tensor, azimuth_sine: Tensor, squared: Tensor) -> CavityFields:
    return fields_from(coordinates(light, view, phase, azimuth_sine, squared), _FIT)


def fields_from(place: Coordinates, network: Network) -> CavityFields:
    """The fields (n,) of coordinates (7, n), (n,), (n,)."""
    direct, two, first, second, kept = network.outputs(place.features).unbind(0)
    share, kept = place.share, _LARGEST_KEPT * bounded(kept)
    squared = share * share
    first, second = squared * first.exp(), squared * second.exp()
    return CavityFields(
        place.growth * (direct.exp() / math.pi), share * two.exp(), first + second, kept * (0.5 * first + second), kept
    )


def parts(albedo: Tensor, direct: Tensor, two_bounce: Tensor, *more: Tensor) -> dict[str, Tensor]:
    """The named parts (..., channel) [1/sr] of the first fields (..., 1), or of all of them."""
    rho = torch.atleast_1d(albedo)
    squared = rho * rho
    named = {"direct": rho * direct, "two_bounce": squared * two_bounce}
    return named | {"higher": squared * rho * _higher(rho, *more)} if more else named


def reflectance(albedo: Tensor, direct: Tensor, two_bounce: Tensor, *more: Tensor) -> Tensor:
    """The sum of `parts`, in fewer steps."""
    rho = torch.atleast_1d(albedo)
    bounced = two_bounce + rho * _higher(rho, *more) if more else two_bounce
    return rho * (direct + rho * bounced)


def _higher(rho: Tensor, third: Tensor, later: Tensor, kept: Tensor) -> Tensor:
    again = rho * kept
    return (third - rho * later) / ((1 - again) * (1 - 0.5 * again))


def fast_rough_surface(cosines: Cosines, *, albedo: Tensor, sigma: Tensor, bounces: Bounces) -> Tensor:
    r"""Reflectance of isotropic V-cavities with Gaussian slopes, fitted to the exact integral over slopes and azimuths.

    .. math::
        f_r &= \rho f_1 + \rho^2 f_2
               + \rho^3 \Bigl[\frac{g_0}{1 - \rho k} + \frac{g_1}{1 - \rho k/2}\Bigr] \
        \pi f_1 &= (1 + c/2)\, e^{o_1}, \quad f_2 = y\, e^{o_2}, \quad g_0 = y^2 e^{o_3}, \quad
        g_1 = y^2 e^{o_4}, \quad k = 0.98\, a(o_5), \quad y = \frac{z^2}{1 + z^2}

    g_0 and g_1 carry three and more bounces, k(sigma, directions) is an effective share of light that a cavity keeps
    for itself. o_1 .. o_5 are smooth functions of seven coordinates (`coordinates.py`) through two small layers of
    a(u) = u/sqrt(1 + u^2) (`Network`); c is what light and view are both shaded from, z(sigma) the facets' slope.

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
        bounces: 2, or "all".
    Returns: f_r (..., channel) [1/sr], above 0; zero unless light and view are above the horizon.
    Raises: ValueError when albedo or sigma leave their domains, or for other bounces.
    Deviations: a fit. From the exact model, rho 0.1 to 0.9 and sigma 2 to 60 deg, on points it was not fitted to, two
        or all bounces: rms 0.11 % and at most 1.3 % up to 85 deg, rms 0.13 % where they crowd at grazing, in the plane
        of incidence and at light = view; rms 0.23 %, at most 5 %, from 85 to 89 deg. Worst at sigma = 60 deg and
        rho = 0.9: rms 0.20 %. At rho = 1 with all bounces rms 0.22 %, at most 6.3 % (next to the normal, steep facets),
        and the directional albedo is within 1.7e-3 of 1 up to 85 deg. The derivative by sigma errs by 1-4 % rms, from
        sigma = 50 deg or rho = 0.9 on by 2-9 %, at rho = 1 by up to 17 %. Like the exact model it has a cone at
        light = view, with subgradient 0, and no other kink. Beyond 89 deg: f cos stays bounded, no figures.
    Source: fitted here to the exact model (`examples/fast_fit`).
    """
    ALBEDO.check("fast_rough_surface: albedo", albedo)
    ROUGHNESS.check("fast_rough_surface: sigma", sigma)
    _check_bounces("fast_rough_surface", bounces)
    fields = cavity_fields(cosines, sigma)[: _needed(bounces)]
    return reflectance(albedo, *((field * cosines.lit)[..., None] for field in fields))


def _needed(bounces: Bounces) -> int:
    """How many of the fields."""
    return 2 if bounces == 2 else len(CavityFields._fields)


def _check_bounces(name: str, bounces: object) -> None:
    if bounces not in _BOUNCES:
        raise ValueError(f'{name}: bounces must be 2 or "all"; found {bounces!r}.')


@final
class FastRoughSurface(CltcSampled, FieldBRDF):
    """Fit of the exact V-cavity rough surface as a module; see `fast_rough_surface` for equation, units and deviations.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad]
        bounces: 2, or "all".
    Components: direct, two_bounce and, for all bounces, higher.
    Raises: ValueError outside the domains, or for other bounces.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(self, *, albedo: ParameterValue = 0.5, sigma: ParameterValue = 0.3, bounces: Bounces = "all"):
        super().__init__()
        _check_bounces("FastRoughSurface", bounces)
        self.albedo = albedo
        self.sigma = sigma
        self.bounces: Bounces = bounces

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def fields(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return cavity_fields(cosines, self.sigma)[: _needed(self.bounces)]

    def parts_of(self, *fields: Tensor) -> dict[str, Tensor]:
        return parts(self.albedo, *fields)

    def sum_of(self, *fields: Tensor) -> Tensor:
        return reflectance(self.albedo, *fields)

    def members(self) -> list[Member]:
        """The ladder up to this model."""
        material: dict[str, Any] = {name: kept(self, name) for name in ("albedo", "sigma")}
        two = (effects.ROUGHNESS, effects.INTERREFLECTION, effects.C3_TERM)
        simpler = OrenNayar(**material).members()
        if self.bounces == 2:
            return [*simpler, Member("fast, 2 bounces", two, self)]
        every = (effects.ROUGHNESS, effects.INTERREFLECTION, effects.LATER_BOUNCES, effects.C3_TERM)
        rough = FastRoughSurface(**material, bounces=2)
        return [*simpler, Member("fast, 2 bounces", two, rough), Member("fast, all bounces", every, self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())
