"""The exact rough surface at many roughnesses and albedos at once, for tables: what depends on the slope alone, once.

Direct light and two bounces are integrated over slope panels that end at every kink of the two directions, as the slow
reference does, but the same for all roughnesses; three and more bounces, which are smoother, over shared slopes.
Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), eqs. (25), (26); more bounces: own.
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
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane, slope_plane_from_angles
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.slopes import gaussian_weights, shared_slopes

# Ends of panels that serve every roughness: a Gaussian of 1 deg, or of 60, is smooth on each.
_CUTS = tuple(math.radians(cut) for cut in (0.0, 0.7, 1.5, 3.0, 5.0, 8.0, 13.0, 20.0, 30.0, 45.0, 65.0, 90.0))
_KINK_CUTS = (1.0, 3.0)  # multiples of a kink's tangent
_FLATTEST = math.radians(0.05)  # below, the Gaussian is narrower than the first nodes; deviations there grow as sigma^2


class SlopeRule(NamedTuple):
    """How finely slopes and azimuths are sampled: nodes of a panel, azimuths of a piece; shared slopes and modes."""

    panel_order: int = 5
    order: int = 8
    shared: int = 24
    modes: int = 8


def rough_reflectances(
    light: Tensor, view: Tensor, dphi: Tensor, sigma: Tensor, albedo: Tensor, *, rule: SlopeRule
) -> Tensor:
    """f_r/rho (P, sigma, rho) [1/sr] at polar angles and azimuth (P,) [rad], for roughnesses (S,) [rad] and albedos
    (T,); all bounces, float64.
    """
    plane = slope_plane_from_angles(light, view, dphi)
    direct, two = _direct_and_two(plane, sigma, rule)
    return direct[..., None] + albedo * two[..., None] + _higher(plane, sigma, albedo, rule)


def _direct_and_two(plane: SlopePlane, sigma: Tensor, rule: SlopeRule) -> tuple[Tensor, Tensor]:
    """Both parts of unit albedo (P, S)."""
    angle, width = _slopes(plane, rule.panel_order)
    wide = SlopePlane(*(field[..., None] for field in plane))
    cosine = angle.cos()
    lobes = saturated_lobes(wide, cos_slope=cosine, tan_slope=angle.tan())
    correlation = saturated_correlation(wide, lobes)
    direct = direct_from(common_excess(wide, lobes), correlation, cosine)
    two = two_bounce_mean(wide, lobes, correlation, order=rule.order)
    ratio = angle / sigma.clamp(min=_FLATTEST)[:, None, None]  # (S, P, slope)
    density = torch.exp(-0.5 * ratio * ratio) * (width * angle.sin())
    share = density / density.sum(-1, keepdim=True)
    return (share * direct).sum(-1).mT, (share * two).sum(-1).mT


def _slopes(plane: SlopePlane, panel_order: int) -> tuple[Tensor, Tensor]:
    """Slope angles and their widths (P, panel * node) [rad], see `converged.slope_panels`."""
    product = plane.tan_light * plane.tan_view
    cross = product * plane.delta.sin()
    along = plane.tan_light**2 + plane.tan_view**2
    kinks = [safe_divide(torch.ones_like(cross), t, where=t > 0) for t in (plane.tan_light, plane.tan_view)]
    kinks += [
        safe_divide((along + sign * 2 * plane.dot).clamp(min=0).sqrt(), cross, where=cross > 0) for sign in (1, -1)
    ]
    cuts = [torch.full_like(cross, cut) for cut in _CUTS]
    cuts += [torch.atan(step * kink) for kink in kinks for step in _KINK_CUTS]
    edges = torch.stack(cuts, dim=-1).sort(dim=-1).values
    x, weight = gauss_legendre(panel_order, cross)
    weight, x = 6 * x * (1 - x) * weight, x * x * (3 - 2 * x)  # half-integer powers next to a kink become smooth
    width = (edges[..., 1:] - edges[..., :-1])[..., None]
    return (edges[..., :-1, None] + width * x).flatten(-2), (width * weight).flatten(-2)


def _higher(plane: SlopePlane, sigma: Tensor, albedo: Tensor, rule: SlopeRule) -> Tensor:
    """Three and more bounces over rho (P, S, T)."""
    slopes = shared_slopes(rule.shared)
    modes = modes_of(slopes, rule.modes, torch.float64, plane.dot.device)
    angle = plane.dot.new_tensor(slopes)
    images = mean_images(
        plane,
        cos_slope=angle.cos(),
        tan_slope=angle.tan(),
        bounces=Bounces(two=False, modes=rule.modes),
        order=rule.order,
        modes=modes,
    ).higher.flatten(-3)
    material = bounce_coefficients(modes.eigenvalues, albedo)
    material = safe_divide(material, albedo[:, None, None, None], where=(albedo > 0)[:, None, None, None])
    weights = gaussian_weights(sigma, nodes=rule.shared)
    shares = (weights[:, None, :, None, None] * material).flatten(-3)  # (S, T, image)
    return torch.einsum("pk,stk->pst", images, shares)
