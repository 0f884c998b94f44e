r"""Which facets of a Gaussian heightfield a ray meets: masking facet by facet, and what two rays share.

A ray at polar angle theta meets the surface at t = s tan(theta), nu = 1/t (masking is invariant under vertical
stretching). A facet whose slopes are s xi, xi ~ N(0, 1) along the ray, rises towards it by y = nu + xi in units of s.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import softplus

from torchbrdf._numerics import quiet_width, safe_divide, soft_sqrt

# Two nodes of Craig's rule for erfc(sqrt(g y))/2.
_NARROW = (2 - math.sqrt(2)) / 4
_WIDE = (2 + math.sqrt(2)) / 4
_OTHER_SPECTRA = 0.292  # how much occlusion moves the strength at grazing
# Share of Smith's masking up to which occlusion is free, and the width over which it then levels off at 1. At
# occlusion 1 this changes f_1 by less than 1e-10, at 1.15 by less than 1e-7.
_FREE = 0.5
_SOFTNESS = 0.01


@dataclass(frozen=True)
class HeightfieldConstants:
    """Constants of the visibility, from path-traced Gaussian heightfields of one smooth scale.

    Attributes:
        level, grazing: a and b of g = (4/3) nu - a + b/nu, which says how local curvature hides a facet. [-]
        turn, grazing_turn: K and k of z = (K + k/sqrt(nu_i^2 + nu_r^2)) sin(dphi/2), which says how the visibilities
            of two rays become independent as their azimuths part. [-]
    """

    level: float
    grazing: float
    turn: float
    grazing_turn: float


# Meshes of 12 cells a correlation length (autocorrelation exp(-d^2/tau^2)): the nearer to a smooth surface.
SMOOTH_HEIGHTFIELD = HeightfieldConstants(level=0.5668, grazing=0.3917, turn=3.381, grazing_turn=1.3318)
# Meshes of 6 cells a correlation length: for comparison with renderings of such meshes.
MESHED_HEIGHTFIELD = HeightfieldConstants(level=0.479, grazing=0.2825, turn=3.4157, grazing_turn=1.2846)


class Ray(NamedTuple):
    """A ray over the surface, each (...). [-]"""

    tangent: Tensor  # t = s tan(theta)
    steepness: Tensor  # nu = 1/t, bounded where no facet is hidden
    curvature: Tensor  # g
    occlusion: Tensor  # E, or less where it would hide more than there is
    masking: Tensor  # Lambda: 1 + Lambda is the area of facets towards the ray over the area it sees


def ray(tangent: Tensor, occlusion: Tensor, constants: HeightfieldConstants) -> Ray:
    r"""What masks a ray of t = s tan(theta) (...).

    .. math::
        \Lambda = \varphi(\nu)\,\{t - M(\nu) - E \tfrac t4 [r(g/s_1 - \nu) + r(g/s_2 - \nu)]\},\quad
        r(q) = 1 - q M(q)

    with M the Mills ratio, such that E[X+/(1 + L)] = 1 for X = 1 + t xi: the projected area is exact. The share of
    Smith's masking that E takes away, E t [..]/4 / (t - M), cannot exceed 1; near 1 it levels off, and with it E.
    """
    # Below this t even a facet at the end of the slopes is seen: every term underflows, and the bound changes nothing.
    t = tangent.clamp(min=1 / quiet_width(tangent.dtype))
    nu = 1 / t
    g = 4 / 3 * nu - constants.level + (constants.grazing - _OTHER_SPECTRA * (occlusion - 1)) * t
    near = t / 4 * (_share_hidden(g / _NARROW - nu) + _share_hidden(g / _WIDE - nu))
    whole = t - _mills(nu)
    share = occlusion * near / whole
    strong = share > _FREE
    left = torch.where(strong, _SOFTNESS * softplus((1 - share) / _SOFTNESS), 1 - share)
    effective = torch.where(strong, safe_divide((1 - left) * whole, near, where=strong), occlusion)
    density = torch.exp(-0.5 * nu * nu) / math.sqrt(2 * math.pi)
    return Ray(tangent, nu, g, effective, density * whole * left)


def _mills(x: Tensor) -> Tensor:
    """Phi(-x)/phi(x) of the normal distribution."""
    return math.sqrt(math.pi / 2) * torch.special.erfcx(x / math.sqrt(2))


def _share_hidden(q: Tensor) -> Tensor:
    """r(q) = 1 - q M(q)."""
    return 1 - q * _mills(q)


def facet_masking(towards: Tensor, along: Ray) -> Tensor:
    """L (...) of facets that rise towards a ray by y >= 0: a share 1/(1 + L) of them is seen. [-]"""
    reach = -along.curvature * towards
    hidden = along.occlusion / 4 * (torch.exp(reach / _NARROW) + torch.exp(reach / _WIDE))
    return (along.masking + hidden) / (1 - hidden)


def independence(first: Ray, second: Ray, half_turn: Tensor, constants: HeightfieldConstants) -> Tensor:
    """l = z/(1 + z) (...) in [0, 1): 0 where the second ray meets what the first has met, near 1 where it knows
    nothing of it; half_turn is sin(dphi/2).
    """
    apart = torch.rsqrt(first.steepness * first.steepness + second.steepness * second.steepness)
    z = (constants.turn + constants.grazing_turn * apart) * half_turn
    return z / (1 + z)


def joint_masking(first: Tensor, second: Tensor, independent: Tensor) -> Tensor:
    """D (...): a share 1/(1 + D) of facets is seen by both rays that mask L_i and L_r. [-]

    The larger eigenvalue of [[L_i, l sqrt(L_i L_r)], [., L_r]]: L_i + L_r for l = 1 (Smith with correlated heights),
    the larger one for l = 0.
    """
    difference = first - second
    return (first + second + soft_sqrt(difference * difference + 4 * independent * independent * first * second)) / 2
