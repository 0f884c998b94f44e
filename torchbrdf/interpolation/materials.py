r"""Two coordinates of a rough diffuse material, roughness and albedo, in which what it takes of an image is smooth.

.. math:: s = \frac{\ln(1 + \sigma^2/a^2)}{\ln(1 + (\pi/2)^2/a^2)},\quad
    t = \frac{\sqrt{1 + b^2} - \sqrt{1 - \rho + b^2}}{\sqrt{1 + b^2} - b}

Even in sigma next to 0, and finer for small sigma, whose effects lie within sigma of the horizon; finer for white
facets, between which light bounces for long.
"""

import math

import torch
from torch import Tensor

_SMALL = math.radians(3.0)  # a [rad]
_WHITE = 0.1  # b
_BLACK = math.sqrt(1 + _WHITE * _WHITE)
_WHOLE = math.log1p((0.5 * math.pi / _SMALL) ** 2)


def roughness_coordinate(sigma: Tensor) -> Tensor:
    """s (...) in [0, 1] of sigma (...) [rad] in [0, pi/2]; zero derivative at 0."""
    ratio = sigma / _SMALL
    return torch.log1p(ratio * ratio) / _WHOLE


def sigma_at(coordinate: Tensor) -> Tensor:
    """The inverse of `roughness_coordinate`. [rad]"""
    return _SMALL * torch.expm1(_WHOLE * coordinate).sqrt()


def albedo_coordinate(albedo: Tensor) -> Tensor:
    """t (...) in [0, 1] of rho (...) in [0, 1]. [-]"""
    return (_BLACK - (1 - albedo + _WHITE * _WHITE).sqrt()) / (_BLACK - _WHITE)


def albedo_at(coordinate: Tensor) -> Tensor:
    """The inverse of `albedo_coordinate`. [-]"""
    root = _BLACK - (_BLACK - _WHITE) * coordinate
    return (1 + _WHITE * _WHITE - root * root).clamp(0, 1)
