"""Rough surface whose slopes spread differently along the tangent and across it."""

import math
from typing import Literal, final

import torch
from torch import Tensor

from torchbrdf.brdf import Option
from torchbrdf.directions import Cosines
from torchbrdf.effects import ANISOTROPY
from torchbrdf.linear import ImageBRDF
from torchbrdf.models.oren_nayar.images import Bounces, cavity_images, flat_coefficients
from torchbrdf.models.oren_nayar.rough_surface import RoughSurface
from torchbrdf.parameters import ALBEDO, Constrained, Interval, ParameterValue, fixed, kept
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.sampling import CltcSampled, equivalent_roughness

# A quadrature over fixed slope vectors cannot resolve a spread much below the distance of its nodes.
SPREAD = Interval(math.radians(3), math.pi / 2, "rad")


@final
class AnisotropicRoughSurface(CltcSampled, ImageBRDF):
    r"""V-cavities with Gaussian slopes of two widths, by quadrature over the slope plane.

    .. math::
        f_r = \int P(\theta, \phi) f(\theta, \phi)\, d\theta\, d\phi, \quad
        P \propto \exp[-\tfrac12 \theta^2 (\cos^2\phi / \sigma_x^2 + \sin^2\phi / \sigma_y^2)] \sin\theta

    with phi from the tangent and f the cavities of one slope vector (`UnidirectionalVCavities`). The slope vectors
    are shared by all materials.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma_x, sigma_y: roughness along and across the tangent, scalars or (...). [rad] in [3 deg, pi/2]
        nodes: slope angles, dense towards the flat facet.
        azimuths: over half a turn; a facet and its opposite are one cavity.
        bounces: 1 (direct) or 2.
    Components: direct, two_bounce (those followed).
    Raises: ValueError outside the domains, and without a tangent.
    Deviations: every cavity adds kinks of its own, so the error falls slowly with the number of nodes; three and
        more bounces are left out. With derivatives for sigma, nodes * azimuths * bounces numbers a pixel are kept.
    Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
        (1995, DOI 10.1007/BF01679684), eqs. (8), (22); two widths: own.
    """

    anisotropic = True
    albedo: Constrained = Constrained(ALBEDO)
    sigma_x: Constrained = Constrained(SPREAD)
    sigma_y: Constrained = Constrained(SPREAD)

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        sigma_x: ParameterValue = 0.3,
        sigma_y: ParameterValue = 0.3,
        nodes: int = 16,
        azimuths: int = 24,
        bounces: Literal[1, 2] = 2,
    ):
        super().__init__()
        if bounces not in (1, 2) or nodes < 2 or azimuths < 2:
            raise ValueError(
                "AnisotropicRoughSurface needs bounces 1 or 2, and at least 2 nodes and 2 azimuths; "
                f"found bounces={bounces}, nodes={nodes}, azimuths={azimuths}."
            )
        self.albedo = albedo
        self.sigma_x = sigma_x
        self.sigma_y = sigma_y
        self.nodes = nodes
        self.azimuths = azimuths
        self.bounces: Literal[1, 2] = bounces
        self._bounces = Bounces(two=bounces > 1, modes=0)

    def sampling_roughness(self) -> Tensor:
        # of a view along the wide slopes too much, across them too little: variance 0.13 at worst for 0.1 and 1 rad,
        # half of what the cosine with a quarter uniform has
        return equivalent_roughness(((self.sigma_x**2 + self.sigma_y**2) / 2).sqrt())

    def coordinates(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """p and q of the slope plane, on tangent and bitangent."""
        along = cosines.tangent_plane
        return (
            along.light_tangent / cosines.light,
            along.light_bitangent / cosines.light,
            along.view_tangent / cosines.view,
            along.view_bitangent / cosines.view,
        )

    def images(self, *coordinates: Tensor) -> Tensor:
        light_x, light_y, view_x, view_y = (c[..., None] for c in coordinates)
        angle, azimuth, _ = slope_vectors(light_x, nodes=self.nodes, azimuths=self.azimuths)
        x, y = angle.tan() * azimuth.cos(), angle.tan() * azimuth.sin()
        return cavity_images(
            x * light_x + y * light_y, x * view_x + y * view_y, cos_slope=angle.cos(), bounces=self._bounces
        ).flat()

    def component_coefficients(self) -> dict[str, Tensor]:
        weights = anisotropic_weights(self.sigma_x, self.sigma_y, nodes=self.nodes, azimuths=self.azimuths)
        return flat_coefficients(weights, self.albedo, bounces=self._bounces)

    def stand_ins(self) -> dict[str, list[Option]]:
        """The isotropic surface of the mean variance."""
        sigma = ((self.sigma_x.square() + self.sigma_y.square()) / 2).sqrt().detach()
        held = all(isinstance(kept(self, name), fixed) for name in ("sigma_x", "sigma_y"))
        stand_in = RoughSurface(
            albedo=kept(self, "albedo"), sigma=fixed(sigma) if held else sigma, nodes=self.nodes, bounces=self.bounces
        )
        return {ANISOTROPY: [Option("one width in all azimuths", (ANISOTROPY,), stand_in)]}


def slope_vectors(like: Tensor, *, nodes: int, azimuths: int) -> tuple[Tensor, Tensor, Tensor]:
    """Slope angles and azimuths [rad] and the area d(theta) d(phi) of each vector (nodes * azimuths,)."""
    x, weight = gauss_legendre(nodes, like)
    # theta = (pi/2) x^2: nodes thicken towards the flat facet, where small roughness lives
    angle, width = 0.5 * math.pi * x * x, math.pi * x * weight
    azimuth = math.pi * (torch.arange(azimuths, dtype=x.dtype, device=x.device) + 0.5) / azimuths
    grid = torch.broadcast_tensors(angle[:, None], azimuth, width[:, None])
    angle, azimuth, width = (t.reshape(-1) for t in grid)
    return angle, azimuth, width


def anisotropic_weights(sigma_x: Tensor, sigma_y: Tensor, *, nodes: int, azimuths: int) -> Tensor:
    """Shares of the slope vectors (..., nodes * azimuths) for roughness sigma_x, sigma_y (...) > 0 [rad]."""
    angle, azimuth, width = slope_vectors(sigma_x, nodes=nodes, azimuths=azimuths)
    spread = (azimuth.cos() / sigma_x[..., None]) ** 2 + (azimuth.sin() / sigma_y[..., None]) ** 2
    # as a softmax, the shares stay finite where every exponential underflows
    return ((width * angle.sin()).log() - 0.5 * angle * angle * spread).softmax(-1)
