"""The exact rough surface with all bounces, read from a table: a hundred times cheaper."""

from functools import lru_cache, partial
from pathlib import Path
from typing import Any, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf._constants import constant
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.interpolation.images import ImageTable, TableGrid, converted, image_table
from torchbrdf.interpolation.surface import InterpolatedSurface, interpolated
from torchbrdf.models.oren_nayar.fast import FastRoughSurface
from torchbrdf.models.oren_nayar.many_roughnesses import SlopeRule, rough_reflectances
from torchbrdf.models.rungs import Member, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue, kept

ROUGH_SURFACE_GRID = TableGrid(depth=26, apart=24, slant=14, sigmas=20, albedos=9, images=20)


@lru_cache(maxsize=8)
def rough_surface_table(grid: TableGrid) -> ImageTable:
    """The table of all rough surfaces (float64), built when there is none on disk."""
    rule = SlopeRule()
    sample = partial(rough_reflectances, rule=rule)
    return image_table("rough-surface", f"{tuple(rule)}", [Path(__file__).parent], sample, grid)


@constant
def _table_in(grid: TableGrid, dtype: torch.dtype, device: torch.device) -> ImageTable:
    return converted(rough_surface_table, grid, dtype, device)


def interpolated_rough_surface(
    cosines: Cosines, *, albedo: Tensor, sigma: Tensor, grid: TableGrid = ROUGH_SURFACE_GRID
) -> Tensor:
    r"""The exact V-cavity surface of Gaussian slopes with all bounces, read from a table.

    .. math:: f_r = \frac\rho\pi + \frac{\rho}{m} \sum_{r=1}^{R} U_r(x, v, z)\, c_r(\sigma, \rho)

    with m the mean cosine of light and view, and U, c cubic splines in coordinates of directions and material
    (`torchbrdf.interpolation`). The table is built at the first call, in about 4 seconds of one core, and kept in
    $TORCHBRDF_CACHE, else $XDG_CACHE_HOME/torchbrdf, else ~/.cache/torchbrdf.

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
        grid: sites of the table along each axis, and images R.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo or sigma leave their domains, for fewer than 6 sites or other than 1 to 25 images.
    Deviations: from `torchbrdf.accuracy.converged`, sigma 2 to 60 deg, rho 0.1 to 0.95, in units of rho/pi: rms 5e-5
        and at most 1.5e-3 where the more grazing direction is within 85 deg, 2e-4 and 4e-3 up to 89 deg, 9e-4 and 2e-2
        up to 89.9 deg (`examples/benchmarks/interpolated_surfaces.py`); from 89.95 deg on held. White facets return 1
        within 1e-3. Has the subgradient 0 at the cones light = view and light = mirrored view.
    Source: of what is tabulated: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI
        10.1145/192161.192213, long version (1995, DOI 10.1007/BF01679684), eqs. (8)-(26) repaired, more bounces: own;
        the table: own.
    """
    name = "interpolated_rough_surface"
    ALBEDO.check(f"{name}: albedo", albedo)
    ROUGHNESS.check(f"{name}: sigma", sigma)
    grid.check(name)
    tables = (_table_in(grid, t.dtype, t.device) for t in (cosines.light, sigma))
    return cosines.zero_below_horizon(interpolated(cosines, *tables, albedo=albedo, sigma=sigma))


@final
class InterpolatedRoughSurface(InterpolatedSurface):
    """Table of the exact rough surface as a module; see `interpolated_rough_surface` for equation and deviations.

    Linear in 1 + R images of the geometry, for all roughnesses and albedos. No model offers it as a stand-in, since
    the first call may have to build the table.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad]
        grid: as in `interpolated_rough_surface`.
    Components: all_bounces.
    Raises: ValueError outside the domains, or for a grid that is too small.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(
        self, *, albedo: ParameterValue = 0.5, sigma: ParameterValue = 0.3, grid: TableGrid = ROUGH_SURFACE_GRID
    ):
        super().__init__()
        grid.check("InterpolatedRoughSurface")
        self.albedo = albedo
        self.sigma = sigma
        self.grid = grid

    def roughness_and_albedo(self) -> tuple[Tensor, Tensor]:
        return self.sigma, self.albedo

    def table(self, like: Tensor) -> ImageTable:
        return _table_in(self.grid, like.dtype, like.device)

    def members(self) -> list[Member]:
        """The ladder up to this model."""
        material: dict[str, Any] = {name: kept(self, name) for name in ("albedo", "sigma")}
        own = (effects.C3_TERM, effects.EXACT_SLOPES)
        simulates = (effects.ROUGHNESS, effects.INTERREFLECTION, effects.LATER_BOUNCES, *own)
        return [*FastRoughSurface(**material).members(), Member("interpolated, all bounces", simulates, self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())
