"""The weights of a sampler by quadrature: Monte Carlo does not see a variance that lives near grazing."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf import BRDF, Oriented
from torchbrdf.testing import laws


class Weights(NamedTuple):
    """Mean (channel,), variance over the squared mean and largest over the mean of the weights, of channel 0."""

    mean: Tensor
    variance: float
    largest: float


def by_quadrature(brdf: BRDF, angle: float, *, azimuth: float = 0.0, uniform: float | None = None) -> Weights:
    """For a view at a polar angle and an azimuth from the tangent [rad].

    `uniform` takes a share of uniform directions and else the cosine, instead of the sampler of the model.
    """
    brdf = brdf.brdf if isinstance(brdf, Oriented) else brdf
    # a panel for the last two degrees: rough surfaces brighten there
    theta, theta_weight = laws.panels(sorted({0.0, angle, math.radians(88), math.pi / 2}), 16)
    phi, phi_weight = laws.panels([azimuth + k * math.pi / 2 for k in range(5)], 12)
    sin, cos = theta.sin()[:, None], theta.cos()[:, None]
    light = torch.stack(torch.broadcast_tensors(sin * phi.cos(), sin * phi.sin(), cos), -1).reshape(-1, 3)
    area = (sin * theta_weight[:, None] * phi_weight).reshape(-1)
    s, c = math.sin(angle), math.cos(angle)
    view = torch.tensor([s * math.cos(azimuth), s * math.sin(azimuth), c], dtype=torch.float64)
    tangent, _, normal = torch.eye(3, dtype=torch.float64)
    light, view = (torch.nn.functional.normalize(v, dim=-1) for v in (light, view))
    with torch.no_grad():
        received = brdf(normal, light, view, tangent=tangent) * light[:, 2:]
        pdf = brdf.pdf(normal, light, view.expand_as(light), tangent=tangent)
        if uniform is not None:
            pdf = (uniform / 2 + (1 - uniform) * light[:, 2]) / math.pi
    mean = (received * area[:, None]).sum(0)
    weight = received[:, 0] / pdf / mean[0]
    return Weights(mean, float((weight * received[:, 0] * area).sum() / mean[0]) - 1, float(weight.max()))
