r"""Slope-area distributions: weights on fixed slope angles, moments and samples.

A rough surface is a weighted sum of single slopes: f = sum_k w_k f(theta_k). The angles are the same for all materials,
so that what depends on the geometry is computed once, and the weights are all that the roughness changes. Node 0 is the
flat facet: it makes sigma = 0 exactly Lambert.

Gaussian slopes, Oren & Nayar 1994, eq. (26), normalised for azimuth *means*:
    w(theta) = exp(-theta^2 / 2 sigma^2) sin(theta) / Z(sigma) on [0, pi/2].
sigma is the width of the truncated polar Gaussian, not the standard deviation of theta (for small sigma,
E[theta^2] = 2 sigma^2).
Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), eqs. (25), (26); `docs/equations/oren_nayar.md`, section 6, for the normalisation.
"""

import math
from functools import lru_cache

import torch
from torch import Tensor

from torchbrdf._constants import constant
from torchbrdf._numerics import positive, quiet_width, sinc
from torchbrdf.quadrature import gauss_legendre, gauss_legendre_rule

_QUARTER_TURN = 0.5 * math.pi
_MOMENT_NODES = 64  # the moments are integrals of an analytic function over at most 9 standard deviations
_MOMENT_WIDTH = 9.0  # exp(-81/2) is below the rounding of float64


@constant
@lru_cache(maxsize=32)
def _slope_angles(count: int) -> tuple[float, ...]:
    return (0.0, *(_QUARTER_TURN * node for node in gauss_legendre_rule(count - 1)[0]))


def shared_slopes(count: int) -> tuple[float, ...]:
    """The `count` shared slope angles: 0 and the Gauss-Legendre nodes of (0, pi/2), ascending. [rad]"""
    if count < 3:
        raise ValueError(f"nodes must be at least 3 (the flat facet and two slopes); found {count}.")
    return _slope_angles(count)


def gaussian_moments(sigma: Tensor) -> tuple[Tensor, Tensor]:
    """Z(sigma) / sigma^2 and E[theta^2] / sigma^2 of the truncated polar Gaussian, for sigma (...) in [0, pi/2] [rad];
    1 and 2 at sigma = 0.
    """
    x, weight = gauss_legendre(_MOMENT_NODES, sigma)
    end = _QUARTER_TURN / sigma.clamp(min=_QUARTER_TURN / _MOMENT_WIDTH)
    x = end[..., None] * x  # theta / sigma
    density = weight * torch.exp(-0.5 * x * x) * x * sinc(sigma[..., None] * x)
    total = density.sum(-1)
    return end * total, (density * x * x).sum(-1) / total


def gaussian_weights(sigma: Tensor, *, nodes: int) -> Tensor:
    r"""Weights of the shared slopes for Gaussian roughness.

    Gauss-Legendre weights divided by the exact Z miss whatever falls between the nodes. That remainder of the moments
    of 1 and theta^2 goes to the flat facet and to the second slope (the first lies so close to flat that large weights
    of both signs would have to cancel). Above the node spacing the remainder is spectrally small and the rule is plain
    Gauss-Legendre; for sigma -> 0 it is everything, and the sum becomes the expansion f(0) + E[theta^2] f''(0)/2. One
    analytic formula in between: no blend, no switch. Near the spacing single weights may be negative (down to -0.8).

    Args: sigma (...) in [0, pi/2]. [rad]
    Returns: (..., nodes), sums to 1; (1, 0, 0, ...) at sigma = 0, with zero derivative there. [-]
    """
    # At least 1-D inside: forward differentiation of "number * 0-d float32 tensor" yields float64.
    shape, sigma = sigma.shape, torch.atleast_1d(sigma)
    angle = sigma.new_tensor(shared_slopes(nodes)[1:])
    base = _QUARTER_TURN * gauss_legendre(nodes - 1, sigma)[1] * angle.sin()
    scaled_total, second = gaussian_moments(sigma)
    # Far below the first slope every Gaussian value underflows to 0: the clamp changes no value and no derivative.
    wide = sigma.clamp(min=shared_slopes(nodes)[1] / (2 * quiet_width(sigma.dtype)))[..., None]
    ratio = angle / wide
    sampled = base * torch.exp(-0.5 * ratio * ratio) / (wide * wide * scaled_total[..., None])
    missing = sigma * sigma * second - (sampled * angle * angle).sum(-1)
    second_slope = missing / (angle[1] * angle[1])
    flat = 1 - sampled.sum(-1) - second_slope
    second = sampled[..., 1:2] + second_slope[..., None]
    weights = torch.cat((flat[..., None], sampled[..., :1], second, sampled[..., 2:]), dim=-1)
    return weights.reshape(*shape, nodes)


def tabulated_weights(density: Tensor, *, nodes: int) -> Tensor:
    """Weights of a slope-area density given at the shared slopes 1.. (..., nodes - 1), any scale, >= 0; (..., nodes),
    flat facet 0. [-]
    """
    angle = density.new_tensor(shared_slopes(nodes)[1:])
    mass = density * angle.sin() * gauss_legendre(nodes - 1, density)[1]
    return torch.cat((torch.zeros_like(mass[..., :1]), mass / mass.sum(-1, keepdim=True)), dim=-1)


def gaussian_density(angle: Tensor, sigma: Tensor) -> Tensor:
    """w(theta) of Oren & Nayar 1994, eq. (26), at slope angles (...) for sigma > 0 (...). [1/rad]"""
    ratio = angle / sigma
    return torch.exp(-0.5 * ratio * ratio) * angle.sin() / (sigma * sigma * gaussian_moments(sigma)[0])


def sample_slope(u: Tensor, sigma: Tensor, *, steps: int = 6) -> Tensor:
    """Slope angles distributed as w(theta), from uniform numbers u in [0, 1) (...) and sigma in (0, pi/2] (...). [rad]

    Starts from the closed inverse of exp(-theta^2/2 sigma^2) theta (truncated) and corrects by Newton steps on the
    exact distribution function; sin(theta) / theta changes by 2/pi over the whole range, so the start is never far and
    the steps converge quadratically.
    """
    u, sigma = torch.broadcast_tensors(u, sigma)
    tail = torch.exp(-0.5 * (_QUARTER_TURN / sigma) ** 2)
    angle = sigma * (-2 * torch.log1p(-u * (1 - tail))).sqrt()
    x, weight = gauss_legendre(_MOMENT_NODES, u)
    for _ in range(steps):
        below = angle * (weight * gaussian_density(angle[..., None] * x, sigma[..., None])).sum(-1)
        density = positive(gaussian_density(angle, sigma))
        # A step may not leave the range nor overshoot to 0, where the density vanishes.
        angle = torch.minimum(torch.maximum(angle - (below - u) / density, 0.5 * angle), 0.5 * (angle + _QUARTER_TURN))
    return angle
