"""Points at which the fit is made and judged, and what the reference returns there, by order."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.polynomial import chebyshev
from torch import Tensor

from torchbrdf import SMOOTH_HEIGHTFIELD, Cosines, rms_slope_from_sigma
from torchbrdf.models.heightfield.direct import QUADRATURES, direct_light
from torchbrdf.models.heightfield.slope_frame import slope_frame
from torchbrdf.models.heightfield.table import TableSize, bounce_table, read_table

ROUGHEST = math.pi / 2
TABLES = 28  # Chebyshev nodes in sigma: tables in between are interpolated, to 1e-5 of f
SIZE = TableSize(polar=14, orders=24)
QUADRATURE = QUADRATURES[240]
PIECE = 2000  # points at a time


@dataclass(frozen=True)
class Points:
    """Polar angles and azimuth difference [rad] and roughness [rad], each (n,)."""

    light: Tensor
    view: Tensor
    dphi: Tensor
    sigma: Tensor

    def cosines(self) -> Cosines:
        i, r, d = self.light, self.view, self.dphi
        normal = torch.stack((0 * i, 0 * i, 0 * i + 1), -1)
        light = torch.stack((i.sin(), 0 * i, i.cos()), -1)
        view = torch.stack((r.sin() * d.cos(), r.sin() * d.sin(), r.cos()), -1)
        return Cosines.of(normal, light, view, normalize=True)

    @property
    def steepest(self) -> Tensor:
        """The larger polar angle. [deg]"""
        return torch.rad2deg(torch.maximum(self.light, self.view))


def fitted_points(count: int, seed: int, top: float = 89.0) -> Points:
    """Directions up to `top` degrees, a third of them beyond 70, crowded in the plane of incidence and at light = view;
    roughness of 1 to 61 degrees, a seventh of them of any."""
    rng = np.random.default_rng(seed)

    def polar() -> np.ndarray:
        u = rng.random(count)
        return np.where(rng.random(count) < 0.35, 70 + (top - 70) * u, top * u)

    light, view, dphi = polar(), polar(), 180 * rng.random(count)
    plane, near = rng.integers(0, 6, count), 20 * rng.random(count) ** 2
    dphi = np.where(plane == 0, 180 - near, np.where(plane == 1, near, dphi))
    beside = np.clip(light + 2 * rng.standard_normal(count), 0, top)
    view = np.where(rng.random(count) < 0.1, beside, view)
    any_sigma = 0.3 + 89.7 * rng.random(count)
    sigma = np.where(rng.random(count) < 0.85, 1 + 60 * rng.random(count), any_sigma)
    return Points(*(torch.tensor(np.radians(x)) for x in (light, view, dphi, sigma)))


def reported_points(count: int, seed: int, low: float, high: float, sigma: tuple[float, float] = (2.0, 60.0)) -> Points:
    """Polar angles, azimuths and roughness uniform; the larger polar angle in [low, high] degrees."""
    rng = np.random.default_rng(seed)
    larger = low + (high - low) * rng.random(count) if low > 0 else high * np.sqrt(rng.random(count))
    other = larger * rng.random(count)
    swapped = rng.random(count) < 0.5
    light, view = np.where(swapped, other, larger), np.where(swapped, larger, other)
    widths = sigma[0] + (sigma[1] - sigma[0]) * rng.random(count)
    return Points(*(torch.tensor(np.radians(x)) for x in (light, view, 180 * rng.random(count), widths)))


class Reference:
    """f_1, f_2, .. of unit albedo at points of any roughness; the tables of bounces are made once."""

    def __init__(self):
        nodes = (chebyshev.chebpts1(TABLES) + 1) / 2 * ROUGHEST
        one = torch.ones((), dtype=torch.float64)
        tables = [
            bounce_table(torch.tensor(s, dtype=torch.float64), one, SMOOTH_HEIGHTFIELD, QUADRATURE, SIZE) for s in nodes
        ]
        stacked = torch.stack(tables)
        series = torch.linalg.solve(self._rows(torch.tensor(nodes)), stacked.flatten(1))
        self._series = series.unflatten(1, stacked.shape[1:])

    def orders(self, points: Points) -> Tensor:
        """(n, 25) [1/sr]."""
        found = []
        fields = (points.light, points.view, points.dphi, points.sigma)
        for piece in zip(*(f.split(PIECE) for f in fields), strict=True):
            some = Points(*piece)
            cosines, one = some.cosines(), torch.ones_like(some.sigma)
            frame = slope_frame(cosines, rms_slope_from_sigma(some.sigma))
            direct = direct_light(frame, one, SMOOTH_HEIGHTFIELD, QUADRATURE)
            # read with every Chebyshev coefficient, then summed for each point's sigma
            by_node = torch.stack([read_table(cosines, table, SIZE) for table in self._series])
            bounced = torch.einsum("nj,jnk->nk", self._rows(some.sigma), by_node)
            found.append(torch.cat((direct[:, None], bounced), 1))
        return torch.cat(found)

    @staticmethod
    def _rows(sigma: Tensor) -> Tensor:
        return torch.tensor(chebyshev.chebvander((2 * sigma / ROUGHEST - 1).numpy(), TABLES - 1))


def totals(orders: Tensor, albedos: Tensor) -> Tensor:
    """Whole BRDF (n, albedo) [1/sr]."""
    return orders @ albedos[None] ** torch.arange(1, orders.shape[1] + 1, dtype=orders.dtype)[:, None]
