"""What the ladder of the rough surface is compared with: a fast top rung, and the slow reference above it."""

import torch
from torch import Tensor

from torchbrdf.directions import Cosines
from torchbrdf.models.oren_nayar import converged as slow
from torchbrdf.models.oren_nayar.rough_surface import RoughSurface
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane, slope_plane
from torchbrdf.parameters import ALBEDO, ROUGHNESS


def reference(albedo: Tensor, sigma: Tensor) -> RoughSurface:
    """The top of the ladder: 64 slopes, all bounces, graded azimuths. `reference_error` says how good it is."""
    return RoughSurface(albedo=albedo, sigma=sigma, nodes=64, order=6, graded=True, bounces="all", modes=8)


def converged(cosines: Cosines, *, albedo: Tensor, sigma: Tensor) -> Tensor:
    r"""Reflectance of V-cavities with Gaussian slopes, all bounces, integrated until nothing changes: no rung is above.

    .. math:: f_r = \int P(\theta; \sigma)\, \bar f(\theta)\, d\theta, \quad
        P \propto e^{-\theta^2/2\sigma^2} \sin\theta

    with f-bar the azimuth mean of the cavities of one slope angle: closed form for direct light, split at every kink
    for two bounces, 16 eigenmodes of the cavity for more. About a tenth of a second a direction and channel, after
    the modes are computed once. Without gradients.

    Args:
        cosines: of light, view and phase angle, each (...). float64
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: TypeError for directions that are not float64; ValueError when albedo or sigma leave their domains.
    Accuracy: direct light 1e-11 and two bounces 3e-9 of the golden values. Three and more bounces are known less well:
        at rho = 1 to 2e-8 of the whole for sigma = 0.3, and to 2e-5 for sigma = 1.
    Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
        (1995, DOI 10.1007/BF01679684), sections 4.1-4.3, eqs. (8)-(26) repaired; more bounces: own.
    """
    ALBEDO.check("converged: albedo", albedo)
    ROUGHNESS.check("converged: sigma", sigma)
    with torch.no_grad():
        rho = torch.atleast_1d(albedo)
        shape = torch.broadcast_shapes(cosines.light.shape, sigma.shape, rho.shape[:-1])
        seen = cosines.above_horizon.expand(shape)
        rho = rho.expand(*shape, rho.shape[-1])
        result = torch.zeros_like(rho, dtype=cosines.light.dtype)
        if seen.any():
            plane = SlopePlane(*(field.expand(shape)[seen][:, None] for field in slope_plane(cosines)))
            r = rho[seen].to(result)
            parts = slow.converged(plane, sigma.expand(shape)[seen][:, None], albedo=r)
            result[seen] = r * parts.direct + r * r * parts.two_bounce + parts.higher
        return result


def reference_error(albedo: Tensor, sigma: Tensor, cosines: Cosines) -> float:
    """Largest relative difference of `reference` from `converged` for albedo (channel,) and one sigma. [-]

    Args: cosines (...) as `converged`; those below the horizon do not count.
    """
    exact = converged(cosines, albedo=albedo, sigma=sigma)[cosines.above_horizon]
    with torch.no_grad():
        top = reference(albedo, sigma).evaluate(cosines)[cosines.above_horizon]
    return float((top / exact - 1).abs().max())
