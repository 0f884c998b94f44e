"""The He-Torrance model as a module: parameters, parts, energy and sampling."""

import copy
import math
import warnings
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import holds, safe_divide
from torchbrdf.brdf import BRDF, Option
from torchbrdf.directions import Cosines
from torchbrdf.effects import DIRECTIONAL_DIFFUSE, SPECULAR, UNIFORM_DIFFUSE, WAVE_OPTICS
from torchbrdf.fresnel import RELATIVE_INDEX
from torchbrdf.models.he_torrance.energy import NODES, directional_diffuse_albedo
from torchbrdf.models.he_torrance.reflectance import (
    HEIGHT,
    LENGTH,
    WAVELENGTH,
    check_channels,
    check_ratio,
    directional_diffuse,
    unchecked_specular_reflectivity,
    uniform_diffuse,
)
from torchbrdf.models.he_torrance.sampling import (
    directional_diffuse_density,
    directional_diffuse_light,
    directional_diffuse_share,
    facet_width,
    specular_density,
    specular_light,
)
from torchbrdf.models.he_torrance.specular import averaged_specular, averaged_specular_albedo, check_solid_angle
from torchbrdf.parameters import ABSORPTION_INDEX, ALBEDO, Constrained, ParameterValue, fixed, is_per_texel
from torchbrdf.sampling import choose, cosine_hemisphere

# Beyond, a smooth dielectric reflects everything and leaves nothing to a.
_STEEPEST_BOUND = math.radians(85)
_BOUND_ANGLES = 24
# Of the directional-diffuse draws, those from the cosine: they bound the weights where that part is drawn too seldom.
_COSINE_SHARE = 0.1
_EFFECT_OF = {"specular": SPECULAR, "directional_diffuse": DIRECTIONAL_DIFFUSE, "uniform_diffuse": UNIFORM_DIFFUSE}
# Correlation lengths in wavelengths that only a mistake of units makes likely.
_PLAUSIBLE = (0.05, 2000.0)


@final
class HeTorrance(BRDF):
    r"""A rough surface by wave optics, above what reflects uniformly; see `he_torrance` for the equations.

    f_r = specular + directional-diffuse + uniform-diffuse, from the roughness of the surface in wavelengths.

    Args:
        sigma0: rms height, scalar or (...). [length] `fixed(0.0)` is a smooth interface: Fresnel mirror and a/pi.
        tau: autocorrelation length, scalar or (...). [length]
        wavelength: of each channel, scalar or (channel,). [length] All three in one unit. Only their ratios count:
            hold one of them, the wavelength as a rule, `fixed` in a fit.
        eta, k: index eta + i k, each scalar, (channel,) or (..., channel). [-] k is fixed at 0 if not given.
        diffuse: a, what is reflected in all directions alike, scalar, (channel,) or (..., channel). [-] Fixed at 0 if
            not given.
        solid_angle: of source and detector, one cone each. [sr] None keeps the specular part a delta lobe: sampled,
            in `directional_albedo`, not in f_r. A number adds its average over the cones to f_r.
        specular, directional_diffuse, uniform_diffuse: include the part of this name.
        wave_optics: False takes the directional-diffuse part in its limit of geometric optics, facets of which sigma0
            and tau give one width: hold them in a fit. For sigma0 > 0.
    Components: specular (0 where it is a delta lobe), directional_diffuse, uniform_diffuse (those included).
    Raises: ValueError outside the domains, for numbers of channels that differ, when all parts are switched off.
    Warns: UserWarning, at construction, when a exceeds `energy_bound` (parameters per pixel are not looked at), or
        when tau is so far from the wavelength that their units seem to differ.
    Deviations: as `he_torrance`; the first-surface parts themselves reach 1.022 at grazing (perfect reflector).
        Without wave optics f_r cos is off, in the plane of incidence and for sigma0/tau from 0.05 to 0.2, by up to
        0.65 % of its peak at normal incidence, 3.9 % at 60 degrees and 35 % at 80 for sigma0 = 1 wavelength; by up to
        0.43 % at 60 degrees for 3 wavelengths and 0.039 % for 10: as 1/g.
    Source: He, Torrance, Sillion & Greenberg 1991, "A comprehensive physical model for light reflection", DOI
        10.1145/127719.122738, eqs. (4)-(9), (71)-(83).
    """

    PARTS = ("specular", "directional_diffuse", "uniform_diffuse")

    sigma0: Constrained = Constrained(HEIGHT)
    tau: Constrained = Constrained(LENGTH)
    wavelength: Constrained = Constrained(WAVELENGTH)
    eta: Constrained = Constrained(RELATIVE_INDEX)
    k: Constrained = Constrained(ABSORPTION_INDEX)
    diffuse: Constrained = Constrained(ALBEDO)

    def __init__(
        self,
        *,
        sigma0: ParameterValue,
        tau: ParameterValue,
        wavelength: ParameterValue,
        eta: ParameterValue = 1.5,
        k: ParameterValue | None = None,
        diffuse: ParameterValue | None = None,
        solid_angle: float | None = None,
        specular: bool = True,
        directional_diffuse: bool = True,
        uniform_diffuse: bool = True,
        wave_optics: bool = True,
    ):
        super().__init__()
        if not (specular or directional_diffuse or uniform_diffuse):
            raise ValueError("HeTorrance needs specular, directional_diffuse or uniform_diffuse; all are switched off.")
        if solid_angle is not None:
            check_solid_angle("HeTorrance.solid_angle", solid_angle)
        self.sigma0, self.tau, self.wavelength, self.eta = sigma0, tau, wavelength, eta
        nothing = fixed(self.sigma0.new_zeros(()))
        self.k = nothing if k is None else k
        self.diffuse = nothing if diffuse is None else diffuse
        self.solid_angle = solid_angle
        included = (specular, directional_diffuse, uniform_diffuse)
        self.parts = tuple(name for name, there in zip(self.PARTS, included, strict=True) if there)
        self.wave_optics = wave_optics
        if not wave_optics and bool((self.sigma0 == 0).any()):
            raise ValueError(
                "HeTorrance.wave_optics=False needs sigma0 above 0: a surface without height has no facets."
            )
        check_ratio("HeTorrance", sigma0=self.sigma0, tau=self.tau, wavelength=self.wavelength)
        check_channels("HeTorrance", wavelength=self.wavelength, eta=self.eta, k=self.k, diffuse=self.diffuse)
        self._warn_of_units()
        if not is_per_texel(self):
            self._warn_of_energy()

    @property
    def _specular(self) -> bool:
        return "specular" in self.parts

    @property
    def _directional_diffuse(self) -> bool:
        return "directional_diffuse" in self.parts

    @property
    def _uniform_diffuse(self) -> bool:
        return "uniform_diffuse" in self.parts

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        parts = {}
        if self._specular:
            parts["specular"] = self._averaged_specular(cosines)
        if self._directional_diffuse:
            parts["directional_diffuse"] = directional_diffuse(cosines, **self._surface(), wave_optics=self.wave_optics)
        if self._uniform_diffuse:
            parts["uniform_diffuse"] = uniform_diffuse(cosines.light[..., None], self.diffuse)
        return parts

    def stand_ins(self) -> dict[str, list[Option]]:
        """Facets instead of waves, whose lengths are held, and the same surface without one of its parts."""
        groups: dict[str, list[Option]] = {}
        if self._directional_diffuse and self.wave_optics and bool((self.sigma0 > 0).all()):
            facets = copy.deepcopy(self)
            facets.wave_optics = False
            for name, length in self._lengths().items():
                setattr(facets, name, fixed(length.detach()))
            groups[WAVE_OPTICS] = [Option("facets; sigma0 and tau, now one width, are held", (WAVE_OPTICS,), facets)]
        for part in self.parts if len(self.parts) > 1 else ():
            without = copy.deepcopy(self)
            without.parts = tuple(name for name in self.parts if name != part)
            effect = _EFFECT_OF[part]
            groups[effect] = [Option(f"no {effect} part", (effect,), without)]
        return groups

    def specular_reflectivity(self, cos: Tensor) -> Tensor:
        """Reflectance (..., channel) of the specular part at a cosine of incidence (...); see the function. [-]"""
        return unchecked_specular_reflectivity(cos, **self._surface())

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = NODES) -> Tensor:
        """Directional-hemispherical reflectance (..., channel) of the parts included, the delta lobe too. [-]

        Closed form but for the directional-diffuse part, whose quadrature follows its width. For alpha = 2 sigma0/tau
        from 2e-5 to 9 and angles up to 89.9 degrees the error is below 2e-7 with 32 nodes, 1e-4 with 16. A specular
        part of finite solid angle is integrated too: what the horizon cuts of it is missing.
        """
        surface = self._surface_albedo(cos_view, nodes)
        return surface + torch.atleast_1d(self.diffuse) if self._uniform_diffuse else surface

    def diffuse_from_reflectance(self, reflectance: Tensor, *, cos_light: Tensor | None = None) -> Tensor:
        """The a (..., channel) with which light at `cos_light` (...) is reflected to this share in all directions.

        Args:
            reflectance: measured directional-hemispherical reflectance, scalar, (channel,) or (..., channel). [-]
            cos_light: cosine of incidence (...); normal incidence if None.
        Raises: ValueError when the surface alone reflects more, or the result exceeds 1.
        """
        cos = self.sigma0.new_ones(()) if cos_light is None else cos_light
        surface = self._surface_albedo(cos, NODES)
        rest = torch.atleast_1d(reflectance) - surface
        if not holds((rest >= 0) & (rest <= 1)):
            raise ValueError(
                f"HeTorrance.diffuse_from_reflectance: the surface alone reflects {surface.min():.4g} to "
                f"{surface.max():.4g}, which leaves {rest.min():.4g} to {rest.max():.4g} to a; it must lie in [0, 1]."
            )
        return rest

    def energy_bound(self, *, max_angle: float = _STEEPEST_BOUND, nodes: int = NODES // 2) -> Tensor:
        """Largest a (channel,) with which no light up to `max_angle` [rad] is reflected to more than 1. [-]

        1 less the most that the surface alone reflects; negative where that exceeds 1. Towards 90 degrees a smooth
        dielectric reflects everything, and the bound over the whole hemisphere is 0. Nothing enforces it: parameters
        in training may pass it. Raises ValueError for parameters per pixel.
        """
        if is_per_texel(self):
            raise ValueError("HeTorrance.energy_bound is that of one material; some of its parameters are per pixel.")
        with torch.no_grad():
            angle = torch.linspace(0, max_angle, _BOUND_ANGLES, dtype=self.sigma0.dtype, device=self.sigma0.device)
            return 1 - self._surface_albedo(angle.cos(), nodes).amax(0)

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        specular, directed = self._shares(view[..., 2])
        mirrored, u1 = choose(u[..., 0].expand_as(specular + u[..., 0]), specular)
        diffuse, u1 = choose(u1, directed)
        u = torch.stack((u1, u[..., 1].expand_as(u1)), -1)
        along = directional_diffuse_light(view, *self._widths(view[..., 2]), u)
        light = torch.where(diffuse[..., None], along, cosine_hemisphere(u))
        if self.solid_angle is None:
            image = view * view.new_tensor([-1.0, -1.0, 1.0])
            return torch.where(mirrored[..., None], image, light), mirrored
        image = specular_light(view, self.solid_angle, u)
        return torch.where(mirrored[..., None], image, light), torch.zeros_like(mirrored)

    def density(self, cosines: Cosines) -> Tensor:
        specular, directed = self._shares(cosines.view)
        diffuse = directional_diffuse_density(cosines, *self._widths(cosines.view))
        rest = directed * diffuse + (1 - directed) * cosines.light / math.pi
        image = 0.0 if self.solid_angle is None else specular_density(cosines, self.solid_angle)
        return specular * image + (1 - specular) * rest

    def delta_reflectance(self, cosines: Cosines) -> Tensor | None:
        if not self._specular or self.solid_angle is not None:
            return None
        return cosines.zero_below_horizon(self.specular_reflectivity(cosines.view))

    def delta_probability(self, cosines: Cosines) -> Tensor:
        return self._shares(cosines.view)[0] if self.solid_angle is None else torch.zeros_like(cosines.view)

    def _surface(self) -> dict[str, Tensor]:
        return {name: value for name, value in self.material().items() if name != "diffuse"}

    def _lengths(self) -> dict[str, Tensor]:
        return {"sigma0": self.sigma0, "tau": self.tau, "wavelength": self.wavelength}

    def _averaged_specular(self, cosines: Cosines) -> Tensor:
        if self.solid_angle is None:
            return self._dark(cosines.light)
        return averaged_specular(cosines, solid_angle=self.solid_angle, **self._surface())

    def _widths(self, cos: Tensor) -> tuple[Tensor, Tensor]:
        lengths = self._lengths()
        return facet_width(torch.ones_like(cos), **lengths), facet_width(cos, **lengths)

    def _shares(self, cos: Tensor) -> tuple[Tensor, Tensor]:
        """Probability (...) of the specular part, and of the directional-diffuse one among the others, at a cosine."""
        with torch.no_grad():
            surface = self._surface()
            flat = {**surface, "sigma0": torch.zeros_like(self.sigma0)}
            smooth = unchecked_specular_reflectivity(cos, **flat).mean(-1)
            specular = self.specular_reflectivity(cos).mean(-1) * float(self._specular)
            directed = smooth * directional_diffuse_share(cos, **self._lengths()) * float(self._directional_diffuse)
            others = directed + torch.atleast_1d(self.diffuse).mean(-1) * float(self._uniform_diffuse)
            drawn = safe_divide(specular, specular + others, where=specular + others > 0)
            return drawn, (1 - _COSINE_SHARE) * safe_divide(directed, others, where=others > 0)

    def _surface_albedo(self, cos: Tensor, nodes: int) -> Tensor:
        """What the parts of the surface included reflect of light from a cosine (...): (..., channel)."""
        total = self._dark(cos)
        if self._specular and self.solid_angle is None:
            total = total + self.specular_reflectivity(cos)
        elif self._specular and self.solid_angle is not None:
            total = total + averaged_specular_albedo(cos, solid_angle=self.solid_angle, nodes=nodes, **self._surface())
        if self._directional_diffuse:
            total = total + directional_diffuse_albedo(
                cos, nodes=nodes, **self._surface(), wave_optics=self.wave_optics
            )
        return total

    def _dark(self, like: Tensor) -> Tensor:
        """0 (..., channel) for directions (...)."""
        channels = torch.atleast_1d(self.wavelength + self.eta + self.k + self.diffuse)
        return 0 * channels + torch.zeros_like(like)[..., None]

    def _warn_of_energy(self) -> None:
        if not self._uniform_diffuse or bool((self.diffuse == 0).all()):
            return
        bound, a = torch.broadcast_tensors(self.energy_bound(), torch.atleast_1d(self.diffuse).detach())
        worst = int((a - bound).argmax())
        if a[worst] > bound[worst]:
            warnings.warn(
                f"HeTorrance.diffuse = {a[worst]:.4g} exceeds the energy bound {bound[worst]:.4g} (channel {worst}): "
                f"the surface alone reflects up to {1 - bound[worst]:.4g} of the light, together "
                f"{1 - bound[worst] + a[worst]:.4g}.",
                stacklevel=3,
            )

    def _warn_of_units(self) -> None:
        ratio = self.tau.detach()[..., None] / torch.atleast_1d(self.wavelength).detach()
        low, high = _PLAUSIBLE
        if bool(((ratio < low) | (ratio > high)).any()):
            warnings.warn(
                f"HeTorrance.tau is {ratio.min():.4g} to {ratio.max():.4g} wavelengths; expected {low:g} to {high:g}. "
                "sigma0, tau and wavelength must be given in one unit of length.",
                stacklevel=3,
            )
