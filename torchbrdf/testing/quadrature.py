"""The directional albedo through `forward` alone: what the closed forms and quadratures of models are held against."""

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.quadrature import gauss_legendre


def albedo_by_quadrature(brdf: BRDF, view_angle: float, nodes: int) -> Tensor:
    """Share of light from view_angle [rad] that is reflected (channel,); through `forward` alone."""
    theta, theta_weight = panels([0.0, view_angle, math.pi / 2], nodes)
    phi, phi_weight = panels([k * math.pi / 2 for k in range(5)], nodes)
    sin, cos = theta.sin()[:, None], theta.cos()[:, None]
    light = torch.stack(torch.broadcast_tensors(sin * phi.cos(), sin * phi.sin(), cos), -1)
    view = torch.tensor([math.sin(view_angle), 0.0, math.cos(view_angle)], dtype=torch.float64)
    normal = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    with torch.no_grad():
        f = brdf(normal, light, view, normalize=True)
    return (f * (sin * cos * theta_weight[:, None] * phi_weight)[..., None]).sum((0, 1))


def panels(ends: Sequence[float], nodes: int) -> tuple[Tensor, Tensor]:
    """Nodes and weights (piece * node,), float64, of Gauss-Legendre rules between each two neighbours of `ends`."""
    x, w = gauss_legendre(nodes, torch.empty((), dtype=torch.float64))
    points = torch.cat([a + (b - a) * x for a, b in pairwise(ends)])
    return points, torch.cat([(b - a) * w for a, b in pairwise(ends)])
