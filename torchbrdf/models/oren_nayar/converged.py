"""The slow reference behind `torchbrdf.accuracy.converged`: Gaussian slopes integrated to about ten digits.

The azimuth mean of one slope angle is exact (direct) or split at every kink (interreflection). As a function of the
slope angle it has kinks of its own where a direction starts to be cut (tan theta_a = 1/tan theta) and where two lobes
start to overlap; the slope integral is split there, at a few widths of the Gaussian, and at multiples of the kinks,
because beyond a kink the mean varies with the *ratio* of the angle to the kink.
Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), eqs. (25), (26), in the form of `docs/equations/oren_nayar.md`, section 6.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import safe_divide
from torchbrdf.models.oren_nayar.azimuth import common_excess, direct_from, saturated_correlation, saturated_lobes
from torchbrdf.models.oren_nayar.azimuth_quadrature import two_bounce_mean
from torchbrdf.models.oren_nayar.cavity_modes import bounce_coefficients, modes_of
from torchbrdf.models.oren_nayar.images import Bounces, mean_images
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.slopes import gaussian_weights, shared_slopes

_GAUSSIAN_CUTS = (1.0, 2.2, 3.6, 5.2)  # standard deviations
_KINK_CUTS = (1.0, 1.5, 3.0, 8.0, 25.0, 90.0)  # multiples of a kink's tangent
_WIDTH = 8.8  # exp(-8.8^2/2) < 2e-17


class Converged(NamedTuple):
    """Reference values of unit albedo; f = rho direct + rho^2 two_bounce + higher (the latter already holds its
    albedo). [1/sr]
    """

    direct: Tensor  # (...)
    two_bounce: Tensor  # (...)
    higher: Tensor  # (...); zeros unless an albedo was given


def converged(
    plane: SlopePlane,
    sigma: Tensor,
    *,
    albedo: Tensor | None = None,
    panel_order: int = 16,
    order: int = 32,
    modes: int = 16,
    higher_slopes: int = 96,
    higher_order: int = 12,
    chunk: int = 8,
) -> Converged:
    """Gaussian rough surface, converged.

    Args:
        plane: directions (...) above the horizon, see `slope_plane`; float64.
        sigma: broadcastable with them, in [0, pi/2]. [rad]
        albedo: broadcastable, for three and more bounces; None leaves those out. [-]
        panel_order, order: nodes on each slope panel and each azimuth piece; modes: per slope.
        higher_slopes, higher_order: shared slopes and azimuth nodes of three and more bounces.
        chunk: directions at a time (memory).
    Accuracy: direct and two bounces within 1e-11 and 3e-9 of the golden values. Three and more bounces are known less
        well: relative to the whole BRDF at rho = 1, 60 directions up to 85 deg, `modes` = 12 and 16 differ from 20 by
        1.1e-7 and 2.3e-8 at sigma = 0.3, and by 5e-5 and 1.8e-5 at sigma = 1. More than 20 lose digits instead.
    """
    if plane.dot.dtype != torch.float64:
        raise TypeError(
            f"converged: directions must be float64, found {plane.dot.dtype}; the reference has no meaning in less."
        )
    shape = torch.broadcast_shapes(plane.dot.shape, sigma.shape, () if albedo is None else albedo.shape)
    flat = SlopePlane(*(field.expand(shape).reshape(-1) for field in plane))
    sigmas = sigma.to(torch.float64).expand(shape).reshape(-1)
    albedos = None if albedo is None else albedo.to(torch.float64).expand(shape).reshape(-1)
    parts = []
    for start in range(0, sigmas.numel(), chunk):
        part = slice(start, start + chunk)
        piece = SlopePlane(*(field[part] for field in flat))
        direct, two = _direct_and_two(piece, sigmas[part], panel_order, order)
        higher = (
            torch.zeros_like(direct)
            if albedos is None
            else _higher(piece, sigmas[part], albedos[part], modes=modes, nodes=higher_slopes, order=higher_order)
        )
        parts.append((direct, two, higher))
    return Converged(*(torch.cat(values).reshape(shape) for values in zip(*parts, strict=True)))


def slope_panels(plane: SlopePlane, sigma: Tensor, panel_order: int) -> tuple[Tensor, Tensor]:
    """Slope angles and normalised weights of the Gaussian for each direction (..., panel * node). sigma > 0. [rad]"""
    product = plane.tan_light * plane.tan_view
    cross = product * plane.delta.sin()
    along = plane.tan_light**2 + plane.tan_view**2
    kinks = [safe_divide(torch.ones_like(cross), t, where=t > 0) for t in (plane.tan_light, plane.tan_view)]
    kinks += [
        safe_divide((along + sign * 2 * plane.dot).clamp(min=0).sqrt(), cross, where=cross > 0) for sign in (1, -1)
    ]
    top = (_WIDTH * sigma).clamp(max=0.5 * math.pi)
    cuts = [torch.zeros_like(sigma), top, *(step * sigma for step in _GAUSSIAN_CUTS)]
    cuts += [torch.atan(step * kink) for kink in kinks for step in _KINK_CUTS]
    edges = torch.stack([torch.minimum(cut, top) for cut in cuts], dim=-1).sort(dim=-1).values
    x, weight = gauss_legendre(panel_order, sigma)
    # A cubic with flat ends: half-integer powers of the distance to a kink become smooth.
    weight, x = 6 * x * (1 - x) * weight, x * x * (3 - 2 * x)
    width = (edges[..., 1:] - edges[..., :-1])[..., None]
    angle = edges[..., :-1, None] + width * x
    density = width * weight * torch.exp(-0.5 * (angle / sigma[..., None, None]) ** 2) * angle.sin()
    angle, density = angle.flatten(-2), density.flatten(-2)
    return angle, density / density.sum(-1, keepdim=True)


def _direct_and_two(plane: SlopePlane, sigma: Tensor, panel_order: int, order: int) -> tuple[Tensor, Tensor]:
    """Both parts (...) of the slope integral; Lambert where sigma = 0."""
    rough = sigma > 0
    angle, weight = slope_panels(plane, torch.where(rough, sigma, 1.0), panel_order)
    wide = SlopePlane(*(field[..., None] for field in plane))
    cos_slope = angle.cos()
    lobes = saturated_lobes(wide, cos_slope=cos_slope, tan_slope=angle.tan())
    correlation = saturated_correlation(wide, lobes)
    direct = (weight * direct_from(common_excess(wide, lobes), correlation, cos_slope)).sum(-1)
    two = (weight * two_bounce_mean(wide, lobes, correlation, order=order, graded=True)).sum(-1)
    return torch.where(rough, direct, 1 / math.pi), torch.where(rough, two, 0.0)


def _higher(plane: SlopePlane, sigma: Tensor, albedo: Tensor, *, modes: int, nodes: int, order: int) -> Tensor:
    """Three and more bounces (...) on `nodes` shared slopes."""
    slopes = shared_slopes(nodes)
    cavities = modes_of(slopes, modes, torch.float64, plane.dot.device)
    angle = plane.dot.new_tensor(slopes)
    images = mean_images(
        plane,
        cos_slope=angle.cos(),
        tan_slope=angle.tan(),
        bounces=Bounces(two=False, modes=modes),
        order=order,
        graded=True,
        modes=cavities,
    ).higher
    eigenvalues = cavities.eigenvalues
    material = bounce_coefficients(eigenvalues, albedo)
    return torch.einsum("...k,...knt,...knt->...", gaussian_weights(sigma, nodes=nodes), images, material)
