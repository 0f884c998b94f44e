"""Mirror-like V-cavities with Gaussian facet angles: the specular partner of Oren-Nayar."""

from typing import final

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF, Option
from torchbrdf.directions import Cosines
from torchbrdf.effects import FRESNEL_VARIATION
from torchbrdf.facets import (
    HalfVector,
    slope_area,
    slope_area_angle,
    slope_area_norm,
    tangent_squared,
    v_cavity_masking,
    visible_azimuth,
)
from torchbrdf.fresnel import Fresnel, Perfect
from torchbrdf.parameters import FACET_ROUGHNESS, Constrained, ParameterValue, kept
from torchbrdf.sampling import along_view, mirrored


def torrance_sparrow(
    cosines: Cosines, *, sigma: Tensor, fresnel: Tensor | float = 1.0, normalised: bool = True
) -> Tensor:
    r"""Specular reflectance of V-cavities, slope-area convention.

    .. math::
        f_r = \frac{F\,G\,P(\theta_a)}{4 \cos\theta_i \cos\theta_r \cos\theta_a}, \quad
        P = c\,e^{-\theta_a^2 / 2 \sigma^2}

    where theta_a is the angle between normal and half vector, P the share of projected area and G
    `v_cavity_masking`.

    Args:
        cosines: of light, view and phase angle, each (...).
        sigma: roughness, scalar or (...). [rad] in [0.001, pi/2]: narrower lobes are a `Mirror`
        fresnel: F at the half vector (..., channel). [-]
        normalised: False leaves out c/4, as Oren & Nayar 1994, eq. (31), for k_s values of that paper: k_s is then in
            1/sr.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when sigma leaves its domain.
    Deviations: grows as 1/cos^2 towards grazing in the mirror direction, while the directional albedo stays
        <= 1; single reflection only.
    Source: Torrance & Sparrow 1967, "Theory for off-specular reflection from roughened surfaces", DOI
        10.1364/JOSA.57.001105; Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI
        10.1145/192161.192213, long version (1995, DOI 10.1007/BF01679684), eqs. (31)-(33), (38), with Min for the
        misprinted Max.
    """
    FACET_ROUGHNESS.check("torrance_sparrow: sigma", sigma)
    half = HalfVector.of(cosines)
    return cosines.zero_below_horizon(_lobe(cosines, half, sigma, normalised)[..., None] * fresnel)


def _lobe(cosines: Cosines, half: HalfVector, sigma: Tensor, normalised: bool) -> Tensor:
    spread = slope_area(half, sigma=sigma) / 4
    if not normalised:
        spread = 4 * (spread * slope_area_norm(sigma))
    lobe = v_cavity_masking(cosines, half) * spread / (cosines.light * cosines.view * half.cos)
    return lobe.to(torch.promote_types(lobe.dtype, sigma.dtype))  # a number alone would not widen it


@final
class TorranceSparrow(BRDF):
    """Specular V-cavities as a module; see `torrance_sparrow` for equation, units and deviations.

    Args:
        sigma: roughness, scalar or (...). [rad]
        fresnel: reflectance of a facet; Perfect (F = 1) if not given.
        normalised: False leaves out c/4, as Oren & Nayar 1994, eq. (31).
    Components: specular.
    Raises: ValueError outside the domain.

    The body and surface mixture of Oren & Nayar 1994, eq. (32), is `k_b * OrenNayar(...) + k_s * TorranceSparrow(...)`.
    """

    sigma: Constrained = Constrained(FACET_ROUGHNESS)

    def __init__(self, *, sigma: ParameterValue = 0.3, fresnel: Fresnel | None = None, normalised: bool = True):
        super().__init__()
        self.sigma = sigma
        self.fresnel = Perfect() if fresnel is None else fresnel
        self.normalised = normalised

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        half = HalfVector.of(cosines)
        lobe = _lobe(cosines, half, self.sigma, self.normalised)
        return {"specular": lobe[..., None] * self.fresnel(half.cos_light)}

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        """Facets in proportion to their visible area: a facet of the cavity, or its partner."""
        theta = slope_area_angle(u[..., 0], self.sigma)
        sine, cosine = theta.sin(), theta.cos()
        slope = (sine / cosine) * tangent_squared(view[..., 2]).sqrt()
        phi = visible_azimuth(u[..., 1].expand_as(slope), slope)
        facet = torch.stack(torch.broadcast_tensors(sine * phi.cos(), sine * phi.sin(), cosine), -1)
        light = mirrored(view, along_view(facet, view, back=True))
        return light, torch.zeros_like(light[..., 0], dtype=torch.bool)

    def density(self, cosines: Cosines) -> Tensor:
        half = HalfVector.of(cosines)
        seen = (half.cos_light / (cosines.view * half.cos)).clamp(max=2.0)
        return slope_area(half, sigma=self.sigma) * seen / (4 * half.cos_light)

    def stand_ins(self) -> dict[str, list[Option]]:
        """The same facets with one reflectance at every angle."""
        flat = self.fresnel.at_every_angle()
        if flat is None:
            return {}
        stand_in = TorranceSparrow(sigma=kept(self, "sigma"), fresnel=flat, normalised=self.normalised)
        return {FRESNEL_VARIATION: [Option("the reflectance of normal incidence", (FRESNEL_VARIATION,), stand_in)]}
