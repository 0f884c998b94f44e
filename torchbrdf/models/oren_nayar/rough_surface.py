"""The exact rough surface: V-cavities of many slopes, their azimuth mean, and the bounces between their facets."""

from abc import abstractmethod
from typing import Any, Literal, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.linear import ImageBRDF
from torchbrdf.models.oren_nayar.azimuth_paper import direct_mean_paper, two_bounce_mean_paper
from torchbrdf.models.oren_nayar.cavity_modes import CavityModes, modes_of
from torchbrdf.models.oren_nayar.fast import FastRoughSurface
from torchbrdf.models.oren_nayar.functional import OrenNayar
from torchbrdf.models.oren_nayar.images import Bounces, Images, direct_images, exchange_images, flat_coefficients
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane, slope_plane
from torchbrdf.models.rungs import Member, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue, Simplex, fixed, kept
from torchbrdf.sampling import CltcSampled, equivalent_roughness
from torchbrdf.slopes import gaussian_weights, shared_slopes

BounceCount = Literal[1, 2, "all"]

# The bounces that may be followed, and what each simulates besides roughness and C3.
_BOUNCES: dict[BounceCount, tuple[str, tuple[str, ...]]] = {
    1: ("1 bounce", ()),
    2: ("2 bounces", (effects.INTERREFLECTION,)),
    "all": ("all bounces", (effects.INTERREFLECTION, effects.LATER_BOUNCES)),
}
# Numbers of slopes from a coarse surface to one that is as good as any for most purposes.
_COARSER = (4, 8, 16)


class SharedSlopes(CltcSampled, ImageBRDF):
    """A surface with `nodes` shared slope angles: exact images of each slope, weights of the subclass."""

    def __init__(self, *, nodes: int, order: int, graded: bool, bounces: BounceCount, modes: int):
        super().__init__()
        name = type(self).__name__
        if order < 1:
            raise ValueError(f"{name}.order must be at least 1; found {order}.")
        shared_slopes(nodes)  # refuses fewer than three
        self.nodes = nodes
        self.order = order
        self.graded = graded
        self.bounces: BounceCount = bounces
        self.modes = modes
        self._bounces = Bounces.of(name, bounces, modes)

    @abstractmethod
    def slope_weights(self) -> Tensor:
        """Shares of the slopes in the horizontal area, (nodes,) or (..., nodes); they sum to 1. [-]"""

    def direct_slopes(self) -> tuple[float, ...]:
        """Slope angles of direct light: those of the interreflection unless the subclass says otherwise. [rad]"""
        return shared_slopes(self.nodes)

    def direct_weights(self) -> Tensor:
        """Shares of `direct_slopes`, which sum to 1. [-]"""
        return self.slope_weights()

    @property
    @abstractmethod
    def _rho(self) -> Tensor:
        """Facet albedo."""

    def coordinates(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return slope_plane(cosines)

    def images(self, *coordinates: Tensor) -> Tensor:
        plane = SlopePlane(*coordinates)
        direct = direct_images(plane, **_sides(self.direct_slopes(), plane.dot))
        if not self._bounces.two:
            return direct
        exchanged = exchange_images(
            plane,
            **_sides(shared_slopes(self.nodes), plane.dot),
            bounces=self._bounces,
            order=self.order,
            graded=self.graded,
            modes=self._modes(plane.dot),
        )
        return Images(direct, *exchanged).flat()

    def component_coefficients(self) -> dict[str, Tensor]:
        weights = self.slope_weights()
        modes = self._modes(weights)
        eigenvalues = None if modes is None else modes.eigenvalues
        return flat_coefficients(
            weights,
            self._rho,
            bounces=self._bounces,
            eigenvalues=eigenvalues,
            direct_weights=self.direct_weights(),
        )

    def _modes(self, like: Tensor) -> CavityModes | None:
        if not self._bounces.modes:
            return None
        return modes_of(shared_slopes(self.nodes), self._bounces.modes, like.dtype, like.device)


def _sides(slopes: tuple[float, ...], like: Tensor) -> dict[str, Tensor]:
    """Cosine and tangent of slope angles, each (K,), rounded once. [-]"""
    angle = like.new_tensor(slopes, dtype=torch.float64)
    return {"cos_slope": angle.cos().to(like.dtype), "tan_slope": angle.tan().to(like.dtype)}


@final
class RoughSurface(SharedSlopes):
    r"""Isotropic rough surface of Lambertian V-cavities with Gaussian slopes: the model the fitted forms approximate.

    .. math::
        f_r = \rho \sum_k w_k(\sigma) D_k + \rho^2 \sum_k w_k(\sigma) I_k
              + \sum_{kn} w_k(\sigma) \frac{\rho^3 H_{kn0} + \rho^4 \lambda_{kn} H_{kn1}}{1 - \rho^2 \lambda_{kn}^2}

    The images D, I, H of the slopes theta_k know nothing of sigma and rho; D is closed form for any
    azimuth, I and H are exact up to `order` azimuth nodes a piece.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly, without a jump.
        nodes: shared slope angles of the interreflection, the flat facet included; direct light, whose kinks are
            sharper, takes 2 nodes - 1.
        order: azimuth nodes where one direction is cut; twice as many on each side where both are.
        graded: grade the nodes to where the integrand turns, at 2 to 3 times the cost: two bounces are then good to
            1e-8 at order 16.
        bounces: 1 (direct), 2 or "all" inside a cavity.
        modes: eigenmodes a slope that carry three and more bounces.
    Components: direct, two_bounce, higher (those followed).
    Raises: ValueError outside the domains, for nodes < 3, order < 1, modes outside 3..20 or another number of bounces.
    Deviations: from the integral, two bounces, sigma 1e-3..pi/2 rad, rho 0.05 to 1, random directions, largest (rms),
        as `examples/benchmarks/slopes.py --directions 250` prints them:

        | nodes | up to 85 deg | 85 to 89 deg | 89 to 89.9 deg |
        |---|---|---|---|
        | 8 | 1.8e-3 (3e-4) | 6.7e-3 (6e-4) | 1.8e-2 (2e-3) |
        | 16 | 5.1e-4 (8e-5) | 1.4e-3 (2e-4) | 1.5e-3 (2e-4) |
        | 48 | 4.0e-5 (4e-6) | 4.5e-4 (4e-5) | 5.3e-4 (7e-5) |

        Below 2e-2 (16 nodes) also where light and view oppose each other at 89.9 deg on sigma = 1e-3, the worst found.
        Not negative in float64 down to cosines of 1e-6: no weight of a slope is, and no image of one. In float32 direct
        light loses digits by cancellation: up to 1e-2 of the value at 89.9 deg. Three and more bounces at rho = 1 err
        by 1e-5 of the whole (sigma = 0.3) to 1.5e-3 (sigma = 1) at 4 modes, 1e-7 to 5e-5 at 12: photographs of rho .9
        and sigma = 50 deg are fitted with 0.4 deg too much at 4 modes, 0.04 at 6. The light returned at rho = 1 differs
        from 1 by up to 1.5e-3 at the defaults, and from 3 nodes by 1e-2, as direct light and the rest have slopes of
        their own. Autograd takes the nodes' places for given where they do not matter to the integral: it differs from
        differences of f by what the quadrature errs. Kinks: at light = view the zero subgradient is chosen; fractional
        powers where tan(theta) tan(theta_k) = 1; with all bounces steps of some 1e-6 of the value next to the mirror
        direction at 85 deg, where pieces of the quadrature change places.
    Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
        (1995, DOI 10.1007/BF01679684), sections 4.1-4.3, eqs. (8)-(26) repaired; more bounces: own.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        sigma: ParameterValue = 0.3,
        nodes: int = 16,
        order: int = 4,
        graded: bool = False,
        bounces: BounceCount = 2,
        modes: int = 6,
    ):
        super().__init__(nodes=nodes, order=order, graded=graded, bounces=bounces, modes=modes)
        self.albedo = albedo
        self.sigma = sigma

    @property
    def _rho(self) -> Tensor:
        return self.albedo

    def slope_weights(self) -> Tensor:
        return gaussian_weights(self.sigma, nodes=self.nodes)

    def direct_slopes(self) -> tuple[float, ...]:
        return shared_slopes(2 * self.nodes - 1)

    def direct_weights(self) -> Tensor:
        return gaussian_weights(self.sigma, nodes=2 * self.nodes - 1)

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def members(self) -> list[Member]:
        """The ladder up to this model: fewer bounces, and of each number fewer slopes."""
        material: dict[str, Any] = {name: kept(self, name) for name in ("albedo", "sigma")}
        settings: dict[str, Any] = {"order": self.order, "graded": self.graded, "modes": self.modes}
        one = self.bounces == 1
        members = (OrenNayar(**material, interreflection=False) if one else FastRoughSurface(**material)).members()
        for bounces, (label, extra) in _BOUNCES.items():
            simulates = (effects.ROUGHNESS, *extra, effects.C3_TERM, effects.EXACT_SLOPES)
            for nodes in (*(count for count in _COARSER if count < self.nodes), self.nodes):
                own = nodes == self.nodes
                model = RoughSurface(**material, **settings, nodes=nodes, bounces=bounces)
                names = (*simulates, effects.MANY_SLOPES) if own else simulates
                members.append(Member(f"exact, K = {nodes}, {label}", names, model))
            if bounces == self.bounces:
                break
        return [*members[:-1], members[-1]._replace(model=self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())


@final
class TabulatedRoughSurface(SharedSlopes):
    """Isotropic rough surface of any slope distribution: the shares of the shared slopes are the parameter.

    As `RoughSurface`, with w_k given, or learned, instead of computed from sigma.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        weights: shares of the slopes `shared_slopes(nodes)` in the horizontal area, (nodes,) or
            (..., nodes). [-] They sum to 1; trained ones are above 0. See `tabulated_weights`.
        order, graded, bounces, modes: as in `RoughSurface`.
    Components: direct, two_bounce, higher (those followed).
    Raises: ValueError for weights that are no shares, and as `RoughSurface`.
    Deviations: a distribution narrower than the distance of neighbouring slopes is not resolved.
    Source: Oren & Nayar 1994, long version (as `RoughSurface`), eq. (25) with any distribution.
    """

    albedo: Constrained = Constrained(ALBEDO)
    weights: Constrained = Constrained(Simplex())

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        weights: Tensor | fixed,
        order: int = 4,
        graded: bool = False,
        bounces: BounceCount = 2,
        modes: int = 6,
    ):
        given = torch.as_tensor(weights.value if isinstance(weights, fixed) else weights)
        super().__init__(
            nodes=given.shape[-1] if given.ndim else 0, order=order, graded=graded, bounces=bounces, modes=modes
        )
        self.albedo = albedo
        self.weights = weights

    @property
    def _rho(self) -> Tensor:
        return self.albedo

    def slope_weights(self) -> Tensor:
        return self.weights

    def sampling_roughness(self) -> Tensor:
        angle = self.weights.new_tensor(shared_slopes(self.nodes))
        return equivalent_roughness((self.weights * angle * angle).sum(-1).sqrt())


@final
class ClosedFormRoughSurface(CltcSampled, ImageBRDF):
    """Gaussian slopes over closed forms of one slope: Oren & Nayar 1994, eqs. (45) direct, (49) two bounces.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
        nodes: shared slope angles, the flat facet included.
    Components: direct, two_bounce.
    Raises: ValueError outside the domains or for nodes < 3.
    Deviations: the closed forms are exact for direct light in and across the plane of incidence and interpolated
        between, and eq. (48) approximates the exchange. From the exact model with all bounces: 4.3 % rms, 20 % at worst
        (up to 85 deg, sigma 5..60 deg, rho 0.3..0.9; `examples/benchmarks/ladder.py`).
    Source: Oren & Nayar 1994, long version (as `RoughSurface`), eqs. (24), (25), (45), (48), (49).
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(self, *, albedo: ParameterValue = 0.5, sigma: ParameterValue = 0.3, nodes: int = 16):
        super().__init__()
        shared_slopes(nodes)
        self.albedo = albedo
        self.sigma = sigma
        self.nodes = nodes

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def coordinates(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return slope_plane(cosines)

    def images(self, *coordinates: Tensor) -> Tensor:
        plane = SlopePlane(*(field[..., None] for field in coordinates))
        slope = _sides(shared_slopes(self.nodes), plane.dot)
        return torch.cat((direct_mean_paper(plane, **slope), two_bounce_mean_paper(plane, **slope)), -1)

    def component_coefficients(self) -> dict[str, Tensor]:
        weights = gaussian_weights(self.sigma, nodes=self.nodes)
        return flat_coefficients(weights, self.albedo, bounces=Bounces(two=True, modes=0))
