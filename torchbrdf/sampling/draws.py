"""Directions drawn from a density over the hemisphere, in a local frame whose z axis is the normal.

Every sampler maps uniform numbers u (..., 2) in [0, 1) to unit vectors (..., 3); its density [1/sr] is a function of
the same local vectors. All of it runs without gradients: the density of several samplers is not differentiable.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import dot, safe_divide, safe_sqrt
from torchbrdf.directions import Cosines


class Sample(NamedTuple):
    """Directions drawn from a BRDF, with what an estimator needs.

    Attributes:
        light: unit vectors (..., 3); below the horizon where the draw was rejected.
        pdf: density (...), detached. [1/sr] 0 where rejected, inf for the delta lobe of a mirror.
        weight: f_r cos(light) / pdf (..., channel), the reflectance of the lobe for a delta. [-] 0 where
            rejected. Differentiable in the material through f_r alone (light and pdf are held), so that the
            gradient of its mean is that of the directional albedo.
    """

    light: Tensor
    pdf: Tensor
    weight: Tensor


def local_light(cosines: Cosines) -> Tensor:
    """Light (..., 3) in the frame (tangent, bitangent, normal) of the cosines."""
    plane = cosines.tangent_plane
    return torch.stack((plane.light_tangent, plane.light_bitangent, cosines.light), -1)


def local_view(cosines: Cosines) -> Tensor:
    """View (..., 3) in the frame (tangent, bitangent, normal) of the cosines."""
    plane = cosines.tangent_plane
    return torch.stack((plane.view_tangent, plane.view_bitangent, cosines.view), -1)


def choose(u: Tensor, probability: Tensor) -> tuple[Tensor, Tensor]:
    """Whether u (...) fell into the first share `probability` (...), and u rescaled to [0, 1) within its share."""
    first = u < probability
    rescaled = torch.where(
        first,
        safe_divide(u, probability, where=probability > 0),
        safe_divide(u - probability, 1 - probability, where=probability < 1),
    )
    return first, rescaled.clamp(0.0, 1 - torch.finfo(u.dtype).eps)


def uniform_disc(u: Tensor) -> tuple[Tensor, Tensor]:
    """Point (x, y) of the unit disc, each (...)."""
    radius, angle = u[..., 0].sqrt(), 2 * math.pi * u[..., 1]
    return radius * angle.cos(), radius * angle.sin()


def uniform_hemisphere(u: Tensor) -> Tensor:
    """Direction (..., 3) of density 1/(2 pi)."""
    z = 1 - u[..., 0]
    sine, angle = ((1 - z) * (1 + z)).sqrt(), 2 * math.pi * u[..., 1]
    return torch.stack((sine * angle.cos(), sine * angle.sin(), z), -1)


def cosine_hemisphere(u: Tensor) -> Tensor:
    """Direction (..., 3) of density cos(theta)/pi."""
    x, y = uniform_disc(u)
    return torch.stack((x, y, (1 - u[..., 0]).sqrt()), -1)


def power_cosine(u: Tensor, exponent: Tensor) -> Tensor:
    """Direction (..., 3) about z of density (n + 1)/(2 pi) cos^n(theta) over the hemisphere."""
    z = (1 - u[..., 0]) ** (1 / (exponent + 1))
    sine, angle = safe_sqrt((1 - z) * (1 + z)), 2 * math.pi * u[..., 1]
    return torch.stack((sine * angle.cos(), sine * angle.sin(), z), -1)


def mirrored(vector: Tensor, axis: Tensor) -> Tensor:
    """Reflection (..., 3) of a vector that leaves the surface about a unit axis: 2 (v . a) a - v."""
    return 2 * dot(vector, axis)[..., None] * axis - vector


def towards(axis: Tensor, direction: Tensor) -> Tensor:
    """Direction (..., 3), given about z, turned so that z becomes the unit `axis`."""
    x, y, z = axis.unbind(-1)
    sign = torch.where(z < 0, -torch.ones_like(z), torch.ones_like(z))
    a = -1 / (sign + z)
    first = torch.stack((1 + sign * x * x * a, sign * x * y * a, -sign * x), -1)
    second = torch.stack((x * y * a, sign + y * y * a, -y), -1)
    p, q, r = (c[..., None] for c in direction.unbind(-1))
    return p * first + q * second + r * axis


def along_view(vector: Tensor, view: Tensor, *, back: bool = False) -> Tensor:
    """A local vector (..., 3) turned about z into the frame whose x axis points where the view does, or back.

    A view along the normal has no azimuth and leaves the vector as it is.
    """
    vx, vy, _ = view.unbind(-1)
    sine = torch.hypot(vx, vy)
    cos = safe_divide(vx, sine, where=sine > 0) + (sine <= 0).to(vx)
    sin = safe_divide(vy, sine, where=sine > 0)
    sin = sin if back else -sin
    x, y, z = vector.unbind(-1)
    return torch.stack((cos * x - sin * y, sin * x + cos * y, z + 0 * cos), -1)
