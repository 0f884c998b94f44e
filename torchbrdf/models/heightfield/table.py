"""The bounces of a surface as a table: a polynomial in the two polar angles for each order, read at any pixel.

A table belongs to one roughness and one occlusion. It is kept for the last few materials that are plain numbers, and
made anew where its derivatives are asked for.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor
from torch.autograd import forward_ad

from torchbrdf._numerics import angle_over_sine
from torchbrdf.directions import Cosines
from torchbrdf.models.heightfield.direct import Quadrature
from torchbrdf.models.heightfield.roughness import rms_slope_from_sigma
from torchbrdf.models.heightfield.slope_frame import tangents
from torchbrdf.models.heightfield.transport import INDEPENDENT_FACETS, Transport, bounce_modes, polar_nodes
from torchbrdf.models.heightfield.visibility import HeightfieldConstants
from torchbrdf.quadrature import gauss_legendre

_PIXELS_AT_A_TIME = 1024


class TableSize(NamedTuple):
    """Nodes of each polar angle, and bounces followed beyond the first."""

    polar: int
    orders: int


def bounce_table(
    sigma: Tensor,
    occlusion: Tensor,
    constants: HeightfieldConstants,
    quadrature: Quadrature,
    size: TableSize,
    *,
    transport: Transport = INDEPENDENT_FACETS,
) -> Tensor:
    """Legendre coefficients (..., polar^2, M orders) in float64 of F_0 and 2 F_m/(sin_i sin_r)^m, n = 2 .. orders + 1.

    Args:
        sigma, occlusion: roughness [rad] and E; of more than one entry, each has a table of its own.
    """
    numbers = _plain(sigma), _plain(occlusion)
    if numbers[0] is None or numbers[1] is None:
        return _table(sigma.double(), occlusion.double(), constants, quadrature, size, transport=transport)
    return kept_table(numbers[0], numbers[1], constants, quadrature, size, transport=transport).to(sigma.device)


def _plain(value: Tensor) -> float | None:
    """The number in a tensor that holds one and whose derivatives are not asked for, else None."""
    if torch.compiler.is_compiling() or value.numel() != 1 or (value.requires_grad and torch.is_grad_enabled()):
        return None
    # A transform of torch.func, of any depth, or a plain dual tensor may ask for derivatives unseen.
    if torch.func.debug_unwrap(value) is not value or forward_ad.unpack_dual(value).tangent is not None:
        return None
    return value.item()


@lru_cache(maxsize=32)
def kept_table(
    sigma: float,
    occlusion: float,
    constants: HeightfieldConstants,
    quadrature: Quadrature,
    size: TableSize,
    *,
    transport: Transport,
) -> Tensor:
    """The table of a material given by numbers, which is kept."""
    with torch.no_grad():
        first, second = (torch.tensor(value, dtype=torch.float64) for value in (sigma, occlusion))
        return _table(first, second, constants, quadrature, size, transport=transport)


def _table(
    sigma: Tensor,
    occlusion: Tensor,
    constants: HeightfieldConstants,
    quadrature: Quadrature,
    size: TableSize,
    *,
    transport: Transport,
) -> Tensor:
    sigma, occlusion = torch.broadcast_tensors(sigma, occlusion)
    slope = rms_slope_from_sigma(sigma)
    modes = bounce_modes(
        slope, occlusion, constants, quadrature, polar=size.polar, orders=size.orders, transport=transport
    ).unbind(-3)
    nodes = polar_nodes(size.polar, slope)
    # F_m vanishes with either sine; what is left is smooth at normal incidence, where dphi has no meaning
    sines = nodes.sin[:, None] * nodes.sin
    turned = [mode * (2 / sines**m) for m, mode in enumerate(modes[1:], 1)]
    modes = torch.stack((modes[0], *turned), -4)  # (..., M, orders, P, P)
    x, weight = gauss_legendre(size.polar, slope)
    rows = legendre(2 * x - 1, size.polar)
    project = rows * weight[:, None] * (2 * torch.arange(size.polar, dtype=x.dtype, device=x.device) + 1)
    coefficients = project.mT @ modes @ project
    return coefficients.flatten(-2).flatten(-3, -2).mT


def legendre(x: Tensor, count: int) -> Tensor:
    """P_0 .. P_(count-1) at x (...): (..., count)."""
    rows = [torch.ones_like(x), x]
    for n in range(1, count - 1):
        rows.append(((2 * n + 1) * x * rows[-1] - n * rows[-2]) / (n + 1))
    return torch.stack(rows[:count], -1)


def read_table(cosines: Cosines, table: Tensor, size: TableSize) -> Tensor:
    """F_n (..., orders) [1/sr] at directions (...), of a table (..., polar^2, M orders)."""
    table = table.to(cosines.light.dtype)
    shape = torch.broadcast_shapes(cosines.light.shape, table.shape[:-2])
    both = zip(tangents(cosines), (cosines.light, cosines.view), strict=True)
    angles = [tangent * cosine * angle_over_sine(cosine) for tangent, cosine in both]
    sines_squared = (1 - cosines.light * cosines.light) * (1 - cosines.view * cosines.view)
    fields = torch.stack((*angles, cosines.in_plane, sines_squared))
    if table.ndim > 2 or torch.compiler.is_compiling() or shape.numel() <= _PIXELS_AT_A_TIME:
        return _read(fields, table, size)
    pieces = fields.flatten(1).split(_PIXELS_AT_A_TIME, 1)
    return torch.cat([_read(piece, table, size) for piece in pieces]).unflatten(0, shape)


def _read(fields: Tensor, table: Tensor, size: TableSize) -> Tensor:
    theta_light, theta_view, in_plane, sines_squared = fields
    light, view = (legendre(theta * (4 / math.pi) - 1, size.polar) for theta in (theta_light, theta_view))
    products = (light[..., :, None] * view[..., None, :]).flatten(-2)
    if table.ndim == 2:
        orders = products @ table
    else:
        orders = (products[..., None, :] @ table)[..., 0, :]
    flat, *turned = orders.split(size.orders, -1)
    # (sin_i sin_r)^m cos(m dphi), by the recurrence of the cosines
    last, wave = torch.ones_like(in_plane), in_plane
    for mode in turned:
        flat = flat + wave[..., None] * mode
        last, wave = wave, 2 * in_plane * wave - sines_squared * last
    return flat
