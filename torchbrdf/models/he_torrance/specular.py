r"""The specular part averaged over a finite source and a finite detector: finite, about the mirror direction.

Light from a cone of solid angle dw about a direction is mirrored into an equal cone; a detector accepts another. What
it measures is the share of the two that overlaps. With cones of half-angle alpha, an angle gamma between the detector
and the mirrored light, c = cos(alpha), s = sin(alpha) and q = sin(gamma/2)/s,

.. math::
    \Omega = 4 \Big[\arccos q - c \arccos\frac{c\, q}{\cos(\gamma/2)}\Big], \quad
    \frac{\Omega}{d\omega} = \frac{2}{\pi} \Big[\mathrm{atan2}(\sqrt{1-q^2}, c q)
        - \frac{1}{1-c} \arcsin\frac{(1-c)\, q \sqrt{1-q^2}}{\cos(\gamma/2)}\Big]

The second form is the first without its cancellation: cones of a degree keep all digits.
"""

import math

import torch
from torch import Tensor

from torchbrdf._numerics import safe_sqrt
from torchbrdf.directions import Cosines
from torchbrdf.models.he_torrance.perfect_reflector import Geometry
from torchbrdf.models.he_torrance.reflectance import unchecked_specular_reflectivity
from torchbrdf.quadrature import gauss_legendre

# Solid angles of cones: from one that float32 cannot tell from a delta lobe to a quarter of the hemisphere. [sr]
NARROWEST_CONE, WIDEST_CONE = 1e-9, math.pi / 2


def check_solid_angle(name: str, solid_angle: float) -> None:
    """Raise ValueError for cones that are no cones."""
    if not NARROWEST_CONE <= solid_angle <= WIDEST_CONE:
        raise ValueError(
            f"{name} must lie in [{NARROWEST_CONE:g}, {WIDEST_CONE:.4g}] sr; found {solid_angle}. "
            "None keeps the specular part a delta lobe."
        )


def cone_overlap(half_sine_squared: Tensor, solid_angle: float) -> Tensor:
    """Share (...) of a cone of that solid angle [sr] that an equal cone at angle gamma covers; sin^2(gamma/2) (...).

    1 with zero subgradient at gamma = 0, its kink; 0 from gamma = 2 alpha on. Its slope vanishes there like a root,
    and is right to the root of one rounding error.
    """
    flat = solid_angle / (2 * math.pi)  # 1 - c
    sine_squared = flat * (2 - flat)
    apart = half_sine_squared >= sine_squared
    inside = half_sine_squared.masked_fill(apart, 0.0)
    ratio = inside / sine_squared
    q, edge = safe_sqrt(ratio), safe_sqrt(1 - ratio)
    lune = torch.asin(flat * q * edge / (1 - inside).sqrt()) / flat
    share = 2 / math.pi * (torch.atan2(edge, (1 - flat) * q) - lune)
    return share.masked_fill(apart, 0.0)


def averaged_specular(
    cosines: Cosines,
    *,
    solid_angle: float,
    sigma0: Tensor,
    tau: Tensor,
    wavelength: Tensor,
    eta: Tensor,
    k: Tensor,
) -> Tensor:
    r"""The specular part (..., channel) as measured with source and detector of one solid angle [sr] each. [1/sr]

    .. math:: \frac{\rho_s(\theta)}{\cos\theta\, d\omega} \frac{\Omega(\gamma)}{d\omega}

    rho_s and the cosine are taken halfway between the detector and the mirrored light: the mean of the directions that
    both cones hold, which keeps the average reciprocal. Arbitrary below the horizon, where cones may be cut.
    """
    geometry = Geometry.of(cosines)
    difference = geometry.cos_light - geometry.cos_view
    # the chord between view and mirrored light, over 2, squared
    half_sine_squared = (geometry.planar + difference * difference) / 4
    surface = {"sigma0": sigma0, "tau": tau, "wavelength": wavelength, "eta": eta, "k": k}
    return _averaged(geometry.cos_light + geometry.cos_view, half_sine_squared, solid_angle, surface)


def averaged_specular_albedo(
    cos_view: Tensor,
    *,
    solid_angle: float,
    sigma0: Tensor,
    tau: Tensor,
    wavelength: Tensor,
    eta: Tensor,
    k: Tensor,
    nodes: int,
) -> Tensor:
    """Share of light from `cos_view` (...) that `averaged_specular` returns above the horizon (..., channel). [-]

    `nodes` angles from the mirror direction times as many azimuths, each up to the rim or to the horizon.
    """
    c = cos_view[..., None]
    s = safe_sqrt((1 - c) * (1 + c))
    x, weight = gauss_legendre(nodes, c)
    column = (nodes, *(1,) * c.ndim)
    phi, phi_weight = (math.pi * x).reshape(column), (2 * math.pi * weight).reshape(column)
    x, weight = x.reshape(nodes, 1, *column[1:]), weight.reshape(nodes, 1, *column[1:])
    rim = 2 * math.acos(1 - solid_angle / (2 * math.pi))
    downward = -s * phi.cos()
    end = torch.atan2(c.expand_as(downward), downward).clamp(max=rim)
    gamma = end * x
    cos_light = c * gamma.cos() - downward * gamma.sin()
    surface = {"sigma0": sigma0, "tau": tau, "wavelength": wavelength, "eta": eta, "k": k}
    f = _averaged(c + cos_light, (gamma / 2).sin() ** 2, solid_angle, surface)
    return (f * (cos_light * gamma.sin() * end * weight * phi_weight)).sum((0, 1))


def _averaged(up: Tensor, half_sine_squared: Tensor, solid_angle: float, surface: dict[str, Tensor]) -> Tensor:
    """The averaged specular part from the sum of the cosines and from sin^2(gamma/2), each (..., 1)."""
    share = cone_overlap(half_sine_squared, solid_angle)
    near = share > 0
    halfway = up / 2 / (1 - half_sine_squared.masked_fill(~near, 0.0)).sqrt()
    middle = torch.where(near, halfway, torch.ones_like(up))
    return unchecked_specular_reflectivity(middle[..., 0], **surface) * (share / (middle * solid_angle))
