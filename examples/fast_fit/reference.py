"""Directions to fit and to judge on, and the exact model there (torchbrdf's own modules)."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf.directions import Cosines
from torchbrdf.models.oren_nayar.cavity_modes import bounce_coefficients, modes_of
from torchbrdf.models.oren_nayar.images import Bounces, Images, mean_images
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane, slope_plane_from_angles
from torchbrdf.slopes import gaussian_weights, shared_slopes

NARROW = math.radians(4.0)  # Gaussians that 64 slopes resolve badly
MODES = 10


class Angles(NamedTuple):
    """Polar angles of light and view and the azimuth between them, each (P,). [rad]"""

    light: Tensor
    view: Tensor
    azimuth: Tensor

    def cosines(self) -> Cosines:
        light, view = self.light.cos(), self.view.cos()
        return Cosines.from_products(
            light, view, light * view + self.light.sin() * self.view.sin() * self.azimuth.cos()
        )


class Sample(NamedTuple):
    """pi times the exact reflectance of P directions, S roughnesses (and R albedos)."""

    angles: Angles
    sigmas: Tensor  # (S,) [rad]
    direct: Tensor  # of unit albedo (P, S)
    two_bounce: Tensor  # of unit albedo (P, S)
    higher: Tensor  # three and more bounces, the albedo already inside (P, S, R)

    def total(self, albedo: Tensor, bounces: int | str) -> Tensor:
        """pi f_r (P, S, R) at the albedos (R,) that `higher` was made for."""
        two = albedo * self.direct[..., None] + albedo**2 * self.two_bounce[..., None]
        return two + self.higher if bounces == "all" else two


def directions(seed: int, count: int, top: float, *, edges: bool) -> Angles:
    """`count` directions up to the polar angle `top` [deg], uniform in all three angles.

    With `edges`, half of them crowd where fits fail: in the plane of incidence, at light = view, at grazing light.
    """
    generator = torch.Generator().manual_seed(seed)

    def u(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator, dtype=torch.float64)

    light, view = torch.deg2rad(u(2, count) * top)
    azimuth = math.pi * u(count)
    if edges:
        n, limit = count // 8, math.radians(top)
        azimuth[:n] = math.pi * (1 - (0.5 * u(n)) ** 3)
        azimuth[n : 2 * n] = math.pi * (0.7 * u(n)) ** 3
        light[: 2 * n], view[: 2 * n] = limit * (1 - u(2, 2 * n) ** 2)
        view[2 * n : 3 * n] = (light[2 * n : 3 * n] + 0.15 * (u(n) - 0.5)).clamp(0, limit)
        azimuth[2 * n : 3 * n] = 0.3 * u(n) ** 2
        light[3 * n : 4 * n] = limit * (1 - u(n) ** 3)
    return Angles(light, view, azimuth)


def exact(angles: Angles, sigmas: Tensor, *, albedos: tuple[float, ...], chunk: int = 400) -> Sample:
    """The exact model on shared slopes, which cost nothing per roughness: 64, and 256 for narrow Gaussians."""
    narrow = sigmas < NARROW
    parts = []
    for start in range(0, len(angles.light), chunk):
        plane = slope_plane_from_angles(*(a[start : start + chunk] for a in angles))
        direct = plane.dot.new_zeros((len(plane.dot), len(sigmas)))
        two = torch.zeros_like(direct)
        for nodes, order, mine in ((64, 12, ~narrow), (256, 8, narrow)):
            if mine.any():
                images = _images(plane, nodes, order, Bounces(two=True, modes=0))
                weights = gaussian_weights(sigmas[mine], nodes=nodes).T
                direct[:, mine], two[:, mine] = images.direct @ weights, images.two_bounce @ weights
        images = _images(plane, 64, 12, Bounces(two=False, modes=MODES)).higher
        eigenvalues = modes_of(shared_slopes(64), MODES, images.dtype, images.device).eigenvalues
        material = bounce_coefficients(eigenvalues, torch.tensor(albedos, dtype=torch.float64))
        by_slope = torch.einsum("pknt,rknt->prk", images, material)
        parts.append((direct, two, torch.einsum("prk,sk->psr", by_slope, gaussian_weights(sigmas, nodes=64))))
    return Sample(angles, sigmas, *(math.pi * torch.cat(p) for p in zip(*parts, strict=True)))


def _images(plane: SlopePlane, nodes: int, order: int, bounces: Bounces) -> Images:
    slopes = shared_slopes(nodes)
    angle = plane.dot.new_tensor(slopes)
    modes = modes_of(slopes, bounces.modes, plane.dot.dtype, plane.dot.device) if bounces.modes else None
    return mean_images(
        plane, cos_slope=angle.cos(), tan_slope=angle.tan(), bounces=bounces, order=order, graded=False, modes=modes
    )
