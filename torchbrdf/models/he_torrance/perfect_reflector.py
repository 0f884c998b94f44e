r"""The two parts of the first-surface reflection without their Fresnel factor: specular and directional diffuse.

All lengths in one unit. h = light + view is not normalised, k = 2 pi/lambda,

.. math::
    g = [k \sigma (\cos\theta_i + \cos\theta_r)]^2, \quad t = \tfrac14 k^2 \tau^2 |h_{xy}|^2, \quad
    S(g, t) = \sum_{m \ge 1} \frac{g^m e^{-g}}{m!\, m} e^{-t/m}
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import components, cross_of, dot_of, in_pieces, root, safe_divide, sine
from torchbrdf.directions import Cosines
from torchbrdf.facets import HalfVector
from torchbrdf.models.he_torrance.roughness import effective_roughness
from torchbrdf.models.he_torrance.series import series_over_g
from torchbrdf.models.he_torrance.shadowing import shadowing


class Geometry(NamedTuple):
    """What the directional-diffuse part reads of the directions, each (..., 1), broadcast with (channel,). [-]

    Attributes:
        cos_light, sin_light, cos_view, sin_view: of the polar angles.
        planar: squared length of the part of h in the mean surface, 0 in the mirror direction.
        squared: |h|^2 = 4 cos^2 of the local angle of incidence.
    """

    cos_light: Tensor
    sin_light: Tensor
    cos_view: Tensor
    sin_view: Tensor
    planar: Tensor
    squared: Tensor

    @classmethod
    def of(cls, cosines: Cosines) -> "Geometry":
        half = HalfVector.of(cosines)
        squared = 4 * half.cos_light * half.cos_light
        sines = _sines(cosines)
        parts = (cosines.light, sines[0], cosines.view, sines[1], half.sine_squared * squared, squared)
        return cls(*(part[..., None] for part in torch.broadcast_tensors(*parts)))

    @property
    def local_cos(self) -> Tensor:
        """Cosine of incidence on the facets that mirror light into view."""
        return self.squared.sqrt() / 2


def _sines(cosines: Cosines) -> tuple[Tensor, Tensor]:
    """Sines of both polar angles (...), from the vectors where they are known; zero gradient at normal incidence."""
    if cosines.vectors is None:
        return sine(cosines.light), sine(cosines.view)
    light, view = in_pieces(_sines_squared, *cosines.vectors, own=1)
    return root(light * cosines.lit), root(view * cosines.lit)


def _sines_squared(normal: Tensor, light: Tensor, view: Tensor) -> tuple[Tensor, Tensor]:
    """Squared sines of light and view to the normal (...)."""
    n = components(normal)
    across_light, across_view = cross_of(n, components(light)), cross_of(n, components(view))
    return dot_of(across_light, across_light), dot_of(across_view, across_view)


def directional_diffuse_of_waves(geometry: Geometry, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor) -> Tensor:
    r"""Directional-diffuse part of a perfect reflector (..., channel). [1/sr]

    .. math::
        \frac{G S D}{\pi c_i c_r} = \frac{|h|^4}{\pi} \Big(\frac{\pi^2 \sigma \tau}{\lambda^2}\Big)^2
        \frac{S(g, t)}{g}\, \frac{S_1(\theta_i)}{c_i} \frac{S_1(\theta_r)}{c_r}

    with G = |h|^4/h_z^2 and D of He et al. 1991, eqs. (76), (78). In this order of factors nothing overflows at
    grazing, in retro-reflection or at normal incidence.

    Args: sigma0, tau (..., 1), wavelength (channel,), one unit of length.
    """
    light = shadowing(geometry.cos_light, geometry.sin_light, sigma0=sigma0, tau=tau)
    view = shadowing(geometry.cos_view, geometry.sin_view, sigma0=sigma0, tau=tau)
    sigma = sigma0 * effective_roughness(light.k + view.k)
    phase = 2 * math.pi / wavelength * sigma * (geometry.cos_light + geometry.cos_view)
    spread = math.pi / wavelength * tau
    # g and t as (..., channel) alike, so that the series sees one shape
    g, t = torch.broadcast_tensors(phase * phase, spread * spread * geometry.planar)
    strength = math.pi**2 / wavelength * sigma * (tau / wavelength) * geometry.squared
    return strength * strength * series_over_g(g, t) * light.over_cos * view.over_cos / math.pi


def directional_diffuse_of_facets(geometry: Geometry, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor) -> Tensor:
    r"""Its limit of geometric optics, g -> infinity (..., channel): mirror facets. [1/sr]

    .. math::
        \frac{1}{\pi} \Big(\frac{\tau |h|^2}{4 \sigma h_z^2}\Big)^2 e^{-(\tau/2\sigma)^2 |h_{xy}|^2/h_z^2}\,
        \frac{S_1(\theta_i)}{c_i} \frac{S_1(\theta_r)}{c_r}

    Beckmann's distribution of width 2 sigma/tau, from S(g, t) -> exp(-t/g)/g; the error is that of the first term left
    out, (1 - 2 t/g + (t/g)^2/2)/g. Of the wavelength only the shape is read. 0 for a surface without height.
    """
    light = shadowing(geometry.cos_light, geometry.sin_light, sigma0=sigma0, tau=tau)
    view = shadowing(geometry.cos_view, geometry.sin_view, sigma0=sigma0, tau=tau)
    height = 2 * sigma0 * effective_roughness(light.k + view.k) * (geometry.cos_light + geometry.cos_view)
    steepness = safe_divide(tau.expand_as(height), height, where=height > 0)  # of facets of slope 1, over their spread
    up = geometry.cos_light + geometry.cos_view
    strength = safe_divide(steepness * geometry.squared, 2 * up, where=(up > 0).expand_as(steepness))
    spread = (-steepness * steepness * geometry.planar).exp()
    f = strength * strength * spread * light.over_cos * view.over_cos / math.pi
    return f + torch.zeros_like(wavelength)


def specular_share(cos: Tensor, sin: Tensor, *, sigma0: Tensor, tau: Tensor, wavelength: Tensor) -> Tensor:
    r"""Share :math:`e^{-g} S` of the light that a perfect reflector sends in the mirror direction (..., channel). [-]

    Args: cos, sin of incidence (..., 1); sigma0, tau (..., 1), wavelength (channel,), one unit of length.
    """
    seen = shadowing(cos, sin, sigma0=sigma0, tau=tau)
    phase = 4 * math.pi / wavelength * sigma0 * effective_roughness(2 * seen.k) * cos
    return (-phase * phase).exp() * seen.visibility * seen.visibility
