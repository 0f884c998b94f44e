"""Importance sampling of a BRDF: what every model can do, and what it may do better."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from torchbrdf._numerics import cross, safe_divide
from torchbrdf.directions import Cosines
from torchbrdf.sampling.draws import Sample, choose, cosine_hemisphere, uniform_hemisphere


class Sampled:
    """Draws light directions from the cosine, and a `uniform_share` of the hemisphere to bound grazing weights.

    Models override `propose` with `density` to draw from something nearer to what they reflect.
    """

    uniform_share: float = 0.0

    def evaluate(self, cosines: Cosines) -> Tensor:
        """f_r (..., channel) [1/sr], of the model."""
        raise NotImplementedError

    def tangent_of(self, normal: Tensor, tangent: Tensor | None) -> Tensor:
        """Unit tangent (..., 3) of the frame in which `propose` works, of the model."""
        raise NotImplementedError

    def sample(self, normal: Tensor, view: Tensor, u: Tensor, *, tangent: Tensor | None = None) -> Sample:
        """Light directions drawn for unit normals and views (..., 3) from u (..., 2) uniform in [0, 1).

        The weight f_r cos/pdf is an unbiased estimate of the directional albedo; see `Sample`. Raises what
        `Cosines.of` raises.
        """
        with torch.no_grad():
            t = self.tangent_of(normal, tangent)
            t = t.expand(torch.broadcast_shapes(t.shape, view.shape))
            axes = torch.stack((t, cross(normal, t), normal.expand_as(t)), -1)
            local = (axes * view[..., :, None]).sum(-2)
            proposed, delta = self.propose(local, u)
            light = (axes * proposed.to(axes.dtype)[..., None, :]).sum(-1)
            light = light / light.norm(dim=-1, keepdim=True)
        cosines = Cosines.of(normal, light, view, tangent=t)
        with torch.no_grad():
            pdf = self.density(cosines).masked_fill(~cosines.above_horizon, 0.0)
        factor = safe_divide(cosines.light, pdf, where=pdf > 0).detach()
        weight = self.evaluate(cosines) * factor[..., None]
        mirror = self.delta_reflectance(cosines)
        if mirror is not None:
            delta = delta & cosines.above_horizon
            probability = self.delta_probability(cosines)
            mirror = safe_divide(mirror, probability[..., None], where=(probability > 0)[..., None])
            weight = torch.where(delta[..., None], mirror, weight)
            pdf = pdf.masked_fill(delta, math.inf)
        return Sample(light, pdf, weight)

    def pdf(self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None) -> Tensor:
        """Density [1/sr] (...) with which `sample` draws the light; 0 below the horizon, delta lobes left out."""
        with torch.no_grad():
            cosines = Cosines.of(normal, light, view, tangent=self.tangent_of(normal, tangent))
            return self.density(cosines).masked_fill(~cosines.above_horizon, 0.0)

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        """Light (..., 3) for a view (..., 3), both in the frame (tangent, bitangent, normal), and whether it is
        a mirror direction (...). Called without gradients."""
        uniform, u1 = choose(u[..., 0], torch.full_like(u[..., 0], self.uniform_share))
        u = torch.stack((u1, u[..., 1]), -1)
        light = torch.where(uniform[..., None], uniform_hemisphere(u), cosine_hemisphere(u))
        light = light.expand(torch.broadcast_shapes(light.shape, view.shape))
        return light, torch.zeros_like(light[..., 0], dtype=torch.bool)

    def density(self, cosines: Cosines) -> Tensor:
        """Density [1/sr] (...) of `propose`, delta lobes left out; the cosines carry a tangent."""
        return (self.uniform_share / 2 + (1 - self.uniform_share) * cosines.light) / math.pi

    def delta_reflectance(self, cosines: Cosines) -> Tensor | None:
        """Reflectance (..., channel) of the mirror lobe, which `forward` cannot show; None without one. [-]"""
        return None

    def delta_probability(self, cosines: Cosines) -> Tensor:
        """Probability (...) with which `propose` returns the mirror direction."""
        return torch.zeros_like(cosines.view)


def propose_from_parts(parts: Sequence[Sampled], shares: Tensor, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    """`propose` from one of several parts, each with the probability `shares` (part,) gives it."""
    u1, start = u[..., 0], torch.zeros_like(shares[0])
    light, delta = torch.zeros_like(view), torch.zeros_like(view[..., 0], dtype=torch.bool)
    for part, share in zip(parts, shares, strict=True):
        # the part whose share of [0, 1) holds u1 draws from where in it u1 lies
        within = ((u1 - start) / share).clamp(0.0, 1 - torch.finfo(u.dtype).eps)
        here, is_delta = part.propose(view, torch.stack((within, u[..., 1]), -1))
        inside = (u1 >= start).expand(is_delta.shape)
        light, delta = torch.where(inside[..., None], here, light), torch.where(inside, is_delta, delta)
        start = start + share
    return light, delta
