"""Ashikhmin and Shirley's anisotropic Phong model: a brushed highlight over a matte body."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import log_cosine_over_sine_squared, safe_sqrt
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.facets import HalfVector
from torchbrdf.fresnel import fifth_power, schlick
from torchbrdf.parameters import ALBEDO, EXPONENT, Constrained, ParameterValue
from torchbrdf.sampling import choose, cosine_hemisphere, mirrored


def half_vector_density(half: HalfVector, *, exponent_x: Tensor, exponent_y: Tensor) -> Tensor:
    r"""Density of half vectors, :math:`\frac{\sqrt{(n_x + 1)(n_y + 1)}}{2\pi} (n \cdot h)^{e}` (...). [1/sr]

    With :math:`e = (n_x h_x^2 + n_y h_y^2)/(1 - h_z^2)`; 1 at h = n, where e is undefined.

    Args:
        exponent_x, exponent_y: along the tangent and across it (...). [-] >= 0
    Raises: ValueError without a tangent.
    """
    if half.tangent is None or half.bitangent is None:
        raise ValueError("Ashikhmin-Shirley needs a tangent: pass tangent=... to Cosines.of.")
    weighted = exponent_x * half.tangent**2 + exponent_y * half.bitangent**2
    power = (weighted * log_cosine_over_sine_squared(half.cos, half.sine_squared)).exp()
    return ((exponent_x + 1) * (exponent_y + 1)).sqrt() / (2 * math.pi) * power


@final
class AshikhminShirley(BRDF):
    r"""Anisotropic highlight with Schlick's Fresnel reflectance over a matte body; needs a tangent.

    .. math::
        f_s = \frac{\sqrt{(n_x + 1)(n_y + 1)}}{8 \pi}
              \frac{(n \cdot h)^{e} F(v \cdot h)}{(v \cdot h) \max(\cos\theta_i, \cos\theta_r)}, \quad
        f_d = \frac{28 \rho_d}{23 \pi} (1 - \rho_s)
              [1 - (1 - \tfrac12\cos\theta_i)^5][1 - (1 - \tfrac12\cos\theta_r)^5]

    with e of `half_vector_density`.

    Args:
        diffuse: rho_d, scalar, (channel,) or (..., channel). [-] in [0, 1]
        specular: rho_s, reflectance at normal incidence, likewise. [-] in [0, 1]
        exponent_x, exponent_y: along the tangent and across it, scalar or (...). [-] >= 0
    Components: diffuse, specular.
    Deviations: loses energy: with F = 1 the specular albedo is 0.25 (n = 1) to 0.996 (n = 1000) at normal
        incidence, about half at grazing.
    Source: Ashikhmin & Shirley 2000, "An anisotropic Phong BRDF model", DOI 10.1080/10867651.2000.10487522; Shirley &
        Marschner 2009, Fundamentals of Computer Graphics, 3rd edition, eqs. (25.4)-(25.7).
    """

    diffuse: Constrained = Constrained(ALBEDO)
    specular: Constrained = Constrained(ALBEDO)
    exponent_x: Constrained = Constrained(EXPONENT)
    exponent_y: Constrained = Constrained(EXPONENT)
    anisotropic = True

    def __init__(
        self,
        *,
        diffuse: ParameterValue = 0.5,
        specular: ParameterValue = 0.05,
        exponent_x: ParameterValue = 10.0,
        exponent_y: ParameterValue = 100.0,
    ):
        super().__init__()
        self.diffuse = diffuse
        self.specular = specular
        self.exponent_x = exponent_x
        self.exponent_y = exponent_y

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        diffuse, specular = torch.atleast_1d(self.diffuse), torch.atleast_1d(self.specular)
        half = HalfVector.of(cosines)
        lobe = self._half_density(half) / (4 * half.cos_light * cosines.beta)
        through = _through(cosines.light) * _through(cosines.view)
        return {
            "diffuse": 28 / (23 * math.pi) * diffuse * (1 - specular) * through[..., None],
            "specular": lobe[..., None] * schlick(half.cos_light[..., None], f0=specular),
        }

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        share = self._share(view[..., 2])
        glossy, u1 = choose(u[..., 0].expand_as(share + u[..., 0]), share)
        u2 = u[..., 1].expand_as(u1)
        quadrant = (4 * u1).floor()
        t = 4 * u1 - quadrant
        odd = quadrant % 2 == 1
        t = torch.where(odd, 1 - t, t)  # runs backwards in every other quadrant, so that phi is continuous in u1
        nx, ny = self.exponent_x, self.exponent_y
        x = (math.pi / 2 * t).cos() * (ny + 1).sqrt()
        y = (math.pi / 2 * t).sin() * (nx + 1).sqrt()
        length = torch.hypot(x, y)
        cos, sin = x / length, y / length
        exponent = nx * cos * cos + ny * sin * sin
        z = (1 - u2) ** (1 / (exponent + 1))
        sine = safe_sqrt((1 - z) * (1 + z))
        left, down = (quadrant == 1) | (quadrant == 2), quadrant >= 2
        facet = torch.stack((torch.where(left, -cos, cos) * sine, torch.where(down, -sin, sin) * sine, z), -1)
        light = torch.where(glossy[..., None], mirrored(view, facet), cosine_hemisphere(torch.stack((u1, u2), -1)))
        # a half vector that faces away from the view mirrors it through the surface
        hidden = glossy & ((facet * view).sum(-1) <= 0)
        down_vector = view.new_tensor([0.0, 0.0, -1.0])
        return torch.where(hidden[..., None], down_vector, light), torch.zeros_like(glossy)

    def density(self, cosines: Cosines) -> Tensor:
        half = HalfVector.of(cosines)
        share = self._share(cosines.view)
        return share * self._half_density(half) / (4 * half.cos_light) + (1 - share) * cosines.light / math.pi

    def _half_density(self, half: HalfVector) -> Tensor:
        return half_vector_density(half, exponent_x=self.exponent_x, exponent_y=self.exponent_y)

    def _share(self, cos_view: Tensor) -> Tensor:
        """Of the highlight, by albedo: what is left of it at grazing is about F/2 (...)."""
        diffuse, specular = torch.atleast_1d(self.diffuse), torch.atleast_1d(self.specular)
        mirrored_part = schlick(cos_view[..., None], f0=specular).mean(-1)
        body = (diffuse * (1 - specular) * _through(cos_view)[..., None]).mean(-1)
        return (mirrored_part / (mirrored_part + body)).detach()


def _through(cos: Tensor) -> Tensor:
    return 1 - fifth_power(1 - cos / 2)
