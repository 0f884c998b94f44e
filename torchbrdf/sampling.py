"""Directions drawn from a density over the hemisphere, in a local frame whose z axis is the normal.

Every sampler maps uniform numbers u (..., 2) in [0, 1) to unit vectors (..., 3); its density [1/sr] is a function of
the same local vectors. All of it runs without gradients: the density of several samplers is not differentiable.
"""

import math
from abc import ABC, abstractmethod
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


def cltc_matrix(cos_view: Tensor, roughness: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """a, b, c, d of M = [[a, 0, b], [0, c, 0], [d, 0, 1]]: the linear map of a clipped cosine lobe that fits EON."""
    mu, r = cos_view, roughness
    a = 1 + r * (0.303392 + (-0.518982 + 0.111709 * mu) * mu + (-0.276266 + 0.335918 * mu) * r)
    b = r * (-1.16407 + 1.15859 * mu + (0.150815 - 0.150105 * mu) * r) / (mu**3 - 1.43545)
    c = 1 + (0.20013 + (-0.506373 + 0.261777 * mu) * mu) * r
    d = r * (0.540852 + (-1.01625 + 0.475392 * mu) * mu) / (-1.0743 + 0.0725628 * mu + mu * mu)
    return a, b, c, d


def cltc_uniform_share(cos_view: Tensor, roughness: Tensor) -> Tensor:
    """Probability of a uniform draw that covers what the clipped lobe leaves empty (...)."""
    mu = cos_view
    return roughness**0.1 * (0.162925 + mu * (-0.372058 + (0.538233 - 0.290822 * mu) * mu))


def cltc_sample(view: Tensor, roughness: Tensor, u: Tensor) -> Tensor:
    """Light (..., 3) for a rough diffuse surface: a clipped, linearly transformed cosine, or uniform.

    Args:
        view: local (..., 3). roughness: of EON, or the r_eff of its relatives (...), in [0, 1].
    Source: Portsmouth, Kutz & Hill 2025, section 4.
    """
    mu = view[..., 2]
    uniform, u1 = choose(u[..., 0], cltc_uniform_share(mu, roughness))
    u = torch.stack((u1, u[..., 1].expand_as(u1)), -1)
    a, b, c, d = cltc_matrix(mu, roughness)
    x, y = uniform_disc(u)
    s = (1 + 1 / torch.sqrt(1 + d * d)) / 2
    x = -((1 - s) * safe_sqrt(1 - y * y) + s * x)
    z = safe_sqrt(1 - x * x - y * y)
    lobe = torch.stack((a * x + b * z, c * y, d * x + z), -1)
    lobe = lobe / dot(lobe, lobe).sqrt()[..., None]
    return torch.where(uniform[..., None], uniform_hemisphere(u), along_view(lobe, view, back=True))


def cltc_density(cosines: Cosines, roughness: Tensor) -> Tensor:
    """Density [1/sr] (...) of `cltc_sample`, both shares together."""
    mu = cosines.view
    x, y, z = along_view(local_light(cosines), local_view(cosines)).unbind(-1)
    a, b, c, d = cltc_matrix(mu, roughness)
    # M^-1 light, by the adjugate; light = M h/|M h|, so |M h| = 1/|M^-1 light| for unit h
    hx, hy, hz = (x - b * z) / (a - b * d), y / c, (a * z - d * x) / (a - b * d)
    squared = hx * hx + hy * hy + hz * hz
    s = (1 + 1 / torch.sqrt(1 + d * d)) / 2
    clipped = (hz > 0) & (d * hx + hz > 0)
    lobe = hz / (math.pi * s) / (c * (a - b * d) * squared * squared)
    share = cltc_uniform_share(mu, roughness)
    return share / (2 * math.pi) + (1 - share) * lobe.masked_fill(~clipped, 0.0)


def equivalent_roughness(sigma: Tensor) -> Tensor:
    """Roughness r of EON (...) whose sampler fits an Oren-Nayar surface of sigma (...) [rad]: B/A of (30), below 0.9.

    Variance relative to the squared mean stays below 0.05 for sigma from 0.2 to 1, at any view. The rms slope angle
    of other distributions serves as well as sigma.
    """
    s2 = sigma * sigma
    return 0.45 * s2 / (s2 + 0.09) / (1 - 0.5 * s2 / (s2 + 0.33))


class CltcSampled(ABC):
    """Gives a rough diffuse BRDF the sampler of EON, at the roughness it says it looks like."""

    @abstractmethod
    def sampling_roughness(self) -> Tensor:
        """Roughness r (...) of the EON that resembles this material. [-] in [0, 1]"""

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        light = cltc_sample(view, self.sampling_roughness(), u)
        return light, torch.zeros_like(light[..., 0], dtype=torch.bool)

    def density(self, cosines: Cosines) -> Tensor:
        return cltc_density(cosines, self.sampling_roughness())
