"""What the parts of a solid send on to each other, as a camera sees it.

Diffuse: the parts, and the point for this light, scatter as Lambert surfaces of the model's white-sky albedo.
"""

import math

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor

from torchbrdf import BRDF, is_per_texel

_ALBEDO_NODES = 12


def passed_on(rho: Tensor, images: Tensor) -> Tensor:
    """sum_b rho^(b + 1) T_b/pi (..., channel) of irradiances T_b (bounce, ..., channel) among white parts, of albedo
    rho (channel,)."""
    total, power = torch.zeros_like(images[0]), rho
    for image in images:
        power = power * rho
        total = total + power / math.pi * image
    return total


def white_sky_albedo(model: BRDF, like: Tensor) -> Tensor:
    """Share of uniform light that is reflected: 2 int E(mu) mu dmu (channel,), at nodes in the dtype of `like`. [-]

    Raises ValueError for a model with parameters per texel.
    """
    if is_per_texel(model):
        raise ValueError(
            "light between parts needs one material: the model has parameters per texel; set Scene.between_parts=False."
        )
    nodes, weights = (like.new_tensor(k) for k in leggauss(_ALBEDO_NODES))
    cosines = (1 + nodes) / 2
    return (model.directional_albedo(cosines) * (cosines * weights)[:, None]).sum(0)
