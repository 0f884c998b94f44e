"""Cavities that all have the same slope: isotropic ones, and aligned grooves."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.models.oren_nayar.azimuth_paper import direct_mean_paper, two_bounce_mean_paper
from torchbrdf.models.oren_nayar.cavity_modes import CavityModes, modes_of
from torchbrdf.models.oren_nayar.images import Bounces, added, cavity_images, mean_images
from torchbrdf.models.oren_nayar.rough_surface import BounceCount
from torchbrdf.models.oren_nayar.slope_plane import slope_plane
from torchbrdf.parameters import ALBEDO, Constrained, Interval, ParameterValue
from torchbrdf.sampling import CltcSampled, equivalent_roughness

# Steeper than 89 degrees a cavity is 57 times deeper than half its width, and the tangent leaves float32.
SLOPE = Interval(0.0, math.radians(89), "rad", even=True)


def _modes(model: BRDF, slope: Tensor, bounces: Bounces, like: Tensor) -> CavityModes | None:
    """Modes of a slope that is held fixed; they are not differentiated with respect to it."""
    if not bounces.modes:
        return None
    name = type(model).__name__
    if "fixed_slope" not in model._buffers or slope.ndim:
        raise ValueError(f'{name} with bounces="all" needs one fixed slope: slope=fixed(...); else use bounces=2.')
    return modes_of((float(slope),), bounces.modes, like.dtype, like.device)


class _OneSlope(CltcSampled, BRDF):
    albedo: Constrained = Constrained(ALBEDO)
    slope: Constrained = Constrained(SLOPE)

    def sampling_roughness(self) -> Tensor:
        # the slope itself for sigma: at worst variance 0.06 up to 0.8 rad, 0.15 at 1.1, 0.36 at 1.4. Aligned grooves
        # lean across what this lobe follows: 0.29 and 0.74 at 0.8 and 1.4 rad, half of what the cosine with a quarter
        # uniform has, whose largest weight is up to a third smaller
        return equivalent_roughness(self.slope)


@final
class SingleSlopeVCavities(_OneSlope):
    r"""Isotropic V-cavities of one slope angle, azimuth mean exact for any geometry.

    .. math::
        f_r = \frac{\rho}{\pi} \cos\theta_a [1 + \overline{c(a) c(b)} + 2 \overline{(\min(a, b) - 1)_+}] + \rho^2 I
              + \text{more bounces}

    with a, b the projections of light and view on the facet in the slope plane and c the clamp to [-1, 1].

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        slope: angle of the facets theta_a, scalar or (...). [rad] in [0, 89 deg]; 0 is Lambert exactly.
        order: azimuth nodes on each piece of the interreflection: 16 errs by 1e-8, 24 by 2e-12.
        bounces: 1 (direct), 2 or "all"; all of them need one fixed slope.
        modes: eigenmodes that carry three and more bounces.
    Components: direct, two_bounce, higher (those followed).
    Raises: ValueError outside the domains, and for all bounces with a trained slope (their modes have no derivative).
    Deviations: none in direct light (2e-14 of adaptive quadrature). Zero subgradient at light = view. The modes of
        three and more bounces are looked up by the number that the slope is, which breaks the graph of torch.compile.
    Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
        (1995, DOI 10.1007/BF01679684), section 4.2, eqs. (23), (19), (46); azimuth means: own derivation.
    """

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        slope: ParameterValue = 0.5,
        order: int = 16,
        bounces: BounceCount = 2,
        modes: int = 12,
    ):
        super().__init__()
        self.albedo = albedo
        self.slope = slope
        self.order = order
        self._bounces = Bounces.of(type(self).__name__, bounces, modes)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        plane = slope_plane(cosines)
        modes = _modes(self, self.slope, self._bounces, plane.dot)
        slope = self.slope[..., None]
        images = mean_images(
            plane,
            cos_slope=slope.cos(),
            tan_slope=slope.tan(),
            bounces=self._bounces,
            order=self.order,
            graded=True,
            modes=modes,
        )
        return added(
            images, self.albedo, bounces=self._bounces, eigenvalues=None if modes is None else modes.eigenvalues
        )


@final
class ClosedFormVCavities(_OneSlope):
    """Isotropic V-cavities of one slope angle in closed form: Oren & Nayar 1994, eqs. (45) direct, (49) two bounces.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        slope: angle of the facets theta_a, scalar or (...). [rad] in [0, 89 deg]; 0 is Lambert exactly.
    Components: direct, two_bounce.
    Raises: ValueError outside the domains.
    Deviations: direct light is exact at relative azimuths 0, 90 and 180 deg and interpolated between, up to
        0.34 /sr off at 45 deg (grazing, steep slopes); eq. (48) of the same paper approximates the exchange.
    Source: Oren & Nayar 1994, long version (as `SingleSlopeVCavities`), eqs. (24), (45), (49).
    """

    def __init__(self, *, albedo: ParameterValue = 0.5, slope: ParameterValue = 0.5):
        super().__init__()
        self.albedo = albedo
        self.slope = slope

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        plane = slope_plane(cosines)
        slope = {"cos_slope": self.slope.cos(), "tan_slope": self.slope.tan()}
        rho = torch.atleast_1d(self.albedo)
        return {
            "direct": rho * direct_mean_paper(plane, **slope)[..., None],
            "two_bounce": rho * rho * two_bounce_mean_paper(plane, **slope)[..., None],
        }


@final
class UnidirectionalVCavities(_OneSlope):
    r"""Aligned grooves of one slope: anisotropic, closed form. The tangent runs ACROSS the grooves.

    .. math::
        f_r = \tfrac12 [f(u) + f(-u)], \quad
        f(u) = \frac{\cos\theta_a}{\pi} [\rho \min(X_+ Y_+, 2 X_+, 2 Y_+) + \rho^2 X'_+ Y_+ IF/\pi]

    with X = 1 + u.p, X' = 1 - u.p, Y = 1 + u.q in the slope plane and IF the exact exchange of
    Oren & Nayar 1994, eq. (19).

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        slope: angle of the facets theta_a, scalar or (...). [rad] in [0, 89 deg]; 0 is Lambert exactly.
        bounces: 1 (direct), 2 or "all"; all of them need one fixed slope.
        modes: eigenmodes that carry three and more bounces.
    Components: direct, two_bounce, higher (those followed).
    Raises: ValueError outside the domains, without a tangent, and for all bounces with a trained slope.
    Deviations: none for two bounces; the BRDF itself has kinks where a facet starts to be cut. With all bounces the
        graph of torch.compile breaks, as in `SingleSlopeVCavities`.
    Source: Oren & Nayar 1994, long version (as `SingleSlopeVCavities`), section 4.1, eqs. (19), (22), (38) repaired.
    """

    anisotropic = True

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        slope: ParameterValue = 0.5,
        bounces: BounceCount = 2,
        modes: int = 12,
    ):
        super().__init__()
        self.albedo = albedo
        self.slope = slope
        self._bounces = Bounces.of(type(self).__name__, bounces, modes)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        along = cosines.tangent_plane
        modes = _modes(self, self.slope, self._bounces, cosines.phase)
        tangent = self.slope.tan()
        images = cavity_images(
            (tangent * along.light_tangent / cosines.light)[..., None],
            (tangent * along.view_tangent / cosines.view)[..., None],
            cos_slope=self.slope.cos()[..., None],
            bounces=self._bounces,
            modes=modes,
        )
        return added(
            images, self.albedo, bounces=self._bounces, eigenvalues=None if modes is None else modes.eigenvalues
        )
