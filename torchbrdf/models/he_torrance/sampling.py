"""Directions drawn for the directional-diffuse and the averaged specular part of He-Torrance, in the surface's frame.

The directional-diffuse part is drawn from the visible facets of a microfacet surface: half of the draws from Beckmann
facets as wide as the slopes, half from GGX facets as wide as slopes and diffraction together at the cosine of the view.
Their tails fall like a power and outlast every exponential of the series, which bounds the weights.
"""

import math

import torch
from torch import Tensor

from torchbrdf.directions import Cosines
from torchbrdf.facets import (
    HalfVector,
    beckmann_distribution,
    beckmann_lambda,
    ggx_distribution,
    ggx_lambda,
    tangent_squared,
)
from torchbrdf.models.he_torrance.perfect_reflector import Geometry
from torchbrdf.parameters import NARROWEST
from torchbrdf.sampling import choose, mirrored, towards, visible_beckmann_facet, visible_ggx_facet


def facet_width(cos: Tensor, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor) -> Tensor:
    """Width alpha (...) of facets like the directional-diffuse part at the longest wavelength, from a cosine (...). [-]

    (2 sigma0/tau)^2 + (lambda/(2 pi tau cos))^2: slopes, and the angle of diffraction in half vectors.
    """
    longest = torch.atleast_1d(wavelength).amax(-1)
    slopes, diffraction = 2 * sigma0 / tau, longest / (2 * math.pi * tau * cos)
    return (slopes * slopes + diffraction * diffraction).sqrt().clamp(NARROWEST, 1.0)


def directional_diffuse_share(cos: Tensor, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor) -> Tensor:
    """About which share (...) of the light from a cosine (...) that is not absorbed is directional diffuse. [-]

    1 - exp(-g), at the edge of that part above the mirror direction: it draws light from there at grazing.
    """
    wavelength = torch.atleast_1d(wavelength)
    above = (cos * cos + 2 / math.pi * wavelength.amax(-1) / tau).sqrt().clamp(max=1.0)
    phase = 2 * math.pi * sigma0 / wavelength.amin(-1) * (cos + above)
    return -torch.expm1(-phase * phase)


def directional_diffuse_light(view: Tensor, narrow: Tensor, wide: Tensor, u: Tensor) -> Tensor:
    """Light (..., 3) for a view (..., 3), widths (...) and u (..., 2); may lie below the horizon."""
    first, u1 = choose(u[..., 0], torch.full_like(u[..., 0], 0.5))
    u = torch.stack((u1, u[..., 1]), -1)
    sharp, soft = visible_beckmann_facet(view, narrow, narrow, u), visible_ggx_facet(view, wide, wide, u)
    return mirrored(view, torch.where(first[..., None], sharp, soft))


def directional_diffuse_density(cosines: Cosines, narrow: Tensor, wide: Tensor) -> Tensor:
    """Density (...) of `directional_diffuse_light`. [1/sr]"""
    half, steepness = HalfVector.of(cosines), tangent_squared(cosines.view)
    sharp = beckmann_distribution(half, alpha=narrow) / (1 + beckmann_lambda(narrow * narrow * steepness))
    soft = ggx_distribution(half, alpha=wide) / (1 + ggx_lambda(wide * wide * steepness))
    return (sharp + soft) / (8 * cosines.view)


def specular_light(view: Tensor, solid_angle: float, u: Tensor) -> Tensor:
    """Light (..., 3) about the mirror direction, where the specular part of cones of this solid angle [sr] is not 0."""
    image = view * view.new_tensor([-1.0, -1.0, 1.0])
    flat = _widest(solid_angle) * (1 - (1 - u[..., 0]).sqrt())  # 1 - cos(gamma)
    sine, turn = (flat * (2 - flat)).sqrt(), 2 * math.pi * u[..., 1]
    around = torch.stack((sine * turn.cos(), sine * turn.sin(), 1 - flat), -1)
    return towards(image, around.expand(torch.broadcast_shapes(around.shape, image.shape)))


def specular_density(cosines: Cosines, solid_angle: float) -> Tensor:
    """Density (...) of `specular_light`: falls linearly with 1 - cos(gamma) to 0 at the rim of that part. [1/sr]"""
    geometry = Geometry.of(cosines)
    difference = geometry.cos_light - geometry.cos_view
    flat = (geometry.planar + difference * difference)[..., 0] / 2
    widest = _widest(solid_angle)
    return (1 - flat / widest).relu() / (math.pi * widest)


def _widest(solid_angle: float) -> float:
    """1 - cos(2 alpha) for a cone of half-angle alpha. [-]"""
    flat = solid_angle / (2 * math.pi)
    return 2 * flat * (2 - flat)
