"""Facets in proportion to the area a view sees of them (visible normals), in the frame of the surface."""

import math

import torch
from torch import Tensor

from torchbrdf._numerics import safe_sqrt
from torchbrdf.sampling.draws import along_view

_BISECTIONS = 54
# erf(x) is 1 in float64 beyond.
_ERF_END = 6.0


def visible_ggx_facet(view: Tensor, alpha_x: Tensor, alpha_y: Tensor, u: Tensor) -> Tensor:
    """Unit facet normals (..., 3) of GGX, of density D G1(view) (view . m)/cos_view.

    Args:
        view: local (..., 3), above the horizon. alpha_x, alpha_y: (...). u: (..., 2).
    Source: Dupuy & Benyoub 2023, "Sampling visible GGX normals with spherical caps", DOI 10.1111/cgf.14867.
    """
    stretched = _stretched(view, alpha_x, alpha_y)
    x, y, z = stretched.unbind(-1)
    phi = 2 * math.pi * u[..., 0]
    cap = (1 - u[..., 1]) * (1 + z) - z
    sine = safe_sqrt((1 - cap) * (1 + cap))
    half = torch.stack((sine * phi.cos() + x, sine * phi.sin() + y, cap + z), -1)
    return _unit(torch.stack((alpha_x * half[..., 0], alpha_y * half[..., 1], half[..., 2]), -1))


def visible_beckmann_facet(view: Tensor, alpha_x: Tensor, alpha_y: Tensor, u: Tensor) -> Tensor:
    """Unit facet normals (..., 3) of Beckmann, of density D G1(view) (view . m)/cos_view.

    The slope along the stretched view has density (1 + slope tan)^+ exp(-slope^2); its integral is closed and is
    inverted by bisection. Across it the slope is Gaussian. Arguments as `visible_ggx_facet`.
    Source: Heitz & d'Eon 2014, "Importance sampling microfacet-based BSDFs using the distribution of visible normals",
        DOI 10.1111/cgf.12417; Jakob 2014, "An improved visible normal sampling routine for the Beckmann distribution".
    """
    stretched = _stretched(view, alpha_x, alpha_y)
    # facet normals proportional to (-p, -q, 1) with slopes p along the view's azimuth
    cos, u1 = torch.broadcast_tensors(stretched[..., 2], u[..., 0])
    sin = safe_sqrt((1 - cos) * (1 + cos))
    # integral of (cos + t sin) exp(-t^2) up to t, for t = -p from -cot(theta) on
    low = torch.maximum(-cos / sin.clamp(min=torch.finfo(cos.dtype).tiny), torch.full_like(cos, -_ERF_END))
    high = torch.full_like(cos, _ERF_END)

    def below(t: Tensor) -> Tensor:
        return cos * math.sqrt(math.pi) / 2 * torch.erf(t) - sin / 2 * (-t * t).exp()

    start, end = below(low), below(high)
    target = start + u1 * (end - start)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        early = below(middle) < target
        low, high = torch.where(early, middle, low), torch.where(early, high, middle)
    along = (low + high) / 2
    across = torch.erfinv((2 * u[..., 1] - 1).clamp(min=-1 + torch.finfo(cos.dtype).eps)).expand_as(along)
    half = along_view(torch.stack((along, across, torch.ones_like(along)), -1), stretched, back=True)
    return _unit(torch.stack((alpha_x * half[..., 0], alpha_y * half[..., 1], half[..., 2]), -1))


def _stretched(view: Tensor, alpha_x: Tensor, alpha_y: Tensor) -> Tensor:
    """The view as the surface of width 1 sees it: unit (..., 3)."""
    x, y, z = view.unbind(-1)
    return _unit(torch.stack(torch.broadcast_tensors(alpha_x * x, alpha_y * y, z), -1))


def _unit(vector: Tensor) -> Tensor:
    return vector / vector.norm(dim=-1, keepdim=True)
