"""The Oren-Nayar code that people write by hand, from the paper's angles: what the library is timed against.

Never tuned: it is neither made faster nor slower to make a point. It has the faults this library exists for: `acos` and
`tan` of clamped cosines, no gradient worth having at normal incidence, NaN where light or view is the normal.
"""

import math

import torch
from torch import Tensor


def naive_oren_nayar(normal: Tensor, light: Tensor, view: Tensor, sigma: Tensor, albedo: Tensor) -> Tensor:
    """Oren & Nayar 1994, eqs. (27)-(29): vectors (pixel, 3), sigma (pixel,), albedo (pixel, channel)."""
    cos_i = (normal * light).sum(-1).clamp(1e-6, 1 - 1e-6)
    cos_r = (normal * view).sum(-1).clamp(1e-6, 1 - 1e-6)
    theta_i, theta_r = torch.acos(cos_i), torch.acos(cos_r)
    light_plane = torch.nn.functional.normalize(light - cos_i[:, None] * normal, dim=-1)
    view_plane = torch.nn.functional.normalize(view - cos_r[:, None] * normal, dim=-1)
    cos_phi = (light_plane * view_plane).sum(-1)
    alpha, beta = torch.maximum(theta_i, theta_r), torch.minimum(theta_i, theta_r)
    s2 = sigma**2
    c1 = 1 - 0.5 * s2 / (s2 + 0.33)
    forward = alpha.sin() - (2 * beta / math.pi) ** 3
    c2 = 0.45 * s2 / (s2 + 0.09) * torch.where(cos_phi >= 0, alpha.sin(), forward)
    c3 = 0.125 * s2 / (s2 + 0.09) * (4 * alpha * beta / math.pi**2) ** 2
    direct = c1 + cos_phi * c2 * beta.tan() + (1 - cos_phi.abs()) * c3 * ((alpha + beta) / 2).tan()
    bounced = 0.17 * s2 / (s2 + 0.13) * (1 - cos_phi * (2 * beta / math.pi) ** 2)
    return albedo / math.pi * direct[:, None] + albedo**2 / math.pi * bounced[:, None]
