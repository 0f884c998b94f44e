r"""Images of a rough surface of unit albedo: what the geometry contributes, slope by slope.

    f = rho sum_k w_k D_k + rho^2 sum_k w_k I_k + sum_kn w_k [rho^3 H_kn0 + rho^4 l_kn H_kn1] / (1 - rho^2 l_kn^2)

D (direct), I (two bounces) and H (more) depend on the directions only, the weights w on the roughness only, the rest on
the albedo only: a new sigma or rho costs multiply-adds. The images of a facet come from `attenuation` (what is lit and
seen) and `interreflection` (what the facets exchange); their azimuth means from `azimuth` and `azimuth_quadrature`.
Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), eqs. (8), (22), (23), (25); bounces beyond the second: own derivation.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf.models.oren_nayar.azimuth import direct_mean, saturated_correlation, saturated_lobes
from torchbrdf.models.oren_nayar.azimuth_quadrature import higher_bounce_means, one_cut, two_bounce_mean
from torchbrdf.models.oren_nayar.cavity_modes import CavityModes, bounce_coefficients, facet_modes
from torchbrdf.models.oren_nayar.interreflection import two_bounce_facet
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane
from torchbrdf.v_cavity import direct_facet

# With more, the quadrature and the fit behind the modes lose their digits.
MOST_MODES = 20


class Bounces(NamedTuple):
    """Which light is followed: reflected once, twice, or more often (by `modes` a slope; 0 leaves it out)."""

    two: bool
    modes: int

    @classmethod
    def of(cls, name: str, bounces: "int | str", modes: int) -> "Bounces":
        """From the arguments of a model; raises ValueError unless they are 1, 2 or "all", and 3 to 20 modes."""
        if bounces not in (1, 2, "all"):
            raise ValueError(f'{name}.bounces must be 1, 2 or "all"; found {bounces!r}.')
        if bounces == "all" and not 3 <= modes <= MOST_MODES:
            raise ValueError(f"{name}.modes must be 3 to {MOST_MODES}; found {modes}.")
        return cls(bounces != 1, modes if bounces == "all" else 0)

    def named(self, direct: Tensor, two_bounce: Tensor, higher: Tensor) -> dict[str, Tensor]:
        """The parts that are followed, by name."""
        parts = {"direct": direct}
        if self.two:
            parts["two_bounce"] = two_bounce
        if self.modes:
            parts["higher"] = higher
        return parts


class Images(NamedTuple):
    """Images over K slopes; empty last axes for bounces that were not asked for. [1/sr]"""

    direct: Tensor  # D (..., K)
    two_bounce: Tensor  # I (..., K), or (..., 0)
    higher: Tensor  # H (..., K, N, 2), or (..., 0, 0, 2); last axis (same facet lit and seen, opposite facet lit)

    def flat(self) -> Tensor:
        """All images along one axis: (..., K), (..., 2 K) or (..., 2 K + 2 K N)."""
        parts = (self.direct, self.two_bounce, self.higher.flatten(-3))
        return torch.cat([part.movedim(-1, 0) for part in parts]).movedim(0, -1)  # pixels lie next to each other


def mean_images(
    plane: SlopePlane,
    *,
    cos_slope: Tensor,
    tan_slope: Tensor,
    bounces: Bounces,
    order: int,
    graded: bool = False,
    modes: CavityModes | None = None,
) -> Images:
    """Azimuth means over the facets of each slope.

    Args:
        plane: directions (...).
        cos_slope, tan_slope: of the slope angles, (K,) or broadcastable with (..., K). [-]
        bounces: which to follow; `modes` of those K slopes serve three and more.
        order: azimuth nodes on each piece of the interreflection (direct light is closed form).
        graded: azimuth pieces of the reference, see `azimuth_quadrature`.
    Returns: `Images`, not masked at the horizon. [1/sr]
    """
    slope = {"cos_slope": cos_slope, "tan_slope": tan_slope}
    direct = direct_images(plane, **slope)
    return Images(direct, *exchange_images(plane, **slope, bounces=bounces, order=order, graded=graded, modes=modes))


def direct_images(plane: SlopePlane, *, cos_slope: Tensor, tan_slope: Tensor) -> Tensor:
    """The direct images (..., K) of `mean_images`. [1/sr]"""
    shape = torch.broadcast_shapes(plane.dot.shape, cos_slope.shape[:-1])
    slope = {"cos_slope": _slopes_first(cos_slope, shape), "tan_slope": _slopes_first(tan_slope, shape)}
    return _slopes_last(direct_mean(_pixels_last(plane, shape), **slope), shape)


def exchange_images(
    plane: SlopePlane,
    *,
    cos_slope: Tensor,
    tan_slope: Tensor,
    bounces: Bounces,
    order: int,
    graded: bool = False,
    modes: CavityModes | None = None,
) -> tuple[Tensor, Tensor]:
    """The images of two bounces (..., K) and more (..., K, N, 2) of `mean_images`, empty where not followed. [1/sr]"""
    shape = torch.broadcast_shapes(plane.dot.shape, cos_slope.shape[:-1])
    wide = _pixels_last(plane, shape)
    lobes = saturated_lobes(wide, cos_slope=_slopes_first(cos_slope, shape), tan_slope=_slopes_first(tan_slope, shape))
    correlation = saturated_correlation(wide, lobes)
    two, higher = correlation[:0], correlation.new_zeros((0, 0, 2, correlation.shape[-1]))
    nodes = {"order": order, "graded": graded, "one": one_cut(wide, lobes, order, graded=graded)}
    if bounces.two:
        two = two_bounce_mean(wide, lobes, correlation, **nodes)
    if modes is not None:
        higher = higher_bounce_means(wide, lobes, correlation, modes, **nodes)
    return _slopes_last(two, shape), _slopes_last(higher, shape)


def _pixels_last(plane: SlopePlane, shape: torch.Size) -> SlopePlane:
    """Fields (1, pixel): every operation then runs along pixels, and matrices of slopes are few and large."""
    return SlopePlane(*(field.expand(shape).reshape(1, -1) for field in plane))


def _slopes_first(slope: Tensor, shape: torch.Size) -> Tensor:
    """Slopes (K,) or (..., K) as (K, 1) or (K, pixel)."""
    return slope[:, None] if slope.ndim == 1 else slope.expand(*shape, slope.shape[-1]).flatten(0, -2).mT


def _slopes_last(images: Tensor, shape: torch.Size) -> Tensor:
    return images.movedim(-1, 0).reshape(*shape, *images.shape[:-1])


def cavity_images(
    light_projection: Tensor,
    view_projection: Tensor,
    *,
    cos_slope: Tensor,
    bounces: Bounces,
    modes: CavityModes | None = None,
) -> Images:
    """Mean of the two facets u and -u of each cavity, Oren & Nayar 1994, eq. (22): exact, no azimuth mean.

    Args: u.p, u.q and cos(theta_a), broadcast to (..., K); `modes` of those K slopes for three and more bounces.
    Returns: `Images`, not masked at the horizon. [1/sr]
    """
    a, b, c = torch.broadcast_tensors(light_projection, view_projection, cos_slope)
    direct = 0.5 * (direct_facet(a, b, cos_slope=c) + direct_facet(-a, -b, cos_slope=c))
    two = direct[..., :0]
    if bounces.two:
        two = 0.5 * (two_bounce_facet(a, b, cos_slope=c) + two_bounce_facet(-a, -b, cos_slope=c))
    if modes is None:
        return Images(direct, two, a.new_zeros((*a.shape[:-1], 0, 0, 2)))
    light, light_off, view, view_off = (facet_modes(modes, z) for z in (a, -a, b, -b))
    same, opposite = light * view + light_off * view_off, light_off * view + light * view_off
    return Images(direct, two, (0.5 / math.pi) * c[..., None, None] * torch.stack((same, opposite), dim=-1))


def flat_coefficients(
    weights: Tensor,
    albedo: Tensor,
    *,
    bounces: Bounces,
    eigenvalues: Tensor | None = None,
    direct_weights: Tensor | None = None,
) -> dict[str, Tensor]:
    """What each bounce takes of each image of `Images.flat`.

    Args:
        weights: of the slopes, (K,) or (..., K). [-]
        direct_weights: of the slopes of direct light, if it has slopes of its own. [-]
        albedo: rho, scalar, (channel,) or (..., channel). [-]
        eigenvalues: of the modes (K, N), for three and more bounces.
    Returns: direct, two_bounce, higher, as far as followed: (..., channel, images). [-]
    """
    rho = torch.atleast_1d(albedo)[..., None]
    shares = weights[..., None, :]
    direct = rho * (shares if direct_weights is None else direct_weights[..., None, :])
    two = rho * rho * shares
    counts = [direct.shape[-1], two.shape[-1] if bounces.two else 0, 0]
    higher = direct[..., :0]
    if eigenvalues is not None:
        higher = (shares[..., None, None] * bounce_coefficients(eigenvalues, rho[..., 0])).flatten(-3)
        counts[2] = higher.shape[-1]
    padded = {}
    for position, (name, part) in enumerate(bounces.named(direct, two, higher).items()):
        before, after = sum(counts[:position]), sum(counts[position + 1 :])
        padded[name] = torch.nn.functional.pad(part, (before, after))
    return padded


def added(images: Images, albedo: Tensor, *, bounces: Bounces, eigenvalues: Tensor | None = None) -> dict[str, Tensor]:
    """The parts (..., channel) of a surface of one slope, K = 1: images times powers of the albedo. [1/sr]"""
    rho = torch.atleast_1d(albedo)
    direct = rho * images.direct
    higher = direct
    if eigenvalues is not None:
        higher = (images.higher[..., None, :, :, :] * bounce_coefficients(eigenvalues, rho)).sum((-1, -2, -3))
    two_bounce = rho * rho * images.two_bounce if bounces.two else direct
    return bounces.named(direct, two_bounce, higher)
