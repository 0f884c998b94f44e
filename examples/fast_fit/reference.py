"""Points at which the fit is made and judged, and what the exact model returns there (torchbrdf's own modules)."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from torchbrdf import Cosines
from torchbrdf.models.oren_nayar.cavity_modes import bounce_coefficients, modes_of
from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.images import Bounces, mean_images
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane, slope_plane_from_angles
from torchbrdf.slopes import gaussian_weights, shared_slopes

ALBEDOS = torch.tensor([0.1, 0.3, 0.5, 0.7, 0.9, 1.0], dtype=torch.float64)
ROUGHNESSES = 3  # a direction: three and more bounces cost by direction, whatever the roughness


@dataclass(frozen=True)
class Quadrature:
    """Nodes of the reference; `report.py` compares it with one of twice the order."""

    panel: int = 8  # nodes on each panel of slopes, whose ends follow direction and roughness
    azimuth: int = 12  # nodes on each azimuth piece, graded
    slopes: int = 64  # shared slopes of three and more bounces,
    modes: int = 12  # the modes of each,
    later: int = 8  # and their azimuth nodes, graded


@dataclass(frozen=True)
class Points:
    """Polar angles and azimuth difference (n,), and roughness (n, S) at each. [rad]"""

    light: Tensor
    view: Tensor
    dphi: Tensor
    sigma: Tensor

    def cosines(self) -> Cosines:
        """Of vectors (n, 1, 3): they keep the digits of a small azimuth."""
        i, r, d = (angle[:, None] for angle in (self.light, self.view, self.dphi))
        normal = torch.stack((0 * i, 0 * i, 0 * i + 1), -1)
        light = torch.stack((i.sin(), 0 * i, i.cos()), -1)
        view = torch.stack((r.sin() * d.cos(), r.sin() * d.sin(), r.cos()), -1)
        return Cosines.of(normal, light, view, normalize=True)

    @property
    def steepest(self) -> Tensor:
        """The larger polar angle (n, 1). [deg]"""
        return torch.rad2deg(torch.maximum(self.light, self.view))[:, None]

    def moved(self, step: float) -> "Points":
        """With another roughness. [rad]"""
        return Points(self.light, self.view, self.dphi, self.sigma + step)


@dataclass(frozen=True)
class Truth:
    """What the exact model returns at points and roughnesses (n, S). [1/sr]"""

    direct: Tensor  # of unit albedo
    two_bounce: Tensor  # of unit albedo
    higher: Tensor  # (n, S, albedo), the albedo already inside

    def two(self, albedo: Tensor) -> Tensor:
        """The BRDF of two bounces (n, S, albedo)."""
        return albedo * self.direct[..., None] + albedo * albedo * self.two_bounce[..., None]

    def all(self) -> Tensor:
        """The BRDF of all bounces (n, S, albedo) at `ALBEDOS`."""
        return self.two(ALBEDOS) + self.higher


def fitted_points(count: int, seed: int, top: float = 89.9) -> Points:
    """Directions up to `top` degrees, a third of them beyond 70, crowded in the plane of incidence and at light = view;
    roughness of 1 to 61 degrees, a seventh of any."""
    rng = np.random.default_rng(seed)

    def polar() -> np.ndarray:
        u = rng.random(count)
        return np.where(rng.random(count) < 0.35, 70 + (top - 70) * u, top * u)

    light, view, dphi = polar(), polar(), 180 * rng.random(count)
    plane, near = rng.integers(0, 6, count), 20 * rng.random(count) ** 2
    dphi = np.where(plane == 0, 180 - near, np.where(plane == 1, near, dphi))
    beside = np.clip(light + 2 * rng.standard_normal(count), 0, top)
    view = np.where(rng.random(count) < 0.1, beside, view)
    shape = (count, ROUGHNESSES)
    any_sigma = 0.3 + 89.7 * rng.random(shape)
    sigma = np.where(rng.random(shape) < 0.85, 1 + 60 * rng.random(shape), any_sigma)
    return Points(*(torch.tensor(np.radians(x)) for x in (light, view, dphi, sigma)))


def reported_points(
    count: int, seed: int, low: float, high: float, *, sigma: tuple[float, ...] = (), crowded: bool = False
) -> Points:
    """Polar angles and azimuths uniform, the larger polar angle in [low, high] degrees, or as `fitted_points`;
    roughness as given [deg], or uniform in 2 to 60 degrees."""
    rng = np.random.default_rng(seed)
    larger = low + (high - low) * rng.random(count) if low > 0 else high * np.sqrt(rng.random(count))
    other = larger * rng.random(count)
    swapped = rng.random(count) < 0.5
    light, view = np.where(swapped, other, larger), np.where(swapped, larger, other)
    dphi = 180 * rng.random(count)
    widths = np.tile(sigma, (count, 1)) if sigma else 2 + 58 * rng.random((count, ROUGHNESSES))
    uniform = Points(*(torch.tensor(np.radians(x)) for x in (light, view, dphi, widths)))
    if not crowded:
        return uniform
    there = fitted_points(count, seed, top=high)
    return Points(there.light, there.view, there.dphi, uniform.sigma)


def exact(points: Points, quadrature: Quadrature | None = None, *, chunk: int = 50) -> Truth:
    """The exact model; direct and two bounces from `converged`."""
    q = quadrature or Quadrature()
    plane = slope_plane_from_angles(points.light, points.view, points.dphi)
    wide = SlopePlane(*(field[:, None] for field in plane))
    both = converged(wide, points.sigma, panel_order=q.panel, order=q.azimuth, chunk=24)
    slopes = shared_slopes(q.slopes)
    modes = modes_of(slopes, q.modes, torch.float64, points.light.device)
    material = bounce_coefficients(modes.eigenvalues, ALBEDOS)
    angle = torch.tensor(slopes, dtype=torch.float64)
    higher = []
    for start in range(0, len(points.light), chunk):
        images = mean_images(
            SlopePlane(*(field[start : start + chunk] for field in plane)),
            cos_slope=angle.cos(),
            tan_slope=angle.tan(),
            bounces=Bounces(two=False, modes=q.modes),
            order=q.later,
            graded=True,
            modes=modes,
        ).higher
        by_slope = torch.einsum("pknt,rknt->prk", images, material)
        weights = gaussian_weights(points.sigma[start : start + chunk], nodes=q.slopes)
        higher.append(torch.einsum("prk,psk->psr", by_slope, weights))
    return Truth(both.direct, both.two_bounce, torch.cat(higher))


def importance(points: Points) -> Tensor:
    """What an error counts (n, S): less beyond 85 and 89 degrees and beyond 62 of roughness; in proportion to what is
    left of the roughness where that is small, which makes the derivative by sigma right there too."""
    sigma = torch.rad2deg(points.sigma)
    weight = torch.where(points.steepest > 89, 0.1, torch.where(points.steepest > 85, 0.35, 1.0)).double()
    return weight * torch.where(sigma > 62, 0.4, 1.0) * (SMOOTH / sigma).clamp(min=1) ** 2


SMOOTH = math.degrees(0.1)  # [deg] below which a surface counts as nearly smooth
