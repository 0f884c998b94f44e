r"""A slow model as a few images of the geometry times what each material takes of them, both on grids.

.. math:: f_r = \frac\rho\pi + \frac{\rho}{m(x, v, z)} \sum_{r=1}^{R} U_r(x, v, z)\, c_r(\sigma, \rho)

with m the mean cosine of light and view. U and c are the leading singular vectors of samples at all sites of the
geometry and all sites of the material: of all sums of R products the nearest one.
"""

import math
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import torch
from torch import Tensor

from torchbrdf.interpolation.geometry import angles_at
from torchbrdf.interpolation.materials import albedo_at, sigma_at
from torchbrdf.interpolation.splines import FEWEST_SITES, SplineTable, sites, spline_coefficients
from torchbrdf.interpolation.store import Arrays, kept_or_built

_GRAZING = math.cos(math.radians(85.0))  # mean cosine below which errors count relative to what grows there
_GEOMETRIES_AT_A_TIME = 64
_MOST_IMAGES = 25  # what 30 materials, the fewest that a grid may have, can tell apart

# f_r/rho [1/sr] (..., sigma, rho) at angles (...), of the more grazing direction, of the other and of the azimuth
# between them, for roughnesses (sigma,) and albedos (rho,); float64. [rad]
Sample = Callable[[Tensor, Tensor, Tensor, Tensor, Tensor], Tensor]


Key = TypeVar("Key", bound=Hashable)


class TableGrid(NamedTuple):
    """Sites of a table along each axis, at least 6, and images kept.

    depth, apart and slant are the coordinates of `interpolation.geometry`; the roughnesses lie in [0, pi/2], the
    albedos in [0, 1].
    """

    depth: int
    apart: int
    slant: int
    sigmas: int
    albedos: int
    images: int

    def check(self, name: str) -> None:
        """Raise ValueError unless every axis carries a spline and there is an image."""
        if min(self[:-1]) < FEWEST_SITES or not 1 <= self.images <= _MOST_IMAGES:
            raise ValueError(
                f"{name}: grid needs at least {FEWEST_SITES} sites along each axis and 1 to {_MOST_IMAGES} images; "
                f"found {self}."
            )


class ImageTable(NamedTuple):
    """Splines of U (image) over the geometry, and of c (image) over the material."""

    geometry: SplineTable
    material: SplineTable

    def to(self, like: Tensor) -> "ImageTable":
        """In the dtype and on the device of `like`."""
        return ImageTable(self.geometry.to(like), self.material.to(like))


def image_table(name: str, settings: str, sources: Iterable[Path], sample: Sample, grid: TableGrid) -> ImageTable:
    """The table of a model in float64, from disk or sampled; see `kept_or_built` for the first three arguments."""
    settings = f"{settings}; {tuple(grid)}"
    arrays = kept_or_built(name, settings, (*sources, Path(__file__).parent), lambda: _built(sample, grid))
    return ImageTable(*(SplineTable.of(torch.from_numpy(arrays[key])) for key in ImageTable._fields))


@lru_cache(maxsize=16)
def converted(table: Callable[[Key], ImageTable], key: Key, dtype: torch.dtype, device: torch.device) -> ImageTable:
    """`table(key)` in a dtype, on a device: built, read and converted once."""
    return table(key).to(torch.empty((), dtype=dtype, device=device))


def _built(sample: Sample, grid: TableGrid) -> Arrays:
    with torch.no_grad(), _one_thread():
        sigma = sigma_at(torch.from_numpy(sites(grid.sigmas)))
        albedo = albedo_at(torch.from_numpy(sites(grid.albedos)))
        axes = (torch.from_numpy(sites(count)) for count in grid[:3])
        angles = angles_at(*(axis.flatten() for axis in torch.meshgrid(*axes, indexing="ij")))
        pieces = zip(*(angle.split(_GEOMETRIES_AT_A_TIME) for angle in angles), strict=True)
        values = torch.cat([sample(a, b, dphi, sigma, albedo) for a, b, dphi in pieces]).flatten(1).numpy()
    mean_cosine = (0.5 * (angles[0].cos() + angles[1].cos())).numpy()[:, None]
    rough = np.repeat(sigma.numpy() > 0, grid.albedos)
    excess = np.where(rough, values - 1 / math.pi, 0.0) * mean_cosine
    images, shares = _leading(excess, 1 / np.maximum(mean_cosine, _GRAZING), grid.images)
    return {
        "geometry": spline_coefficients(images.reshape(*grid[:3], -1), 3),
        "material": spline_coefficients(shares.reshape(*grid[3:5], -1), 2),
    }


@contextmanager
def _one_thread() -> Iterator[None]:
    """Arrays that fit a core's cache are not worth sharing: on a busy machine the threads only wait for each other."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _leading(samples: np.ndarray, weight: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Images (geometry, count) and shares (material, count) whose products are nearest to samples (geometry, material),
    each geometry with its weight (geometry, 1).
    """
    weighted = samples * weight
    _, vectors = np.linalg.eigh(weighted.T @ weighted)
    shares = vectors[:, ::-1][:, :count]
    largest = shares[np.abs(shares).argmax(0), np.arange(shares.shape[1])]
    shares = shares * np.sign(largest)  # a vector and its opposite are the same: one of them
    shares[~samples.any(0)] = 0.0  # what differs from Lambert nowhere is Lambert to all digits
    return samples @ shares, shares
