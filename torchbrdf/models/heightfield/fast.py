"""The Gaussian heightfield with all bounces as a fit without angles: some hundred nanoseconds a pixel."""

import json
import math
from pathlib import Path
from typing import NamedTuple, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.fields import FieldBRDF
from torchbrdf.models.heightfield.coordinates import Coordinates, coordinates, slope_squared
from torchbrdf.models.network import Network, bounded, pixel_by_pixel
from torchbrdf.models.rungs import Member, lambert, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue
from torchbrdf.sampling import CltcSampled, equivalent_roughness

_LARGEST_KEPT = 0.8  # of light that three bounces hand on to the fourth


class HeightfieldFields(NamedTuple):
    """What unit albedo returns, each (...) [1/sr]; the third bounce and all later ones are third/(1 - kept)."""

    direct: Tensor
    two_bounce: Tensor
    third: Tensor
    kept: Tensor


class _Fit(NamedTuple):
    """Numbers of `fast_heightfield.json` (made by `examples/fast_heightfield`)."""

    slope: tuple[float, ...]  # s/sigma as a polynomial, see `slope_squared`
    network: Network


def _read(path: Path) -> _Fit:
    stored = json.loads(path.read_text())
    return _Fit(tuple(stored["slope"]), Network.of(stored))


_FIT = _read(Path(__file__).with_name("fast_heightfield.json"))


def heightfield_fields(cosines: Cosines, sigma: Tensor) -> HeightfieldFields:
    """The fields (...) at directions (...), for sigma (...) [rad]; finite below the horizon."""
    c = cosines
    return HeightfieldFields(*pixel_by_pixel(_fields, c.light, c.view, c.phase, c.azimuth_sine, sigma))


def _fields(light: Tensor, view: Tensor, phase: Tensor, azimuth_sine: Tensor, sigma: Tensor) -> HeightfieldFields:
    return fields_from(coordinates(light, view, phase, azimuth_sine, slope_squared(sigma, _FIT.slope)), _FIT.network)


def fields_from(place: Coordinates, network: Network) -> HeightfieldFields:
    """The fields (n,) of coordinates (7, n), (n,), (n,)."""
    direct, two, third, kept = network.outputs(place.features).unbind(0)
    share = place.share
    return HeightfieldFields(
        place.masked * (direct.exp() / math.pi),
        share * two.exp(),
        share * share * third.exp(),
        _LARGEST_KEPT * bounded(kept),
    )


def reflectance(albedo: Tensor, fields: HeightfieldFields) -> dict[str, Tensor]:
    """The named parts (..., channel) [1/sr] of fields (..., 1): rho f_1, rho^2 f_2, rho^3 f_3/(1 - rho kept)."""
    rho = torch.atleast_1d(albedo)
    direct, two, third, kept = fields
    squared = rho * rho
    return {
        "direct": rho * direct,
        "two_bounce": squared * two,
        "higher": squared * rho * third / (1 - rho * kept),
    }


def fast_gaussian_heightfield(cosines: Cosines, *, albedo: Tensor, sigma: Tensor) -> Tensor:
    r"""Reflectance of a random heightfield with Gaussian slopes, all bounces, fitted to `gaussian_heightfield`.

    .. math::
        f_r &= \rho f_1 + \rho^2 f_2 + \frac{\rho^3 f_3}{1 - \rho k} \\
        \pi f_1 &= \frac{(1 + \Lambda_i)(1 + \Lambda_r)}{1 + D}\, e^{o_1}, \quad
        f_2 = z\, e^{o_2}, \quad f_3 = z^2 e^{o_3}, \quad k = 0.8\, a(o_4), \quad z = \frac{s^2}{1 + s^2}

    Lambda is Smith's, D the masking that light and view share (`visibility.joint_masking`); o_1 .. o_4 are smooth
    functions of seven coordinates (`coordinates.py`) through two small layers of a(u) = u/sqrt(1 + u^2) (`Network`).

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
    Returns: f_r (..., channel) [1/sr], above 0; zero unless light and view are above the horizon.
    Raises: ValueError when albedo or sigma leave their domains.
    Deviations: a fit, of occlusion 1 and the constants of smooth surfaces. From the reference, rho 0.1 to 0.95 and
        sigma 2 to 60 deg, on points it was not fitted to: rms 0.08 % and at most 1 % up to 85 deg, 0.09 % and 2.1 %
        where they crowd at grazing, in the plane of incidence and at light = view; rms 0.26 %, at most 4.5 %, from 85
        to 89 deg. The directional albedo at rho = 1 is within 1.5e-3 of 1 up to 85 deg. The derivative by sigma errs
        by 1-3 % rms. Like the reference it has a cone at light = view, with subgradient 0. Beyond 89 deg: f cos stays
        bounded, no figures.
    Source: fitted here to the reference (`examples/fast_heightfield`).
    """
    ALBEDO.check("fast_gaussian_heightfield: albedo", albedo)
    ROUGHNESS.check("fast_gaussian_heightfield: sigma", sigma)
    fields = (field[..., None] for field in heightfield_fields(cosines, sigma))
    parts = reflectance(albedo, HeightfieldFields(*fields))
    return cosines.zero_below_horizon(parts["direct"] + parts["two_bounce"] + parts["higher"])


@final
class FastGaussianHeightfield(CltcSampled, FieldBRDF):
    """Fit of the Gaussian heightfield as a module; see `fast_gaussian_heightfield` for equation, units and deviations.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad]
    Components: direct, two_bounce, higher.
    Raises: ValueError outside the domains.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(self, *, albedo: ParameterValue = 0.5, sigma: ParameterValue = 0.3):
        super().__init__()
        self.albedo = albedo
        self.sigma = sigma

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def fields(self, cosines: Cosines) -> HeightfieldFields:
        """What unit albedo returns, each (...) [1/sr]; finite below the horizon."""
        return heightfield_fields(cosines, self.sigma)

    def parts_of(self, *fields: Tensor) -> dict[str, Tensor]:
        return reflectance(self.albedo, HeightfieldFields(*fields))

    def members(self) -> list[Member]:
        """The ladder up to this model."""
        simulates = (effects.ROUGHNESS, effects.INTERREFLECTION, effects.LATER_BOUNCES, effects.OCCLUSION_NEAR_BY)
        return [lambert(self), Member("fast heightfield", simulates, self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())
