"""The He-Torrance model as a module: parameters, parts, energy and sampling."""

import math
import warnings
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import holds, safe_divide
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.fresnel import RELATIVE_INDEX
from torchbrdf.models.he_torrance.energy import NODES, lobe_albedo
from torchbrdf.models.he_torrance.functional import (
    HEIGHT,
    LENGTH,
    WAVELENGTH,
    check_channels,
    directional_diffuse,
    mirror_reflectance,
    uniform_diffuse,
)
from torchbrdf.models.he_torrance.sampling import (
    facet_width,
    lobe_density,
    lobe_light,
    lobe_share,
    spike_density,
    spike_light,
)
from torchbrdf.models.he_torrance.spike import averaged_spike, check_solid_angle, spike_albedo
from torchbrdf.parameters import ABSORPTION_INDEX, ALBEDO, Constrained, ParameterValue, fixed, is_per_texel
from torchbrdf.sampling import choose, cosine_hemisphere

# Beyond, a smooth dielectric reflects everything and leaves nothing to a.
_STEEPEST_BOUND = math.radians(85)
_BOUND_ANGLES = 24
# Of the draws of the lobe, those from the cosine: they bound the weights where the lobe is drawn too seldom.
_COSINE_SHARE = 0.1
# Correlation lengths in wavelengths that only a mistake of units makes likely.
_PLAUSIBLE = (0.05, 2000.0)


@final
class HeTorrance(BRDF):
    r"""A rough surface by wave optics, above a body that reflects uniformly; see `he_torrance` for the equations.

    f_r = specular + directional-diffuse + uniform-diffuse, from the roughness of the surface in wavelengths.

    Args:
        sigma0: rms height, scalar or (...). [length] `fixed(0.0)` is a smooth interface: Fresnel mirror and a/pi.
        tau: autocorrelation length, scalar or (...). [length]
        wavelength: of each channel, scalar or (channel,). [length] All three in one unit. Only their ratios count:
            hold one of them, the wavelength as a rule, `fixed` in a fit.
        eta, k: index eta + i k, each scalar, (channel,) or (..., channel). [-] k is fixed at 0 if not given.
        diffuse: a, what the body reflects in all directions, scalar, (channel,) or (..., channel). [-] Fixed at 0 if
            not given.
        solid_angle: of source and detector, one cone each. [sr] None keeps the specular part a delta lobe: sampled,
            in `directional_albedo`, not in f_r. A number adds its average over the cones to f_r.
        specular, directional_diffuse, uniform_diffuse: include the part of this name.
    Components: specular (0 where it is a delta lobe), directional_diffuse, uniform_diffuse (those included).
    Raises: ValueError outside the domains, for numbers of channels that differ, when all parts are switched off.
    Warns: UserWarning, at construction, when a exceeds `energy_bound` (parameters per pixel are not looked at), or
        when tau is so far from the wavelength that their units seem to differ.
    Deviations: as `he_torrance`; the first-surface parts themselves reach 1.022 at grazing (perfect reflector).
    Source: He, Torrance, Sillion & Greenberg 1991.
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
        self._specular, self._lobe, self._matte = specular, directional_diffuse, uniform_diffuse
        check_channels("HeTorrance", wavelength=self.wavelength, eta=self.eta, k=self.k, diffuse=self.diffuse)
        self._warn_of_units()
        if not is_per_texel(self):
            self._warn_of_energy()

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts included."""
        included = (self._specular, self._lobe, self._matte)
        return tuple(name for name, there in zip(self.PARTS, included, strict=True) if there)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        found = {}
        if self._specular:
            found["specular"] = self._spike(cosines)
        if self._lobe:
            found["directional_diffuse"] = directional_diffuse(cosines, **self._surface())
        if self._matte:
            found["uniform_diffuse"] = uniform_diffuse(cosines.light[..., None], self.diffuse)
        return found

    def specular_reflectivity(self, cos: Tensor) -> Tensor:
        """Reflectance (..., channel) of the specular part at a cosine of incidence (...); see the function. [-]"""
        return mirror_reflectance(cos, **self._surface())

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = NODES) -> Tensor:
        """Directional-hemispherical reflectance (..., channel) of the parts included, the delta lobe too. [-]

        Closed form but for the lobe: its quadrature follows its width. For alpha = 2 sigma0/tau from 2e-5 to 9 and
        angles up to 89.9 degrees the error is below 2e-7 with 32 nodes, 1e-4 with 16. A spike of finite solid angle
        is integrated too: what the horizon cuts of it is missing.
        """
        surface = self._surface_albedo(cos_view, nodes)
        return surface + torch.atleast_1d(self.diffuse) if self._matte else surface

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
        mirror, lobe = self._shares(view[..., 2])
        specular, u1 = choose(u[..., 0].expand_as(mirror + u[..., 0]), mirror)
        diffracted, u1 = choose(u1, lobe)
        u = torch.stack((u1, u[..., 1].expand_as(u1)), -1)
        towards_lobe = lobe_light(view, *self._widths(view[..., 2]), u)
        light = torch.where(diffracted[..., None], towards_lobe, cosine_hemisphere(u))
        if self.solid_angle is None:
            image = view * view.new_tensor([-1.0, -1.0, 1.0])
            return torch.where(specular[..., None], image, light), specular
        spike = spike_light(view, self.solid_angle, u)
        return torch.where(specular[..., None], spike, light), torch.zeros_like(specular)

    def density(self, cosines: Cosines) -> Tensor:
        mirror, lobe = self._shares(cosines.view)
        rest = lobe * lobe_density(cosines, *self._widths(cosines.view)) + (1 - lobe) * cosines.light / math.pi
        spike = 0.0 if self.solid_angle is None else spike_density(cosines, self.solid_angle)
        return mirror * spike + (1 - mirror) * rest

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

    def _spike(self, cosines: Cosines) -> Tensor:
        if self.solid_angle is None:
            return self._dark(cosines.light)
        return averaged_spike(cosines, solid_angle=self.solid_angle, **self._surface())

    def _widths(self, cos: Tensor) -> tuple[Tensor, Tensor]:
        lengths = self._lengths()
        return facet_width(torch.ones_like(cos), **lengths), facet_width(cos, **lengths)

    def _shares(self, cos: Tensor) -> tuple[Tensor, Tensor]:
        """Probability (...) of drawing the specular part, and of drawing the lobe among the others, at a cosine."""
        with torch.no_grad():
            surface = self._surface()
            smooth = mirror_reflectance(cos, **{**surface, "sigma0": torch.zeros_like(self.sigma0)}).mean(-1)
            mirror = self.specular_reflectivity(cos).mean(-1) * float(self._specular)
            lobe = smooth * lobe_share(cos, **self._lengths()) * float(self._lobe)
            others = lobe + torch.atleast_1d(self.diffuse).mean(-1) * float(self._matte)
            drawn = safe_divide(mirror, mirror + others, where=mirror + others > 0)
            return drawn, (1 - _COSINE_SHARE) * safe_divide(lobe, others, where=others > 0)

    def _surface_albedo(self, cos: Tensor, nodes: int) -> Tensor:
        """What the parts of the surface included reflect of light from a cosine (...): (..., channel)."""
        total = self._dark(cos)
        if self._specular and self.solid_angle is None:
            total = total + self.specular_reflectivity(cos)
        elif self._specular and self.solid_angle is not None:
            total = total + spike_albedo(cos, solid_angle=self.solid_angle, nodes=nodes, **self._surface())
        if self._lobe:
            total = total + lobe_albedo(cos, nodes=nodes, **self._surface())
        return total

    def _dark(self, like: Tensor) -> Tensor:
        """0 (..., channel) for directions (...)."""
        channels = torch.atleast_1d(self.wavelength + self.eta + self.k + self.diffuse)
        return 0 * channels + torch.zeros_like(like)[..., None]

    def _warn_of_energy(self) -> None:
        if not self._matte or bool((self.diffuse == 0).all()):
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
