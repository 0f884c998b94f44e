"""The He-Torrance BRDF and its specular reflectivity as functions of directions and material."""

import math

import torch
from torch import Tensor

from torchbrdf._numerics import holds, safe_sqrt
from torchbrdf.checks import taken_on_trust
from torchbrdf.directions import Cosines
from torchbrdf.fresnel import RELATIVE_INDEX, conductor
from torchbrdf.models.he_torrance.perfect_reflector import (
    Geometry,
    directional_diffuse_of_facets,
    directional_diffuse_of_waves,
    specular_share,
)
from torchbrdf.parameters import ABSORPTION_INDEX, ALBEDO, Interval

# A length that is divided by. Far below any in a sensible unit, far above what squares to 0 in float32.
SHORTEST = 1e-15
HEIGHT = Interval(0.0, math.inf, even=True)
LENGTH = Interval(SHORTEST, math.inf)
WAVELENGTH = Interval(SHORTEST, math.inf, trailing=1)
# Heights and lengths in wavelengths; beyond, their squares and fourth powers overflow in float32.
MOST_WAVELENGTHS = 1e9


def check_surface(name: str, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor, **channels: Tensor) -> None:
    """Raise ValueError unless the lengths lie in their domains and each channel has one entry of everything."""
    HEIGHT.check(f"{name}: sigma0", sigma0)
    LENGTH.check(f"{name}: tau", tau)
    WAVELENGTH.check(f"{name}: wavelength", wavelength)
    for part, domain in (("eta", RELATIVE_INDEX), ("k", ABSORPTION_INDEX), ("diffuse", ALBEDO)):
        if part in channels:
            domain.check(f"{name}: {part}", channels[part])
    check_channels(name, wavelength=wavelength, **channels)
    check_ratio(name, sigma0=sigma0, tau=tau, wavelength=wavelength)


def check_ratio(name: str, *, wavelength: Tensor, **lengths: Tensor) -> None:
    """Raise ValueError for a surface that is too large, in wavelengths, for float32. Not inside `unchecked()`."""
    if taken_on_trust() or not wavelength.numel():
        return
    shortest = wavelength.detach().min()
    for part, length in lengths.items():
        if length.numel() and not holds(length.detach().max() <= MOST_WAVELENGTHS * shortest):
            raise ValueError(
                f"{name}: {part} must be at most {MOST_WAVELENGTHS:.0e} wavelengths; "
                f"found {length.max():.4g} and a wavelength of {shortest:.4g}: the same unit for both?"
            )


def check_channels(name: str, **channels: Tensor) -> None:
    """Raise ValueError unless the last axes (channel) of the parameters agree; single numbers stand for all."""
    counts = {part: value.shape[-1] for part, value in channels.items() if value.ndim}
    if len({count for count in counts.values() if count > 1}) > 1:
        given = ", ".join(f"{part} {count}" for part, count in counts.items())
        raise ValueError(f"{name} needs one entry for each channel of wavelength, eta, k and diffuse; found {given}.")


def he_torrance(
    cosines: Cosines,
    *,
    sigma0: Tensor,
    tau: Tensor,
    wavelength: Tensor,
    eta: Tensor,
    k: Tensor,
    diffuse: Tensor,
) -> Tensor:
    r"""Reflectance of a surface with Gaussian heights and Gaussian correlation, by wave optics, unpolarised.

    .. math::
        f_r = \frac{|F|^2}{\pi} \frac{G S D}{\cos\theta_i \cos\theta_r} + \frac{a}{\pi}, \quad
        D = \frac{\pi^2 \tau^2}{4 \lambda^2} \sum_{m \ge 1} \frac{g^m e^{-g}}{m!\,m} e^{-v_{xy}^2 \tau^2/4m}

    The specular part is a delta lobe and no value of f_r: `specular_reflectivity` is its reflectance.

    Args:
        cosines: of light, view and phase angle, each (...). `Cosines.of(normal, light, view)` makes them.
        sigma0: rms height of the surface, scalar or (...), >= 0. [length]
        tau: distance at which the autocorrelation of heights falls to 1/e, scalar or (...). [length] > 0
        wavelength: of each channel, scalar or (channel,). [length] > 0
            sigma0, tau and wavelength share one unit, whichever; only their ratios count.
        eta, k: real and imaginary part of the index, scalar, (channel,) or (..., channel). [-] >= 0
        diffuse: a, light reflected by anything but the surface itself, as a hemispherical reflectance; scalar,
            (channel,) or (..., channel). [-] in [0, 1]
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when a parameter leaves its domain or the numbers of channels differ.
    Deviations: a/pi, where eq. (72) prints a. G is |h|^4/h_z^2, to which eq. (76) reduces. Shadowing has the
        factor exp(-b^2) of Smith's integral. Single reflection, tangent-plane (Kirchhoff) fields: tau should exceed
        the wavelength. Energy is not exactly conserved: with sigma0 = 0.05, tau = 3, lambda = 0.5 a perfect
        reflector (both parts) returns 1.022 of the light from 86 degrees and 0.44 at 89; nothing is clamped.
    Source: He, Torrance, Sillion & Greenberg 1991, "A comprehensive physical model for light reflection", DOI
        10.1145/127719.122738, eqs. (4)-(9), (71)-(83).
    """
    check_surface("he_torrance", sigma0=sigma0, tau=tau, wavelength=wavelength, eta=eta, k=k, diffuse=diffuse)
    directed = directional_diffuse(cosines, sigma0=sigma0, tau=tau, wavelength=wavelength, eta=eta, k=k)
    return cosines.zero_below_horizon(directed + uniform_diffuse(directed, diffuse))


def directional_diffuse(
    cosines: Cosines,
    *,
    sigma0: Tensor,
    tau: Tensor,
    wavelength: Tensor,
    eta: Tensor,
    k: Tensor,
    wave_optics: bool = True,
) -> Tensor:
    """The directional-diffuse part of `he_torrance` (..., channel), unchecked, arbitrary below the horizon. [1/sr]

    Without `wave_optics` in the limit of geometric optics, see `directional_diffuse_of_facets`.
    """
    geometry = Geometry.of(cosines)
    fresnel = conductor(geometry.local_cos, eta=torch.atleast_1d(eta), k=torch.atleast_1d(k))
    lengths = {"sigma0": sigma0[..., None], "tau": tau[..., None], "wavelength": torch.atleast_1d(wavelength)}
    return fresnel * (directional_diffuse_of_waves if wave_optics else directional_diffuse_of_facets)(
        geometry, **lengths
    )


def uniform_diffuse(like: Tensor, diffuse: Tensor) -> Tensor:
    """a/pi in the shape of a reflectance (..., channel). [1/sr]"""
    return torch.zeros_like(like) + torch.atleast_1d(diffuse) / math.pi


def specular_reflectivity(
    cos: Tensor, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor, eta: Tensor, k: Tensor
) -> Tensor:
    r"""Share of the light that is reflected like in a mirror: the reflectance of the delta lobe.

    .. math:: \rho_s = |F|^2 e^{-g} S, \quad g = (4 \pi \sigma \cos\theta / \lambda)^2

    Args:
        cos: cosine of incidence (...). [-] in (0, 1]
        sigma0, tau, wavelength, eta, k: as `he_torrance`.
    Returns: rho_s (..., channel). [-] Mirrored radiance = rho_s times the radiance of what is mirrored.
    Raises: ValueError when a parameter leaves its domain or the numbers of channels differ.
    Deviations: underflows to 0, gradient included, for g > 87 in float32.
    Source: He et al. 1991 (DOI 10.1145/127719.122738), eqs. (6), (70), (73).
    """
    check_surface("specular_reflectivity", sigma0=sigma0, tau=tau, wavelength=wavelength, eta=eta, k=k)
    return unchecked_specular_reflectivity(cos, sigma0=sigma0, tau=tau, wavelength=wavelength, eta=eta, k=k)


def unchecked_specular_reflectivity(
    cos: Tensor, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor, eta: Tensor, k: Tensor
) -> Tensor:
    """`specular_reflectivity`, unchecked."""
    cos = cos[..., None]
    sin = safe_sqrt((1 - cos) * (1 + cos))
    share = specular_share(
        cos, sin, sigma0=sigma0[..., None], tau=tau[..., None], wavelength=torch.atleast_1d(wavelength)
    )
    return conductor(cos, eta=torch.atleast_1d(eta), k=torch.atleast_1d(k)) * share
