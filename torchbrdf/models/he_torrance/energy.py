r"""Light that the directional-diffuse part returns in all directions, by quadrature that resolves it.

In the plane of l_xy, cos dw = dx dy, and that part is a function of the distance p from the mirror point -v_xy and of
the polar cosine. Its width in p is that of exp(-t/max(1, g)), which can be far below 1. Around the mirror point, each
ray runs to the rim of the unit disc along p = p0 sinh(a w), w = x(2 - x), with p0 that width: nodes are dense where it
is bright, logarithmic in its tail, and the root at the rim, where the light grazes, becomes smooth. Rays crowd about
the direction across the plane of incidence, where at grazing the rim turns away within an angle of cos(theta).
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import safe_sqrt
from torchbrdf.fresnel import conductor
from torchbrdf.models.he_torrance.perfect_reflector import (
    Geometry,
    directional_diffuse_of_facets,
    directional_diffuse_of_waves,
)
from torchbrdf.quadrature import gauss_legendre

# As many radial nodes as azimuths on each side of the plane across; see `directional_diffuse_albedo` for the errors.
NODES = 32


class _Ray(NamedTuple):
    """Azimuths about the mirror point: cosine to the outward direction and weight, each (azimuth, ..., 1)."""

    cos: Tensor
    weight: Tensor


def directional_diffuse_albedo(
    cos_view: Tensor,
    *,
    sigma0: Tensor,
    tau: Tensor,
    wavelength: Tensor,
    eta: Tensor,
    k: Tensor,
    nodes: int = NODES,
    wave_optics: bool = True,
) -> Tensor:
    """Share of light from `cos_view` (...) in (0, 1] that the directional-diffuse part returns (..., channel). [-]

    `nodes` radii times 2 `nodes` azimuths. sigma0, tau scalar or (...); wavelength, eta, k as `he_torrance`. Without
    `wave_optics` it is that of facets.
    """
    c = cos_view[..., None]
    s = safe_sqrt((1 - c) * (1 + c))
    sigma0, tau, wavelength = sigma0[..., None], tau[..., None], torch.atleast_1d(wavelength)
    x, weight = gauss_legendre(nodes, c)
    column = (-1, *(1,) * (c.ndim + 1))  # radius, azimuth, ..., channel
    x, weight = x.reshape(column), weight.reshape(column)
    ray = _rays(c, nodes)
    # the rim lies where (reach - p)(p + c^2/reach) = 0
    along = s * ray.cos
    root = (c * c + along * along).sqrt()
    reach = torch.where(along > 0, c * c / (along.abs() + root), along.abs() + root)
    width = _width(c, sigma0, tau, wavelength) if wave_optics else 4 * sigma0 * c / tau
    a = torch.asinh(reach / width)
    w = x * (2 - x)
    p = width * torch.sinh(a * w)
    short = 2 * width * torch.cosh(a * (1 + w) / 2) * torch.sinh(a * (1 - x) * (1 - x) / 2)  # reach - p
    cos_light = (short * (p + c * c / reach)).sqrt()
    up = c + cos_light
    planar = p * p
    # l_xy = -v_xy + p: its length without the root at the rim
    sin_light = safe_sqrt(s * s + 2 * along * p + planar)
    geometry = Geometry(cos_light, sin_light, c, s, planar, planar + up * up)
    fresnel = conductor(geometry.local_cos, eta=torch.atleast_1d(eta), k=torch.atleast_1d(k))
    reflectance = directional_diffuse_of_waves if wave_optics else directional_diffuse_of_facets
    f = fresnel * reflectance(geometry, sigma0=sigma0, tau=tau, wavelength=wavelength)
    area = p * (width * torch.cosh(a * w) * a * 2 * (1 - x))
    return (f * (area * weight * ray.weight)).sum((0, 1))


def _rays(c: Tensor, nodes: int) -> _Ray:
    """Both halves of the half circle of azimuths, psi = pi/2 -+ c sinh(b y); the other half mirrors them."""
    y, weight = gauss_legendre(nodes, c)
    column = (-1, *(1,) * c.ndim)
    y, weight = y.reshape(column), weight.reshape(column)
    b = torch.asinh(math.pi / 2 / c)
    offset = c * torch.sinh(b * y)
    weight = 2 * weight * c * b * torch.cosh(b * y)
    sine = offset.sin()
    return _Ray(torch.cat((sine, -sine)), torch.cat((weight, weight)))


def _width(c: Tensor, sigma0: Tensor, tau: Tensor, wavelength: Tensor) -> Tensor:
    """Radius (..., channel) in the plane of l_xy at which the part has fallen to about 1/e, seen from the cosine c."""
    phase = 4 * math.pi / wavelength * sigma0 * c
    return wavelength / (math.pi * tau) * (1 + phase * phase).sqrt()
