r"""Polarised light: the Jones matrix of the local reflection, written without the frames that vanish in it.

A facet that mirrors light into view reflects s and p light of its own plane of incidence, which differs from the s and
p of the mean surface, He et al. 1991, eq. (84). Their eqs. (59)-(68) turn one into the other and divide by
|k_r x k_i|^4, which is 0 in retro-reflection.

The same matrix in space, with k_i = -light, k_r = view, x = k_i . k_r, u = light x view, U = [u]_x,

.. math::
    J = \frac P2 [c c^T + (x k_r - k_i)(k_r - x k_i)^T] + \frac Q2 \Big[1 + U + \frac{U^2}{1 - x}\Big], \quad
    c = k_i \times k_r, \quad P = \frac{F_s}{2 c_d^2 (c_d q + s_d^2)}, \quad Q = \frac{2 c_d q F_s}{c_d q + s_d^2}

is regular everywhere; c_d, s_d are cosine and sine of the local angle of incidence.
Source: He, Torrance, Sillion & Greenberg 1991, "A comprehensive physical model for light reflection", DOI
    10.1145/127719.122738, eqs. (34), (59)-(68), (84)-(86).
"""

import math

import torch
from torch import Tensor

from torchbrdf._numerics import cross, dot, horizon, safe_sqrt
from torchbrdf.directions import Cosines, any_tangent, orthonormal_tangent
from torchbrdf.fresnel import conductor_amplitudes, refracted_cosine
from torchbrdf.models.he_torrance.perfect_reflector import Geometry, directional_diffuse_of_waves, specular_share
from torchbrdf.models.he_torrance.reflectance import check_surface


def unpolarised(like: Tensor) -> Tensor:
    """Coherency (2, 2) of unpolarised light of unit irradiance, complex, in the precision of `like`."""
    return torch.eye(2, dtype=like.dtype, device=like.device).to(like.dtype.to_complex()) / 2


def coherency(jones: Tensor) -> Tensor:
    """Coherency (..., 2, 2) of fully polarised light with complex amplitudes (..., 2) along s and p: c c^H."""
    return jones[..., :, None] * jones[..., None, :].conj()


def he_torrance_polarised(
    normal: Tensor,
    light: Tensor,
    view: Tensor,
    *,
    sigma0: Tensor,
    tau: Tensor,
    wavelength: Tensor,
    eta: Tensor,
    k: Tensor,
    diffuse: Tensor,
    incident: Tensor | None = None,
    tangent: Tensor | None = None,
) -> Tensor:
    r"""`he_torrance` for light of any polarisation.

    .. math::
        C_{out} = \frac{G S D}{\pi \cos\theta_i \cos\theta_r} J C_{in} J^H + \frac{a}{2\pi} (\mathrm{tr}\, C_{in})\, 1

    Args:
        normal, light, view: unit vectors (..., 3) that leave the surface.
        sigma0, tau, wavelength, eta, k, diffuse: as `he_torrance`.
        incident: coherency (..., 2, 2) of the light in its frame (s, p), complex, of unit trace where it stands for
            unit irradiance; unpolarised if None. `coherency` makes it of two amplitudes. It has no channel axis.
        tangent: direction (..., 3) along the surface that stands for the azimuth of a light or view along the normal,
            whose s and p have no meaning of their own; an arbitrary one if None.
    Returns: coherency (..., channel, 2, 2) of the reflected light in its frame (s, p), complex, per unit irradiance.
        [1/sr] Its diagonal is the s part and the p part, its trace f_r. Zero below the horizon.
        Frames: s = direction of propagation x normal, p = s x direction of propagation.
    Raises: what `Cosines.of` and `he_torrance` raise.
    Deviations: as `he_torrance`. The uniform-diffuse part leaves unpolarised, half s and half p.
    Source: He et al. 1991 (DOI 10.1145/127719.122738), eqs. (59)-(68), with the signs of (63), (64) repaired.
    """
    check_surface("he_torrance_polarised", sigma0=sigma0, tau=tau, wavelength=wavelength, eta=eta, k=k, diffuse=diffuse)
    cosines = Cosines.of(normal, light, view)
    geometry = Geometry.of(cosines)
    surface = {"sigma0": sigma0[..., None], "tau": tau[..., None], "wavelength": torch.atleast_1d(wavelength)}
    base = directional_diffuse_of_waves(geometry, **surface)
    state = unpolarised(base) if incident is None else incident
    jones = jones_matrix(normal, light, view, geometry, eta=eta, k=k, tangent=tangent)
    received = state[..., None, :, :]
    directed = base[..., None, None] * (jones @ received @ jones.mH)
    power = received.diagonal(dim1=-2, dim2=-1).sum(-1).real
    uniform = torch.atleast_1d(diffuse) / math.pi * power
    total = directed + uniform[..., None, None] * unpolarised(base)
    return total.masked_fill(~cosines.above_horizon[..., None, None, None], 0.0)


def polarised_specular_reflectivity(
    cos: Tensor,
    *,
    sigma0: Tensor,
    tau: Tensor,
    wavelength: Tensor,
    eta: Tensor,
    k: Tensor,
    incident: Tensor | None = None,
) -> Tensor:
    """`specular_reflectivity` for light of any polarisation: coherency (..., channel, 2, 2) of the mirrored light. [-]

    Args: cos (...) as `specular_reflectivity`; incident (..., 2, 2) as `he_torrance_polarised`.
    Source: He et al. 1991 (DOI 10.1145/127719.122738), eqs. (59), (73); J = diag(F_s, F_p).
    """
    check_surface("polarised_specular_reflectivity", sigma0=sigma0, tau=tau, wavelength=wavelength, eta=eta, k=k)
    c = cos[..., None]
    share = specular_share(
        c,
        safe_sqrt((1 - c) * (1 + c)),
        sigma0=sigma0[..., None],
        tau=tau[..., None],
        wavelength=torch.atleast_1d(wavelength),
    )
    amplitudes = conductor_amplitudes(c, eta=torch.atleast_1d(eta), k=torch.atleast_1d(k))
    jones = torch.stack(torch.broadcast_tensors(*amplitudes), -1)
    state = (unpolarised(share) if incident is None else incident)[..., None, :, :]
    return share[..., None, None] * coherency(jones) * state


def jones_matrix(
    normal: Tensor,
    light: Tensor,
    view: Tensor,
    geometry: Geometry,
    *,
    eta: Tensor,
    k: Tensor,
    tangent: Tensor | None = None,
) -> Tensor:
    """J (..., channel, 2, 2), complex: amplitudes out (s, p) from amplitudes in (s, p), for vectors (..., 3). [-]

    Finite but arbitrary below the horizon.
    """
    normal, light, view = torch.broadcast_tensors(normal, light, view)
    tangent = any_tangent(normal) if tangent is None else orthonormal_tangent(normal, tangent)
    s_in, p_in = _frame(normal, -light, tangent, -1.0)
    s_out, p_out = _frame(normal, view, tangent, 1.0)
    x, u = -dot(light, view), cross(light, view)
    length = dot(u, u)
    apart = geometry.squared[..., 0] / 2  # 1 - x, with the digits that the sum loses at grazing
    turned, spread = [], []
    for e_out in (s_out, p_out):
        for e_in in (s_in, p_in):
            turned.append(dot(e_out, u) * dot(u, e_in) + dot(e_out, light) * dot(view, e_in))
            bent = dot(e_out, u) * dot(u, e_in) - length * dot(e_out, e_in)
            spread.append(dot(e_out, e_in) + dot(e_out, cross(u, e_in)) + bent / apart)
    cos = geometry.local_cos
    sine_squared = ((1 - cos) * (1 + cos)).relu()
    q = refracted_cosine(cos, torch.atleast_1d(eta), torch.atleast_1d(k))
    f_s = (cos - q) / (cos + q)
    mixed = f_s / (cos * q + sine_squared)
    p_half, q_half = mixed / (4 * cos * cos), cos * q * mixed
    shape = (*x.shape, 1, 2, 2)
    m1, m2 = (torch.stack(m, -1).reshape(shape) for m in (turned, spread))
    return p_half[..., None, None] * m1 + q_half[..., None, None] * m2


def _frame(normal: Tensor, propagation: Tensor, tangent: Tensor, sign: float) -> tuple[Tensor, Tensor]:
    """s and p (..., 3) of light that travels along `propagation`; `sign` is -1 where it travels to the surface."""
    across = cross(propagation, normal)
    squared = dot(across, across)
    # below the rounding of the vectors themselves the azimuth is noise
    upright = squared <= horizon(squared.dtype) ** 2
    fallback = sign * cross(tangent, normal)
    length = squared.masked_fill(upright, 1.0).sqrt()
    s = torch.where(upright[..., None], fallback, across / length[..., None])
    return s, cross(s, propagation)
