r"""Slope-area distributions: weights on fixed slope angles, moments and samples.

A rough surface is a weighted sum of single slopes: f = sum_k w_k f(theta_k). The angles are the same for all materials,
so that what depends on the geometry is computed once, and the weights are all that the roughness changes. Node 0 is the
flat facet: it makes sigma = 0 exactly Lambert. No weight is negative: a sum of reflectances is none either.

A direction at theta starts to be cut where theta_k = 90 deg - theta, and beyond it everything varies with the ratio of
theta_k to that angle. So the angles follow a geometric sequence from what a grazing direction on a nearly flat surface
asks for to where the steep slopes ask for equal distances, and thicken once more next to 90 degrees, where the Gaussian
ends abruptly.

Gaussian slopes, Oren & Nayar 1994, eq. (26), normalised for azimuth *means*:
    w(theta) = exp(-theta^2 / 2 sigma^2) sin(theta) / Z(sigma) on [0, pi/2].
sigma is the width of the truncated polar Gaussian, not the standard deviation of theta (for small sigma,
E[theta^2] = 2 sigma^2).
Source: Oren & Nayar 1994, "Generalization of Lambert's reflectance model", DOI 10.1145/192161.192213, long version
    (1995, DOI 10.1007/BF01679684), eqs. (25), (26); `docs/equations/oren_nayar.md`, section 6, for the normalisation.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._constants import constant
from torchbrdf._numerics import positive, quiet_width, sinc
from torchbrdf.quadrature import gauss_legendre, gauss_legendre_rule

_QUARTER_TURN = 0.5 * math.pi
_MOMENT_NODES = 64  # the moments are integrals of an analytic function over at most 9 standard deviations
_MOMENT_WIDTH = 9.0  # exp(-81/2) is below the rounding of float64
# Angles below this are equidistant, those above geometric: [rad] a node, so that many nodes, which are close anyway,
# do not crowd where nothing happens before 89.95 degrees.
_KNEE_A_NODE = 8e-5
_LARGEST_STEP = 0.62  # of asinh(angle / knee) near the flat facet; a Gaussian sampled that far apart loses 1e-3


class _Slopes(NamedTuple):
    """Angles above the flat facet, ascending [rad], and what each stands for of an integral over the angle [rad]."""

    angles: tuple[float, ...]
    widths: tuple[float, ...]


@constant
@lru_cache(maxsize=32)
def _slopes(count: int) -> _Slopes:
    """theta = c sinh(y) with y the upper half of the Gauss-Legendre nodes of (-Y, Y): equidistant at 0."""
    steps = count - 1
    knee = max(_KNEE_A_NODE * count, _QUARTER_TURN / math.sinh(_LARGEST_STEP * steps / _QUARTER_TURN))
    top = math.asinh(_QUARTER_TURN / knee)
    nodes, weights = (row[steps + 1 :] for row in gauss_legendre_rule(2 * steps + 1))
    y = [top * (2 * node - 1) for node in nodes]
    widths = [2 * top * weight * knee * math.cosh(at) for weight, at in zip(weights, y, strict=True)]
    return _Slopes(tuple(knee * math.sinh(at) for at in y), tuple(widths))


def shared_slopes(count: int) -> tuple[float, ...]:
    """The `count` shared slope angles, ascending from 0: dense next to the flat facet, and a little below 90 deg.
    [rad]
    """
    if count < 3:
        raise ValueError(f"nodes must be at least 3 (the flat facet and two slopes); found {count}.")
    return (0.0, *_slopes(count).angles)


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
    r"""Weights of the shared slopes for Gaussian roughness; none is negative.

    Above the first slope the Gaussian is sampled, and the sum normalised; the flat facet stands for theta_1^2/12 of
    theta d(theta), what the trapezoidal rule leaves out at a root that is simple (Euler-Maclaurin). Below it, what the
    samples miss of the moments of 1 and theta^2 goes to the flat facet and to the first slope, and for sigma -> 0 the
    sum becomes the expansion f(0) + E[theta^2] f''(0)/2. About sigma = theta_1 both agree, and one passes into the
    other smoothly.

    Args: sigma (...) in [0, pi/2]. [rad]
    Returns: (..., nodes), sums to 1; (1, 0, 0, ...) at sigma = 0, with zero derivative there. [-]
    """
    # At least 1-D inside: forward differentiation of "number * 0-d float32 tensor" yields float64.
    shape, sigma = sigma.shape, torch.atleast_1d(sigma)
    angle = sigma.new_tensor(shared_slopes(nodes)[1:])
    first = angle[0]
    # Far below the first slope every Gaussian value underflows to 0: the clamp changes no value and no derivative.
    wide = sigma.clamp(min=shared_slopes(nodes)[1] / (2 * quiet_width(sigma.dtype)))[..., None]
    ratio = angle / wide
    mass = sigma.new_tensor(_slopes(nodes).widths) * angle.sin() * torch.exp(-0.5 * ratio * ratio)
    sampled = torch.cat((first * first / 12 + 0 * wide, mass), dim=-1)
    sampled = sampled / sampled.sum(-1, keepdim=True)

    scaled_total, second = gaussian_moments(sigma)
    share = mass / (wide * wide * scaled_total[..., None])
    bent = (sigma * sigma * second - (share * angle * angle).sum(-1))[..., None] / (first * first)
    expanded = torch.cat((1 - share.sum(-1, keepdim=True) - bent, share[..., :1] + bent, share[..., 1:]), dim=-1)

    narrow = torch.exp(-((sigma / first).square().square()))[..., None]
    return (narrow * expanded + (1 - narrow) * sampled).reshape(*shape, nodes)


def tabulated_weights(density: Tensor, *, nodes: int) -> Tensor:
    """Weights of a slope-area density given at the shared slopes 1.. (..., nodes - 1), any scale, >= 0; (..., nodes).
    The flat facet stands for what lies below the first slope, as in `gaussian_weights`. [-]
    """
    angle = density.new_tensor(shared_slopes(nodes)[1:])
    mass = density * angle.sin() * density.new_tensor(_slopes(nodes).widths)
    mass = torch.cat((density[..., :1] * (angle[0] * angle[0] / 12), mass), dim=-1)
    return mass / mass.sum(-1, keepdim=True)


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
