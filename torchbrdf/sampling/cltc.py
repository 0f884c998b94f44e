"""The clipped, linearly transformed cosine of EON: the sampler of rough diffuse models.

Source: Portsmouth, Kutz & Hill 2025, "EON: A practical energy-preserving rough diffuse BRDF", Journal of Computer
    Graphics Techniques 14(1), arXiv:2410.18026.
"""

import math
from abc import ABC, abstractmethod

import torch
from torch import Tensor

from torchbrdf._numerics import dot, safe_sqrt
from torchbrdf.directions import Cosines
from torchbrdf.sampling.draws import along_view, choose, local_light, local_view, uniform_disc, uniform_hemisphere


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
    """Roughness r of EON (...) whose sampler fits an Oren-Nayar surface of sigma (...) [rad]: B/A, below 0.9.

    A and B are those of Oren & Nayar 1994, DOI 10.1145/192161.192213, eq. (30).
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
