r"""Two and more bounces: Smith's surface as a half-space, solved order by order, then balanced so that no light is
lost.

In the depth tau = -ln C_1(height) a surface without correlation is a half-space whose extinction is Lambda upwards and
1 + Lambda downwards. Adding a thin layer on top must change nothing (Ambartsumian), so with S = f cos cos

.. math::
    (1 + \Lambda_i + \Lambda_r) S_n = \int k(i, -q) S_{n-1}(q, r) \frac{dq}{q_z} + (i \leftrightarrow r)
        + \sum_{a+b=n-1} \iint S_a(i, q)\, k(-q, -q')\, S_b(q', r) \frac{dq\,dq'}{q_z q'_z}

with (1 + Lambda_i + Lambda_r) S_1 = k(i, r) and k(a, b) the light that facets turn from direction a to b. All of it in
Fourier modes f = F_0 + 2 F_1 cos(dphi) + 2 F_2 cos(2 dphi) + .. on Gauss-Legendre nodes of the polar angle.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor

from torchbrdf._constants import constant
from torchbrdf._numerics import safe_divide, safe_sqrt
from torchbrdf.models.heightfield.direct import Quadrature, direct_light
from torchbrdf.models.heightfield.slope_frame import SlopeFrame
from torchbrdf.models.heightfield.visibility import HeightfieldConstants, ray
from torchbrdf.quadrature import gauss_legendre, gauss_legendre_rule

_SLOPE_PANELS = (0.0, 1.0, 2.0, 3.2, 4.6, 6.5, 9.0)  # standard deviations
_SLOPES_A_PANEL = 6
_AZIMUTHS = 24  # midpoints on [0, pi], of the albedo of direct light
_BALANCING_STEPS = 30
# Of mode 1 in even orders: light that leaves a correlated surface after two bounces points back less than Smith's.
_EVEN_TURN = 0.70
# Smith's masking knows none of the constants.
_SMITH = HeightfieldConstants(level=0.0, grazing=1.0, turn=0.0, grazing_turn=0.0)


class Polar(NamedTuple):
    """Nodes of the polar angle, each (P,)."""

    theta: Tensor
    cos: Tensor
    sin: Tensor
    solid_angle: Tensor  # 2 pi sin(theta) d(theta)


def polar_nodes(count: int, like: Tensor) -> Polar:
    x, weight = gauss_legendre(count, like)
    theta = 0.5 * math.pi * x
    return Polar(theta, theta.cos(), theta.sin(), math.pi**2 * weight * theta.sin())


class Transport(Protocol):
    """How facets light each other. Tables are kept by it: two that are equal must have one hash."""

    def modes(self, slope: Tensor, nodes: Polar, orders: int) -> Tensor:
        """F_n (..., orders, M, P, P) of n = 2 .. orders + 1 bounces at unit albedo [1/sr], modes 0 .. M - 1, M >= 2.

        Symmetric in light and view, positive, and 0 for slope 0; their level is balanced by who asks for them.
        """
        ...


@dataclass(frozen=True)
class IndependentFacets:
    """Facets that light each other as if their slopes knew nothing of each other: Smith's surface."""

    def modes(self, slope: Tensor, nodes: Polar, orders: int) -> Tensor:
        return smith_modes(slope, nodes, orders)


INDEPENDENT_FACETS = IndependentFacets()


def bounce_modes(
    slope: Tensor,
    occlusion: Tensor,
    constants: HeightfieldConstants,
    quadrature: Quadrature,
    *,
    polar: int,
    orders: int,
    transport: Transport = INDEPENDENT_FACETS,
) -> Tensor:
    """F_n of n = 2 .. orders + 1 bounces at unit albedo, (..., orders, M, polar, polar) [1/sr].

    Args:
        slope, occlusion: rms slope s and occlusion E (...).
        constants, quadrature: of direct light, which says what the other orders have to return.
        polar: nodes of the polar angle in light and view.
        transport: what the bounces are before they are balanced.
    """
    nodes = polar_nodes(polar, slope)
    modes = transport.modes(slope, nodes, orders)
    lost = 1 - direct_albedo(slope, occlusion, constants, quadrature, nodes)
    share = modes[..., 0, :, :].sum(-3) * (nodes.solid_angle * nodes.cos)
    balance = _balance(share, lost)
    return modes * (balance[..., :, None] * balance[..., None, :])[..., None, None, :, :]


def smith_modes(slope: Tensor, nodes: Polar, orders: int) -> Tensor:
    """F_n of Smith's surface, (..., orders, 2, P, P); mode 1 of even orders damped."""
    masking = smith_masking(slope, nodes)
    extinction = (1 + masking[..., :, None] + masking[..., None, :])[..., None, :, :]
    up, down, weight = facet_modes(slope, nodes, 2)
    kernel = up * weight @ up.mT
    into = (up * weight @ down.mT) * slope.new_tensor([1.0, -1.0])[:, None, None]  # -q lies across the azimuth of q
    inside = down * weight @ down.mT
    measure = nodes.solid_angle / nodes.cos
    scattered = [kernel / extinction]
    for _ in range(orders):
        last = into * measure @ scattered[-1]
        total = last + last.mT
        if len(scattered) > 1:
            ahead = torch.cat([s * measure for s in scattered[:-1]], -1)
            back = torch.cat([inside * measure @ s for s in reversed(scattered[:-1])], -2)
            total = total + ahead @ back
        scattered.append(total / extinction)
    damping = slope.new_tensor([[1.0, _EVEN_TURN if n % 2 == 0 else 1.0] for n in range(2, orders + 2)])
    return torch.stack(scattered[1:], -4) / (nodes.cos[:, None] * nodes.cos) * damping[..., None, None]


def smith_masking(slope: Tensor, nodes: Polar) -> Tensor:
    """Lambda (..., P) of Smith's surface."""
    return ray(slope[..., None] * nodes.sin / nodes.cos, torch.zeros_like(slope)[..., None], _SMITH).masking


@constant
@lru_cache(maxsize=1)
def slope_rule() -> tuple[list[float], list[float]]:
    """Slopes over their rms and their shares."""
    x, w = (np.array(rule) for rule in gauss_legendre_rule(_SLOPES_A_PANEL))
    radius = np.concatenate([a + (b - a) * x for a, b in pairwise(_SLOPE_PANELS)])
    share = np.concatenate([(b - a) * w for a, b in pairwise(_SLOPE_PANELS)]) * radius * np.exp(-(radius**2) / 2)
    return radius.tolist(), (share / share.sum()).tolist()


def facet_modes(slope: Tensor, nodes: Polar, count: int) -> tuple[Tensor, Tensor, Tensor]:
    """c_m = (1/2 pi) int (c + q cos(psi))^+ cos(m psi) dpsi, m < count, of facets of each slope, towards directions
    above and below the horizon, (..., count, P, slope), and the facets' shares times their cosines over pi
    (..., 1, 1, slope).
    """
    radii, shares = slope_rule()
    tan = slope[..., None] * slope.new_tensor(radii)
    q = tan[..., None, :] * nodes.sin[:, None]
    sides = []
    for c in (nodes.cos[:, None], -nodes.cos[:, None]):
        sine_q = safe_sqrt(q * q - c * c)
        end = torch.atan2(sine_q, -c.expand_as(q))  # facets face the direction up to this azimuth
        waves = [end, *((m * end).sin() / m for m in range(1, count + 1))]
        modes = [c * waves[m] + q * (waves[abs(m - 1)] + waves[m + 1]) / 2 for m in range(count)]
        sides.append(torch.stack(modes, -3) / math.pi)
    weight = slope.new_tensor(shares) * torch.rsqrt(1 + tan * tan) / math.pi
    return sides[0], sides[1], weight[..., None, None, :]


def direct_albedo(
    slope: Tensor, occlusion: Tensor, constants: HeightfieldConstants, quadrature: Quadrature, nodes: Polar
) -> Tensor:
    """Share of light that leaves after one bounce (..., P), of unit albedo."""
    count = len(nodes.theta)
    first, second = torch.triu_indices(count, count, device=slope.device)  # the second is the more grazing
    dphi = (torch.arange(_AZIMUTHS, dtype=slope.dtype, device=slope.device) + 0.5) * (math.pi / _AZIMUTHS)
    tan = nodes.sin / nodes.cos
    s = slope[..., None, None]
    other = s * tan[first][:, None]
    frame = SlopeFrame(
        grazing=s * tan[second][:, None],
        other=other,
        other_along=other * dphi.cos(),
        other_across=other * dphi.sin(),
        half_turn=(dphi / 2).sin(),
        along=s * s,
        mixed=torch.zeros_like(s),
        across=s * s,
    )
    pairs = direct_light(frame, occlusion[..., None, None], constants, quadrature).mean(-1)
    place = torch.zeros(count, count, dtype=torch.long, device=slope.device)
    place[first, second] = place[second, first] = torch.arange(len(first), device=slope.device)
    return (pairs[..., place] * (nodes.solid_angle * nodes.cos)).sum(-1)


def _balance(share: Tensor, lost: Tensor) -> Tensor:
    """kappa (..., P) such that kappa_i sum_j share_ij kappa_j is what direct light lost; 1 where that is nothing."""
    kappa = torch.ones_like(lost)
    for _ in range(_BALANCING_STEPS):
        returned = kappa * (share @ kappa[..., None])[..., 0]
        missing = (lost > 0) & (returned > 0)
        step = safe_sqrt(safe_divide(lost, returned, where=missing))
        kappa = torch.where(missing, kappa * step, torch.ones_like(kappa))
    return kappa
