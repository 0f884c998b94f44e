"""The reference for random rough surfaces: a Lambertian Gaussian heightfield, its direct light and its bounces."""

from typing import Literal, NamedTuple, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf.brdf import BRDF, Option
from torchbrdf.directions import Cosines
from torchbrdf.models.heightfield.direct import QUADRATURES, check_nodes, direct_light
from torchbrdf.models.heightfield.fast import FastGaussianHeightfield
from torchbrdf.models.heightfield.roughness import RMS_SLOPE, rms_slope_from_sigma, sigma_from_rms_slope
from torchbrdf.models.heightfield.slope_frame import slope_frame
from torchbrdf.models.heightfield.table import TableSize, bounce_table, read_table
from torchbrdf.models.heightfield.transport import INDEPENDENT_FACETS, Transport
from torchbrdf.models.heightfield.visibility import SMOOTH_HEIGHTFIELD, HeightfieldConstants
from torchbrdf.models.rungs import Member, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, Interval, ParameterValue, fixed, kept
from torchbrdf.sampling import CltcSampled, equivalent_roughness

BounceCount = int | Literal["all"]
# At 2 a facet seen edge-on would never be seen.
OCCLUSION = Interval(0.0, 1.8)


class Settings(NamedTuple):
    """How much is computed; see `GaussianHeightfield`."""

    bounces: BounceCount
    nodes: int
    size: TableSize
    constants: HeightfieldConstants
    transport: Transport

    @property
    def orders(self) -> int:
        """Bounces followed beyond the first."""
        return self.size.orders if self.bounces == "all" else self.bounces - 1

    def check(self, name: str) -> None:
        """Raise ValueError unless the numbers make sense."""
        check_nodes(name, self.nodes)
        if min(self.size) < 2:
            raise ValueError(f"{name}: polar_nodes and table_orders must be at least 2; found {tuple(self.size)}.")
        most = self.size.orders + 1
        whole = isinstance(self.bounces, int) and not isinstance(self.bounces, bool) and 1 <= self.bounces <= most
        if not whole and self.bounces != "all":
            raise ValueError(f'{name}: bounces must be 1 to {most} or "all"; found {self.bounces!r}.')


def gaussian_heightfield(
    cosines: Cosines,
    *,
    albedo: Tensor,
    sigma: Tensor,
    occlusion: Tensor,
    bounces: BounceCount = "all",
    nodes: int = 240,
    polar_nodes: int = 14,
    table_orders: int = 24,
    constants: HeightfieldConstants = SMOOTH_HEIGHTFIELD,
    transport: Transport = INDEPENDENT_FACETS,
) -> Tensor:
    r"""Reflectance of a random heightfield with Gaussian slopes and Lambertian facets.

    .. math::
        f_r &= \rho f_1 + \rho^2 f_2 + \dots, \quad
        f_1 = \frac1\pi\, E_\xi \Bigl[\frac{\cos_a\, X^+ Y^+}{1 + D}\Bigr] \\
        X &= 1 + t_i\, \xi \cdot d_i,\quad Y = 1 + t_r\, \xi \cdot d_r,\quad t = s \tan\theta,\quad
        \cos_a = (1 + s^2 |\xi|^2)^{-1/2}

    over slopes s xi, xi ~ N(0, I). Every facet has its own chance 1/(1 + D) of being seen and lit (`visibility.py`):
    Smith's, corrected for the surface near by, which hides facets that are nearly edge-on. Light reflected more often
    follows Smith's surface as a half-space (`transport.py`), balanced so that white facets lose nothing.

    Args:
        cosines: of light, view and phase angle, each (...). `Cosines.of(normal, light, view)` makes them.
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly. `rms_slope_from_sigma` says
            what rms slope s it stands for.
        occlusion: E, how much the surface near by hides, scalar or (...). [-] in [0, 1.8]; 0 is Smith's surface with
            correlated heights, 1 a surface of one smooth scale, about 1.6 one of two scales.
        bounces: 1, 2, .. or "all", which is table_orders + 1.
        nodes: slopes of the direct light: 160, 240, 384 or 560.
        polar_nodes, table_orders: size of the table of bounces.
        constants: constants of the visibility.
        transport: how facets light each other: `INDEPENDENT_FACETS`, `NEIGHBOURING_FACETS`, or an object of your own
            with the method of `Transport`.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError outside the domains, or for other nodes or bounces.
    Deviations: the slope integral errs by up to 7e-4, 8e-5, 4e-5, 9e-6 at 160, 240, 384, 560 nodes, the table by up to
        1e-3 of f. White facets return 1 within 1e-3 up to 89 deg. Path-traced meshes up to 80 deg, rho = 0.9: within
        0.3, 0.8, 1.1 % rms at s = 0.3, 0.67, 1, most of it in the bounces, which are blind to occlusion; with
        `NEIGHBOURING_FACETS` 0.25, 0.6, 0.7 %. Two scales at occlusion 1.6: f_1 within 0.8 %. The cone at light = view
        has subgradient 0. A field of sigma costs a table for each entry unless bounces = 1.
    Source: own; see `docs/heightfield.md` for what it is built on.
    """
    ALBEDO.check("gaussian_heightfield: albedo", albedo)
    ROUGHNESS.check("gaussian_heightfield: sigma", sigma)
    OCCLUSION.check("gaussian_heightfield: occlusion", occlusion)
    settings = Settings(bounces, nodes, TableSize(polar_nodes, table_orders), constants, transport)
    settings.check("gaussian_heightfield")
    fields = heightfield_fields(cosines, sigma, occlusion, settings)
    return cosines.zero_below_horizon(sum_of_orders(albedo, fields))


def heightfield_fields(cosines: Cosines, sigma: Tensor, occlusion: Tensor, settings: Settings) -> Tensor:
    """f_1, f_2, .. (..., bounces) [1/sr]; finite below the horizon."""
    quadrature = QUADRATURES[settings.nodes]
    slope = rms_slope_from_sigma(sigma)
    direct = direct_light(slope_frame(cosines, slope), occlusion, settings.constants, quadrature)[..., None]
    if settings.orders == 0:
        return direct
    table = bounce_table(sigma, occlusion, settings.constants, quadrature, settings.size, transport=settings.transport)
    bounced = read_table(cosines, table, settings.size)[..., : settings.orders]
    return torch.cat((direct, bounced.expand(*direct.shape[:-1], settings.orders)), -1)


def sum_of_orders(albedo: Tensor, fields: Tensor, first: int = 1) -> Tensor:
    """sum_n rho^n fields_n (..., channel), n from `first` on, for rho () , (channel,) or (..., channel)."""
    rho = torch.atleast_1d(albedo)
    total = torch.zeros_like(rho)
    for field in reversed(fields.unbind(-1)):
        total = rho * total + field[..., None]
    return rho**first * total


def sigma_of(name: str, rms_slope: ParameterValue) -> Tensor | fixed:
    """Sigma of an rms slope, held fixed where the slope is; raises ValueError in the name of the slope."""
    given = torch.as_tensor(rms_slope.value if isinstance(rms_slope, fixed) else rms_slope)
    RMS_SLOPE.check(name, given)
    sigma = sigma_from_rms_slope(given)
    return fixed(sigma) if isinstance(rms_slope, fixed) else sigma


@final
class GaussianHeightfield(CltcSampled, BRDF):
    """Random heightfield as a module: the reference; see `gaussian_heightfield` for equation and units.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad] `from_rms_slope` takes the rms slope instead.
        occlusion: E, scalar or (...). [-] in [0, 1.8]; held at 1 unless given.
        bounces, nodes, polar_nodes, table_orders, constants, transport: as in `gaussian_heightfield`.
    Components: direct, two_bounce, higher (those followed).
    Raises: ValueError outside the domains, or for other nodes or bounces.
    """

    # Stand-ins belong here: FastGaussianHeightfield, then Lambert; fewer bounces; occlusion 0.

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)
    occlusion: Constrained = Constrained(OCCLUSION)

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        sigma: ParameterValue = 0.3,
        occlusion: ParameterValue = fixed(1.0),  # noqa: B008 - frozen
        bounces: BounceCount = "all",
        nodes: int = 240,
        polar_nodes: int = 14,
        table_orders: int = 24,
        constants: HeightfieldConstants = SMOOTH_HEIGHTFIELD,
        transport: Transport = INDEPENDENT_FACETS,
    ):
        super().__init__()
        self.settings = Settings(bounces, nodes, TableSize(polar_nodes, table_orders), constants, transport)
        self.settings.check("GaussianHeightfield")
        self.albedo = albedo
        self.sigma = sigma
        self.occlusion = occlusion

    @classmethod
    def from_rms_slope(
        cls,
        rms_slope: ParameterValue,
        *,
        albedo: ParameterValue = 0.5,
        occlusion: ParameterValue = fixed(1.0),  # noqa: B008 - frozen
        bounces: BounceCount = "all",
        nodes: int = 240,
        polar_nodes: int = 14,
        table_orders: int = 24,
        constants: HeightfieldConstants = SMOOTH_HEIGHTFIELD,
        transport: Transport = INDEPENDENT_FACETS,
    ) -> "GaussianHeightfield":
        """Of rms slope s per axis [-] in [0, 1.482], scalar or (...), as a profilometer measures it."""
        return cls(
            albedo=albedo,
            sigma=sigma_of("GaussianHeightfield.from_rms_slope: rms_slope", rms_slope),
            occlusion=occlusion,
            bounces=bounces,
            nodes=nodes,
            polar_nodes=polar_nodes,
            table_orders=table_orders,
            constants=constants,
            transport=transport,
        )

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def fields(self, cosines: Cosines) -> Tensor:
        """f_1, f_2, .. of unit albedo (..., bounces) [1/sr]; finite below the horizon."""
        return heightfield_fields(cosines, self.sigma, self.occlusion, self.settings)

    def evaluate(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(sum_of_orders(self.albedo, self.fields(cosines)))

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        fields = self.fields(cosines)
        slices = {"direct": slice(0, 1), "two_bounce": slice(1, 2), "higher": slice(2, None)}
        parts = {name: (fields[..., part], 1 + (part.start or 0)) for name, part in slices.items()}
        return {name: sum_of_orders(self.albedo, f, first) for name, (f, first) in parts.items() if f.shape[-1]}

    def members(self) -> list[Member]:
        """The ladder up to this model: the fit (of occlusion 1), fewer bounces, and of each number fewer nodes."""
        own = self.settings
        near_by = (effects.OCCLUSION_NEAR_BY,) if self.occlusion.any() else ()
        members = FastGaussianHeightfield(albedo=kept(self, "albedo"), sigma=kept(self, "sigma")).members()
        last = own.orders + 1
        for count in (*(few for few in (1, 2) if few < last), last):
            followed = (effects.INTERREFLECTION, effects.LATER_BOUNCES)[: count - 1]
            simulates = (effects.ROUGHNESS, *followed, *near_by, effects.EXACT_SLOPES)
            every = own.bounces == "all" and count == last
            label = "all bounces" if every else f"{count} bounce" if count == 1 else f"{count} bounces"
            for nodes in (*(fewer for fewer in QUADRATURES if fewer < own.nodes), own.nodes):
                names = (*simulates, effects.MANY_SLOPES) if nodes == own.nodes else simulates
                model = self._simplified(kept(self, "occlusion"), bounces=count, nodes=nodes)
                members.append(Member(f"heightfield, {nodes} nodes, {label}", names, model))
        return [*members[:-1], members[-1]._replace(model=self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        """Rungs of the ladder, and beside them Smith's surface: the same without the occlusion near by."""
        rungs = stand_ins(self.members())
        if not self.occlusion.any():
            return rungs
        own = self.settings
        smith = self._simplified(fixed(torch.zeros_like(self.occlusion)), bounces=own.bounces, nodes=own.nodes)
        return rungs | {effects.OCCLUSION_NEAR_BY: [Option("Smith", (effects.OCCLUSION_NEAR_BY,), smith)]}

    def _simplified(self, occlusion: Tensor | fixed, *, bounces: BounceCount, nodes: int) -> "GaussianHeightfield":
        own = self.settings
        return GaussianHeightfield(
            albedo=kept(self, "albedo"),
            sigma=kept(self, "sigma"),
            occlusion=occlusion,
            bounces=bounces,
            nodes=nodes,
            polar_nodes=own.size.polar,
            table_orders=own.size.orders,
            constants=own.constants,
            transport=own.transport,
        )
