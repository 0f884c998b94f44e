"""Half spaces of scatterers: Lommel-Seeliger, Hapke, and Lambertian spheres."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import angle, root, safe_divide, safe_power, safe_sqrt, sine_excess
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.linear import LinearBRDF
from torchbrdf.parameters import ALBEDO, Constrained, Interval, ParameterValue

ASYMMETRY = Interval(-1.0, 1.0)
SURGE = Interval(0.0, math.inf)


def lambert_sphere_phase(cosines: Cosines) -> Tensor:
    r"""Phase function of a white Lambertian sphere, mean 1/(4 pi) over the sphere (...). [1/sr]

    .. math:: p = \frac{2}{3 \pi^2} (\sin\psi - \psi \cos\psi), \quad \psi = \pi - \text{phase angle}

    Without an angle: with c the cosine of the phase angle, :math:`\sin^3\psi\, h(|c|) + \pi \max(0, c)`, h smooth.
    """
    c = cosines.phase
    sine_squared = ((1 - c) * (1 + c)).relu()
    size = c.abs().clamp(max=1.0)
    excess = sine_squared * safe_sqrt(sine_squared) * sine_excess(size)
    return 2 / (3 * math.pi**2) * (excess + math.pi / 2 * (c + c.abs()))


def lambert_sphere_fast(cosines: Cosines, *, albedo: Tensor) -> Tensor:
    r"""Half space of Lambertian spheres with all orders of scattering, fitted.

    .. math:: f_r = \max\Big(0, \frac{c\,p}{\mu_i + \mu_r} + 0.234459\,\rho^{1.85432} + 0.0151829\,(c - 0.24998)
        \frac{|\Delta\phi| + \sqrt{\mu_i \mu_r}}{0.113706 + \arccos(S)/S}\Big), \quad S = \sin\theta_i \sin\theta_r

    with c(rho) the albedo of a sphere, p of `lambert_sphere_phase`.

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: rho, reflectance of the half space, scalar, (channel,) or (..., channel). [-] in [0, 1]
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo leaves its domain.
    Deviations: a fit for rho <= 0.75: white-sky albedo 0.506 for 0.5, 0.829 for 0.8, but 1.08 for 1.
    Source: d'Eon 2021, "An analytic BRDF for materials with spherical Lambertian scatterers", Computer Graphics Forum
        40(4), 153-161, arXiv:2103.01618.
    """
    ALBEDO.check("lambert_sphere_fast: albedo", albedo)
    rho = torch.atleast_1d(albedo)
    sphere = (1 - (1 - rho) ** 2.73556) / (1 - 0.184096 * (1 - rho) ** 2.48423)
    s = cosines.sin_alpha * cosines.sin_beta
    dphi = angle(safe_sqrt((s - cosines.in_plane) * (s + cosines.in_plane)), cosines.in_plane)
    # S/(0.113706 S + acos(S)) is 0 at S = 0, where the printed form divides by it
    away = angle(safe_sqrt((1 - s) * (1 + s)), s)
    crossed = (dphi + safe_sqrt(cosines.light * cosines.view)) * s / (0.113706 * s + away)
    single = lambert_sphere_phase(cosines) / (cosines.light + cosines.view)
    total = sphere * single[..., None] + 0.234459 * rho**1.85432 + 0.0151829 * (sphere - 0.24998) * crossed[..., None]
    return cosines.zero_below_horizon(total.relu())


@final
class LommelSeeliger(LinearBRDF):
    r"""Light scattered once by isotropic particles of a dark half space.

    .. math:: f_r = \frac{w}{4 \pi} \frac{1}{\mu_i + \mu_r}

    Args:
        albedo: w, single scattering albedo, scalar, (channel,) or (..., channel). [-] in [0, 1]
    Components: direct.
    Source: Seeliger 1887, "Zur Theorie der Beleuchtung der grossen Planeten, insbesondere des Saturn"; Lommel 1889,
        "Die Photometrie der diffusen Zurueckwerfung", Annalen der Physik 36.
    """

    albedo: Constrained = Constrained(ALBEDO)
    uniform_share = 0.5

    def __init__(self, *, albedo: ParameterValue = 0.5):
        super().__init__()
        self.albedo = albedo

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return (1 / (cosines.light + cosines.view),)

    def component_coefficients(self) -> dict[str, Tensor]:
        return {"direct": torch.atleast_1d(self.albedo)[..., None] / (4 * math.pi)}

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """w/2 (1 - mu log(1 + 1/mu)), in closed form; `nodes` is not used."""
        return torch.atleast_1d(self.albedo) / 2 * (1 - cos_view * torch.log1p(1 / cos_view))[..., None]


@final
class LambertSphere(LinearBRDF):
    r"""Half space of Lambertian spheres, light scattered once.

    .. math:: f_r = \frac{c\,p}{\mu_i + \mu_r}

    with p of `lambert_sphere_phase`.

    Args:
        albedo: c, reflectance of a sphere, scalar, (channel,) or (..., channel). [-] in [0, 1]
    Components: direct.
    Deviations: multiple scattering left out; `lambert_sphere_fast` has it, fitted.
    Source: d'Eon 2021 (`lambert_sphere_fast`); phase function: Schoenberg 1929, "Theoretische Photometrie", DOI
        10.1007/978-3-642-90703-6_1.
    """

    albedo: Constrained = Constrained(ALBEDO)
    uniform_share = 0.25

    def __init__(self, *, albedo: ParameterValue = 0.5):
        super().__init__()
        self.albedo = albedo

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return (lambert_sphere_phase(cosines) / (cosines.light + cosines.view),)

    def component_coefficients(self) -> dict[str, Tensor]:
        return {"direct": torch.atleast_1d(self.albedo)[..., None]}


@final
class Hapke(BRDF):
    r"""Half space of scatterers with an opposition surge and multiple scattering in two streams.

    .. math::
        f_r &= \frac{w}{4 \pi (\mu_i + \mu_r)} \{[1 + B(g)]\,p(g) + H(\mu_i) H(\mu_r) - 1\} \\
        H &= \frac{1 + 2 \mu}{1 + 2 \mu \sqrt{1 - w}}, \quad B = \frac{B_0}{1 + \tan(g/2)/h}, \quad
        p = \frac{1 - b^2}{(1 + 2 b \cos g + b^2)^{3/2}}

    with g the phase angle between light and view.

    Args:
        albedo: w, single scattering albedo, scalar, (channel,) or (..., channel). [-] in [0, 1]
        asymmetry: b, mean cosine of the scattering angle, scalar or (...). [-] in [-1, 1]; < 0 scatters back.
        surge: B_0, scalar or (...). [-] >= 0
        surge_width: h, scalar or (...). [-] > 0
    Components: single, multiple.
    Deviations: smooth surface; H is the two-stream approximation: at w = 1 the directional albedo is 1.04 to
        0.965. At the exact retro direction the surge has a cusp; the gradient taken there is that of the rest.
    Source: Hapke 1981, "Bidirectional reflectance spectroscopy: 1. Theory", DOI 10.1029/JB086iB04p03039.
    """

    albedo: Constrained = Constrained(ALBEDO)
    asymmetry: Constrained = Constrained(ASYMMETRY)
    surge: Constrained = Constrained(SURGE)
    surge_width: Constrained = Constrained(SURGE)
    uniform_share = 0.5

    def __init__(
        self,
        *,
        albedo: ParameterValue = 0.5,
        asymmetry: ParameterValue = -0.3,
        surge: ParameterValue = 0.5,
        surge_width: ParameterValue = 0.05,
    ):
        super().__init__()
        self.albedo = albedo
        self.asymmetry = asymmetry
        self.surge = surge
        self.surge_width = surge_width

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        w, b = torch.atleast_1d(self.albedo), self.asymmetry[..., None]
        away, toward = (half[..., None] for half in cosines.half_phase)
        h = self.surge_width[..., None]
        opposition = self.surge[..., None] * safe_divide(h * toward, h * toward + away, where=h * toward + away > 0)
        # 1 + 2 b cos(g) + b^2 as a sum of squares, which keeps its digits in the peak of a narrow lobe
        squared = torch.where(b < 0, (1 + b) ** 2 - 4 * b * away * away, (1 - b) ** 2 + 4 * b * toward * toward)
        phase = (1 - b * b) * safe_power(squared, torch.full_like(b, -1.5))
        absorbed = root(1 - w)
        h_light, h_view = (
            (1 + 2 * m) / (1 + 2 * m * absorbed) for m in (cosines.light[..., None], cosines.view[..., None])
        )
        factor = w / (4 * math.pi) / (cosines.light + cosines.view)[..., None]
        return {
            "single": factor * (1 + opposition) * phase,
            "multiple": factor * (h_light * h_view - 1),
        }
