"""Microfacet models with Smith masking: GGX and Beckmann, isotropic and anisotropic."""

from typing import Any, ClassVar, final

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF, Option
from torchbrdf.directions import Cosines
from torchbrdf.effects import ANISOTROPY, FRESNEL_VARIATION
from torchbrdf.facets import (
    HalfVector,
    Masking,
    anisotropic_beckmann_distribution,
    anisotropic_ggx_distribution,
    beckmann_distribution,
    beckmann_lambda,
    ggx_distribution,
    ggx_lambda,
    smith_correlated,
)
from torchbrdf.fresnel import Fresnel, Schlick
from torchbrdf.parameters import WIDTH, Constrained, ParameterValue, declared, fixed, kept
from torchbrdf.sampling import mirrored, visible_beckmann_facet, visible_ggx_facet


class _Microfacet(BRDF):
    r"""f_r = F D G / (4 cos_i cos_r), with D, Lambda and the widths of a subclass."""

    fresnel: Fresnel
    masking: Masking

    def distribution(self, half: HalfVector, *widths: Tensor) -> Tensor:
        """D (...). [1/sr]"""
        raise NotImplementedError

    def smith_lambda(self, slope_squared: Tensor) -> Tensor:
        """Lambda (...) at T = (alpha tan(theta))^2. [-]"""
        raise NotImplementedError

    def visible_facet(self, view: Tensor, u: Tensor) -> Tensor:
        """Facet normals (..., 3) in proportion to their area seen along the local view (..., 3)."""
        raise NotImplementedError

    def widths(self) -> tuple[Tensor, ...]:
        """One width, or that along the tangent and that across it, each (...). [-]"""
        raise NotImplementedError

    def slopes_squared(self, cosines: Cosines, *widths: Tensor) -> tuple[Tensor, Tensor]:
        """T of light and of view (...). [-]"""
        raise NotImplementedError

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        half, widths = HalfVector.of(cosines), self.widths()
        lambdas = [self.smith_lambda(t) for t in self.slopes_squared(cosines, *widths)]
        shadowing = self.masking(cosines, half, *lambdas)
        lobe = self.distribution(half, *widths) * shadowing / (4 * cosines.light * cosines.view)
        return {"specular": lobe.unsqueeze(-1) * self.fresnel(half.cos_light)}

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        light = mirrored(view, self.visible_facet(view, u))
        return light, torch.zeros_like(light[..., 0], dtype=torch.bool)

    def density(self, cosines: Cosines) -> Tensor:
        widths = self.widths()
        _, of_view = self.slopes_squared(cosines, *widths)
        seen = 1 / (1 + self.smith_lambda(of_view))
        return self.distribution(HalfVector.of(cosines), *widths) * seen / (4 * cosines.view)

    def stand_ins(self) -> dict[str, list[Option]]:
        """The same facets with one reflectance at every angle."""
        flat = self.fresnel.at_every_angle()
        if flat is None:
            return {}
        widths: dict[str, Any] = {entry.name: kept(self, entry.name) for entry in declared(self)}
        stand_in = type(self)(**widths, fresnel=flat, masking=self.masking)
        return {FRESNEL_VARIATION: [Option("the reflectance of normal incidence", (FRESNEL_VARIATION,), stand_in)]}


class _Isotropic(_Microfacet):
    alpha: Constrained = Constrained(WIDTH)

    def __init__(
        self,
        *,
        alpha: ParameterValue = 0.3,
        fresnel: Fresnel | None = None,
        masking: Masking = smith_correlated,
    ):
        super().__init__()
        self.alpha = alpha
        self.fresnel = Schlick(f0=self.alpha.new_tensor(0.04)) if fresnel is None else fresnel
        self.masking = masking

    def slopes_squared(self, cosines: Cosines, *widths: Tensor) -> tuple[Tensor, Tensor]:
        (alpha,) = widths
        a2, (light, view) = alpha * alpha, cosines.tangents_squared
        return a2 * light, a2 * view

    def widths(self) -> tuple[Tensor]:
        return (self.alpha,)


class _Anisotropic(_Microfacet):
    alpha_x: Constrained = Constrained(WIDTH)
    alpha_y: Constrained = Constrained(WIDTH)
    anisotropic = True
    isotropic: ClassVar[type[_Isotropic]]

    def __init__(
        self,
        *,
        alpha_x: ParameterValue = 0.1,
        alpha_y: ParameterValue = 0.4,
        fresnel: Fresnel | None = None,
        masking: Masking = smith_correlated,
    ):
        super().__init__()
        self.alpha_x = alpha_x
        self.alpha_y = alpha_y
        self.fresnel = Schlick(f0=self.alpha_x.new_tensor(0.04)) if fresnel is None else fresnel
        self.masking = masking

    def slopes_squared(self, cosines: Cosines, *widths: Tensor) -> tuple[Tensor, Tensor]:
        c, plane = cosines, cosines.tangent_plane
        ax, ay = widths
        light = ((ax * plane.light_tangent) ** 2 + (ay * plane.light_bitangent) ** 2) / (c.light * c.light)
        view = ((ax * plane.view_tangent) ** 2 + (ay * plane.view_bitangent) ** 2) / (c.view * c.view)
        return light, view

    def stand_ins(self) -> dict[str, list[Option]]:
        """The isotropic model of the mean width, and one reflectance at every angle."""
        alpha = (self.alpha_x * self.alpha_y).sqrt().detach()
        held = all(isinstance(kept(self, name), fixed) for name in ("alpha_x", "alpha_y"))
        rounded = self.isotropic(alpha=fixed(alpha) if held else alpha, fresnel=self.fresnel, masking=self.masking)
        return {ANISOTROPY: [Option("one width in all azimuths", (ANISOTROPY,), rounded)]} | super().stand_ins()

    def widths(self) -> tuple[Tensor, Tensor]:
        return self.alpha_x, self.alpha_y


@final
class GGX(_Isotropic):
    r"""Mirror-like facets with the long-tailed GGX distribution.

    .. math:: f_r = \frac{F D G_2}{4 \cos\theta_i \cos\theta_r}, \quad G_2 = \frac{1}{1 + \Lambda_i + \Lambda_r}

    with D of `ggx_distribution`, Lambda of `ggx_lambda`.

    Args:
        alpha: width, scalar or (...). [-] in [0.001, 1]; narrower lobes are a `Mirror`.
        fresnel: reflectance of a facet; Schlick (0.04) if not given.
        masking: G_2: smith_correlated, smith_separable or v_cavities.
    Components: specular.
    Deviations: single reflection: at F = 1 and alpha = 0.5 reflects 0.69 of the light at normal incidence.
    Source: Walter, Marschner, Li & Torrance 2007, "Microfacet models for refraction through rough surfaces", DOI
        10.2312/EGWR/EGSR07/195-206, eq. (33); Heitz 2014, "Understanding the masking-shadowing function in
        microfacet-based BRDFs", Journal of Computer Graphics Techniques 3(2), eqs. (72), (99).
    """

    def distribution(self, half: HalfVector, *widths: Tensor) -> Tensor:
        return ggx_distribution(half, alpha=widths[0])

    def smith_lambda(self, slope_squared: Tensor) -> Tensor:
        return ggx_lambda(slope_squared)

    def visible_facet(self, view: Tensor, u: Tensor) -> Tensor:
        return visible_ggx_facet(view, self.alpha, self.alpha, u)


@final
class AnisotropicGGX(_Anisotropic):
    """`GGX` with widths alpha_x along the tangent and alpha_y across it, each scalar or (...). [-] in [0.001, 1]

    Args, components, deviations and source as `GGX`; needs a tangent.
    """

    isotropic = GGX

    def distribution(self, half: HalfVector, *widths: Tensor) -> Tensor:
        return anisotropic_ggx_distribution(half, alpha_x=widths[0], alpha_y=widths[1])

    def smith_lambda(self, slope_squared: Tensor) -> Tensor:
        return ggx_lambda(slope_squared)

    def visible_facet(self, view: Tensor, u: Tensor) -> Tensor:
        return visible_ggx_facet(view, self.alpha_x, self.alpha_y, u)


@final
class Beckmann(_Isotropic):
    r"""Mirror-like facets with Gaussian slopes.

    .. math:: f_r = \frac{F D G_2}{4 \cos\theta_i \cos\theta_r}, \quad G_2 = \frac{1}{1 + \Lambda_i + \Lambda_r}

    with D of `beckmann_distribution`, Lambda of `beckmann_lambda`.

    Args:
        alpha: width, scalar or (...). [-] in [0.001, 1]; sqrt(2) times the rms slope.
        fresnel: reflectance of a facet; Schlick (0.04) if not given.
        masking: G_2: smith_correlated, smith_separable or v_cavities.
    Components: specular.
    Deviations: single reflection: at F = 1 and alpha = 0.5 reflects 0.94 of the light at normal incidence.
    Source: Beckmann & Spizzichino 1963, The Scattering of Electromagnetic Waves from Rough Surfaces; Cook & Torrance
        1982, "A reflectance model for computer graphics", DOI 10.1145/357290.357293; Heitz 2014 (as `GGX`), eq. (99).
    """

    def distribution(self, half: HalfVector, *widths: Tensor) -> Tensor:
        return beckmann_distribution(half, alpha=widths[0])

    def smith_lambda(self, slope_squared: Tensor) -> Tensor:
        return beckmann_lambda(slope_squared)

    def visible_facet(self, view: Tensor, u: Tensor) -> Tensor:
        return visible_beckmann_facet(view, self.alpha, self.alpha, u)


@final
class AnisotropicBeckmann(_Anisotropic):
    """`Beckmann` with widths alpha_x along the tangent and alpha_y across it, each scalar or (...). [-] in [0.001, 1]

    Args, components, deviations and source as `Beckmann`; needs a tangent.
    """

    isotropic = Beckmann

    def distribution(self, half: HalfVector, *widths: Tensor) -> Tensor:
        return anisotropic_beckmann_distribution(half, alpha_x=widths[0], alpha_y=widths[1])

    def smith_lambda(self, slope_squared: Tensor) -> Tensor:
        return beckmann_lambda(slope_squared)

    def visible_facet(self, view: Tensor, u: Tensor) -> Tensor:
        return visible_beckmann_facet(view, self.alpha_x, self.alpha_y, u)
