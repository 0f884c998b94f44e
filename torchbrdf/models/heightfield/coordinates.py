r"""Coordinates in which the reflectance of every Gaussian heightfield is nearly one smooth function.

Masking knows of a direction only t = s tan(theta), so a light and a view are a pair of points at distances t_i, t_r in
one plane for all roughnesses; s itself enters once more, through the facets' own tilt. Everything is even in s,
symmetric in light and view, 0 for a smooth surface, and made of the cosines without an angle.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import threshold

from torchbrdf._numerics import half_turn_sine, soft_sqrt
from torchbrdf.models.heightfield.visibility import SMOOTH_HEIGHTFIELD

KNEE = 0.6  # [rad] of x = sigma^2/(sigma^2 + KNEE^2), the variable of s/sigma
# t^2 below which no facet is hidden, as far as float32 can tell: phi(1/t) underflows.
_FLAT = 0.006
_NOTHING_HIDDEN = 1e-30  # Lambda that changes no digit; larger ones have t^2 > _FLAT
# sin^2 sin^2 that neither direction reaches where it is hidden: s^2 <= 2.2 leaves t^2 < _FLAT for sin^2 < 1e-3.
_NO_AZIMUTH = 1e-6
_SCALES = (0.25, 0.5, 0.25, 0.25, 1.0, 2.0, 1.5)  # bring the coordinates to one size


class Coordinates(NamedTuple):
    """Of directions (...) on a surface of rms slope s."""

    features: Tensor  # (7, ...)
    masked: Tensor  # (1 + L_i)(1 + L_r)/(1 + D), what masking makes of parallel facets (...)
    share: Tensor  # s^2/(1 + s^2) (...)


def slope_squared(sigma: Tensor, series: tuple[float, ...]) -> Tensor:
    """s^2 (...) of sigma (...) [rad], with s/sigma a polynomial in x, lowest power first."""
    s2 = sigma * sigma
    x = s2 / (s2 + KNEE * KNEE)
    ratio = torch.full_like(x, series[-1])
    for c in reversed(series[:-1]):
        ratio = ratio * x + c
    return s2 * ratio * ratio


def coordinates(light: Tensor, view: Tensor, phase: Tensor, azimuth_sine: Tensor, squared: Tensor) -> Coordinates:
    """From the fields of `Cosines` of these names and s^2, each (...)."""
    in_plane = phase - light * view
    sine2_i, sine2_r = (1 - light) * (1 + light), (1 - view) * (1 + view)
    t2_i = squared * sine2_i / (light * light)
    t2_r = squared * sine2_r / (view * view)
    dot = squared * in_plane / (light * view)
    masking_i, steep_i = _smith(t2_i)
    masking_r, steep_r = _smith(t2_r)
    both, product = masking_i + masking_r, masking_i * masking_r
    inverse = torch.rsqrt((sine2_i * sine2_r).clamp(min=_NO_AZIMUTH))
    half_turn = half_turn_sine(in_plane * inverse, azimuth_sine * inverse)
    z = half_turn * (SMOOTH_HEIGHTFIELD.turn + SMOOTH_HEIGHTFIELD.grazing_turn * torch.rsqrt(steep_i + steep_r))
    turn = z / (1 + z)
    difference = masking_i - masking_r
    joint = 0.5 * (both + soft_sqrt(difference * difference + 4 * turn * turn * product))
    area_i, area_r = 1 + t2_i, 1 + t2_r
    depth_i, depth_r = area_i.log(), area_r.log()
    depth, total = depth_i + depth_r, t2_i + t2_r
    features = (
        depth,
        depth_i * depth_r / (1 + depth),
        torch.log1p((total + 2 * dot).relu()),  # the two points on one side of the normal
        torch.log1p((total - 2 * dot).relu()),  # and their distance
        dot * torch.rsqrt(area_i) * torch.rsqrt(area_r),
        (both - joint) / (1 + both),  # the cone at light = view
        squared / (1 + squared),
    )
    scaled = [f * k for f, k in zip(torch.broadcast_tensors(*features), _SCALES, strict=True)]
    return Coordinates(torch.stack(scaled), (1 + both + product) / (1 + joint), features[-1])


def _smith(t2: Tensor) -> tuple[Tensor, Tensor]:
    """Smith's Lambda = t phi(nu) - Phi(-nu) and nu^2 = 1/t^2, each (...)."""
    steep = 1 / t2.clamp(min=_FLAT)
    root = steep.sqrt()
    masking = torch.exp(-0.5 * steep) / (math.sqrt(2 * math.pi) * root) - 0.5 * torch.erfc(math.sqrt(0.5) * root)
    # Next to the normal a constant that changes no digit; not 0, where the joint masking has no second derivative.
    return threshold(masking, _NOTHING_HIDDEN, _NOTHING_HIDDEN), steep
