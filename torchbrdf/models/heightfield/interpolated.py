"""The random heightfield with all bounces, read from a table: a hundred times cheaper."""

from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf._constants import constant
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.interpolation.images import ImageTable, TableGrid, converted, image_table
from torchbrdf.interpolation.surface import InterpolatedSurface, interpolated
from torchbrdf.models.heightfield.fast import FastGaussianHeightfield
from torchbrdf.models.heightfield.surface import OCCLUSION, Settings, heightfield_fields
from torchbrdf.models.heightfield.table import TableSize
from torchbrdf.models.heightfield.transport import INDEPENDENT_FACETS
from torchbrdf.models.heightfield.visibility import SMOOTH_HEIGHTFIELD
from torchbrdf.models.rungs import Member, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue, kept

HEIGHTFIELD_GRID = TableGrid(depth=28, apart=24, slant=13, sigmas=16, albedos=9, images=20)


class HeightfieldTable(NamedTuple):
    """What a table depends on."""

    occlusion: float
    nodes: int
    grid: TableGrid

    def check(self, name: str) -> None:
        """Raise ValueError unless the numbers make sense."""
        OCCLUSION.check(f"{name}: occlusion", torch.tensor(self.occlusion, dtype=torch.float64))
        self.settings.check(name)
        self.grid.check(name)

    @property
    def settings(self) -> Settings:
        return Settings("all", self.nodes, TableSize(polar=14, orders=24), SMOOTH_HEIGHTFIELD, INDEPENDENT_FACETS)


def heightfield_reflectances(
    light: Tensor, view: Tensor, dphi: Tensor, sigma: Tensor, albedo: Tensor, *, occlusion: float, settings: Settings
) -> Tensor:
    """f_r/rho (P, sigma, rho) [1/sr] at polar angles and azimuth (P,) [rad], for roughnesses (S,) [rad] and albedos
    (T,); all bounces, float64.
    """
    zero, one = torch.zeros_like(light), torch.ones_like(light)
    vectors = (
        (zero, zero, one),
        (light.sin(), zero, light.cos()),
        (view.sin() * dphi.cos(), view.sin() * dphi.sin(), view.cos()),
    )
    cosines = Cosines.of(*(torch.stack(v, -1) for v in vectors), normalize=True)
    powers = albedo ** torch.arange(settings.orders + 1, dtype=albedo.dtype)[:, None]
    hiding = sigma.new_tensor(occlusion)
    return torch.stack([heightfield_fields(cosines, s, hiding, settings) @ powers for s in sigma], -2)


@lru_cache(maxsize=8)
def heightfield_table(key: HeightfieldTable) -> ImageTable:
    """The table of all heightfields of one occlusion (float64), built when there is none on disk."""
    sample = partial(heightfield_reflectances, occlusion=key.occlusion, settings=key.settings)
    return image_table("heightfield", f"{key.occlusion!r}, {key.settings}", [Path(__file__).parent], sample, key.grid)


@constant
def _table_in(key: HeightfieldTable, dtype: torch.dtype, device: torch.device) -> ImageTable:
    return converted(heightfield_table, key, dtype, device)


def interpolated_gaussian_heightfield(
    cosines: Cosines,
    *,
    albedo: Tensor,
    sigma: Tensor,
    occlusion: float = 1.0,
    nodes: int = 240,
    grid: TableGrid = HEIGHTFIELD_GRID,
) -> Tensor:
    r"""The random heightfield with all bounces, read from a table; roughness and albedo may differ at each pixel.

    .. math:: f_r = \frac\rho\pi + \frac{\rho}{m} \sum_{r=1}^{R} U_r(x, v, z)\, c_r(\sigma, \rho)

    with m the mean cosine of light and view, and U, c cubic splines in coordinates of directions and material
    (`torchbrdf.interpolation`). There is a table for each occlusion, built at the first call, in about 12 seconds of
    one core, and kept in $TORCHBRDF_CACHE, else $XDG_CACHE_HOME/torchbrdf, else ~/.cache/torchbrdf.

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
        occlusion: E, a number. [-] in [0, 1.8]
        nodes: slopes of the direct light that is tabulated: 160, 240, 384 or 560.
        grid: sites of the table along each axis, and images R.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo, sigma or occlusion leave their domains, for other nodes, for fewer than 6 sites or
        other than 1 to 25 images.
    Deviations: from the heightfield at 560 nodes, occlusion 1, sigma 2 to 60 deg, rho 0.1 to 0.95, in units of rho/pi:
        rms 2e-4 and at most 4e-3 (next to light = view at grazing) where the more grazing direction is within 85 deg,
        5e-4 and 4e-3 up to 89 deg, 4e-3 and 4e-2 up to 89.9 deg (`examples/benchmarks/interpolated_surfaces.py`); from
        89.95 deg on held. Values may turn negative beyond 89 deg: to -0.02 in these units up to 89.9 deg (sigma = 2
        deg), to -4 beyond, where the peak at light = view is some hundred. Has the subgradient 0 at light = view, a
        cone, and at light = mirrored view, where the heightfield is smooth.
    Source: own; see `docs/heightfield.md` for what is tabulated.
    """
    name = "interpolated_gaussian_heightfield"
    ALBEDO.check(f"{name}: albedo", albedo)
    ROUGHNESS.check(f"{name}: sigma", sigma)
    key = HeightfieldTable(occlusion, nodes, grid)
    key.check(name)
    tables = (_table_in(key, t.dtype, t.device) for t in (cosines.light, sigma))
    return cosines.zero_below_horizon(interpolated(cosines, *tables, albedo=albedo, sigma=sigma))


@final
class InterpolatedGaussianHeightfield(InterpolatedSurface):
    """Table of the heightfield as a module; see `interpolated_gaussian_heightfield` for equation and deviations.

    Linear in 1 + R images of the geometry, for all roughnesses and albedos. No model offers it as a stand-in, since
    the first call may have to build the table.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad]
        occlusion, nodes, grid: as in `interpolated_gaussian_heightfield`.
    Components: all_bounces.
    Raises: ValueError outside the domains, for other nodes, or for a grid that is too small.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        sigma: ParameterValue = 0.3,
        occlusion: float = 1.0,
        nodes: int = 240,
        grid: TableGrid = HEIGHTFIELD_GRID,
    ):
        super().__init__()
        self.key = HeightfieldTable(occlusion, nodes, grid)
        self.key.check("InterpolatedGaussianHeightfield")
        self.albedo = albedo
        self.sigma = sigma

    def roughness_and_albedo(self) -> tuple[Tensor, Tensor]:
        return self.sigma, self.albedo

    def table(self, like: Tensor) -> ImageTable:
        return _table_in(self.key, like.dtype, like.device)

    def members(self) -> list[Member]:
        """The ladder up to this model; without occlusion near by only Lambert lies below."""
        material: dict[str, Any] = {name: kept(self, name) for name in ("albedo", "sigma")}
        simulates = (effects.ROUGHNESS, effects.INTERREFLECTION, effects.LATER_BOUNCES)
        near_by = (effects.OCCLUSION_NEAR_BY,) if self.key.occlusion else ()
        own = Member("interpolated heightfield", (*simulates, *near_by, effects.EXACT_SLOPES), self)
        return [*FastGaussianHeightfield(**material).members(), own]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())
