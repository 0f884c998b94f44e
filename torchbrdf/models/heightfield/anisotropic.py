"""Random heightfield whose slopes spread differently along the tangent and across it: its direct light."""

from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import half_turn_sine, safe_divide, soft_sqrt
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.models.heightfield.direct import QUADRATURES, SlopeFrame, check_nodes, direct_light
from torchbrdf.models.heightfield.roughness import rms_slope_from_sigma
from torchbrdf.models.heightfield.surface import OCCLUSION, sigma_of
from torchbrdf.models.heightfield.visibility import SMOOTH_HEIGHTFIELD, HeightfieldConstants
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, fixed
from torchbrdf.sampling import CltcSampled, equivalent_roughness


def anisotropic_slope_frame(cosines: Cosines, slope_x: Tensor, slope_y: Tensor) -> SlopeFrame:
    """Of directions (...) on a surface of rms slopes s_x along the tangent and s_y across it (...).

    The plane of slopes is stretched until they are isotropic. The surface is an isotropic one stretched along the
    ground, and a stretch takes rays to rays and hides what was hidden: every quantity of visibility, the azimuth
    between light and view among them, is that of the stretched directions. What stays is how steep a facet is.
    """
    along = cosines.tangent_plane
    light = slope_x * along.light_tangent / cosines.light, slope_y * along.light_bitangent / cosines.light
    view = slope_x * along.view_tangent / cosines.view, slope_y * along.view_bitangent / cosines.view
    squares = [x * x + y * y for x, y in (light, view)]
    lower = squares[0] > squares[1]  # the light is the more grazing one of the two
    ax, ay = (torch.where(lower, p, q) for p, q in zip(light, view, strict=True))
    bx, by = (torch.where(lower, q, p) for p, q in zip(light, view, strict=True))
    grazing, other = (soft_sqrt(x * x + y * y) for x, y in ((ax, ay), (bx, by)))
    sloped = ax * ax + ay * ay > 0
    ex = safe_divide(ax, grazing, where=sloped) + (~sloped).to(ax)
    ey = safe_divide(ay, grazing, where=sloped)
    side = bx * ex + by * ey, by * ex - bx * ey
    azimuth = other * other > torch.finfo(ax.dtype).tiny
    turn = [safe_divide(part, other, where=azimuth) for part in side]
    # The second axis points to the side where the other direction lies.
    hand = torch.where(side[1] < 0, -1.0, 1.0).to(ax)
    x2, y2 = slope_x * slope_x, slope_y * slope_y
    return SlopeFrame(
        grazing=grazing,
        other=other,
        other_along=side[0],
        other_across=side[1].abs(),
        half_turn=half_turn_sine(turn[0], turn[1]),
        along=x2 * ex * ex + y2 * ey * ey,
        mixed=hand * (y2 - x2) * ex * ey,
        across=x2 * ey * ey + y2 * ex * ex,
    )


def anisotropic_gaussian_heightfield(
    cosines: Cosines,
    *,
    albedo: Tensor,
    sigma_x: Tensor,
    sigma_y: Tensor,
    occlusion: Tensor,
    nodes: int = 240,
    constants: HeightfieldConstants = SMOOTH_HEIGHTFIELD,
) -> Tensor:
    r"""Light reflected once by a random heightfield with Gaussian slopes of two widths.

    .. math::
        f_r = \frac\rho\pi\, E_\xi \Bigl[\frac{\cos_a\, X^+ Y^+}{1 + D}\Bigr],\quad
        X = 1 + s_x \xi_x p_x + s_y \xi_y p_y,\quad \cos_a = (1 + s_x^2 \xi_x^2 + s_y^2 \xi_y^2)^{-1/2}

    with p = tan(theta) d of the light, Y alike of the view, and D of `gaussian_heightfield` in the stretched plane
    (s_x p_x, s_y p_y): a surface whose correlation lengths are in the ratio s_y : s_x is an isotropic one stretched
    along the ground, and visibility does not change under a stretch. So the azimuth between light and view, by which
    their visibilities part, is the stretched one. With equal widths this is the direct light of
    `gaussian_heightfield`.

    Args:
        cosines: of light, view and phase angle, each (...), with a tangent.
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma_x, sigma_y: roughness along and across the tangent, scalar or (...). [rad] in [0, pi/2]; each stands for
            the rms slope `rms_slope_from_sigma` gives it.
        occlusion, nodes, constants: as in `gaussian_heightfield`.
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError outside the domains, for other nodes, and without a tangent.
    Deviations: two and more bounces are left out. Exact only where both slopes come from one stretch: a surface whose
        correlation does not follow its slopes shares visibility otherwise.
    Source: stretch: Heitz 2014, Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs, JCGT 3(2);
        visibility: own.
    """
    name = "anisotropic_gaussian_heightfield"
    ALBEDO.check(f"{name}: albedo", albedo)
    ROUGHNESS.check(f"{name}: sigma_x", sigma_x)
    ROUGHNESS.check(f"{name}: sigma_y", sigma_y)
    OCCLUSION.check(f"{name}: occlusion", occlusion)
    check_nodes(name, nodes)
    frame = anisotropic_slope_frame(cosines, rms_slope_from_sigma(sigma_x), rms_slope_from_sigma(sigma_y))
    direct = direct_light(frame, occlusion, constants, QUADRATURES[nodes])
    return cosines.zero_below_horizon(torch.atleast_1d(albedo) * direct[..., None])


@final
class AnisotropicGaussianHeightfield(CltcSampled, BRDF):
    """Heightfield of two widths as a module; see `anisotropic_gaussian_heightfield` for equation and units.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma_x, sigma_y: roughness along and across the tangent, scalar or (...). [rad] `from_rms_slopes` takes the
            rms slopes instead.
        occlusion: E, scalar or (...). [-] in [0, 1.8]; held at 1 unless given.
        nodes, constants: as in `gaussian_heightfield`.
    Components: direct.
    Raises: ValueError outside the domains, for other nodes, and without a tangent.
    """

    anisotropic = True
    albedo: Constrained = Constrained(ALBEDO)
    sigma_x: Constrained = Constrained(ROUGHNESS)
    sigma_y: Constrained = Constrained(ROUGHNESS)
    occlusion: Constrained = Constrained(OCCLUSION)

    def __init__(
        self,
        *,
        albedo: Tensor | float | fixed = 0.5,
        sigma_x: Tensor | float | fixed = 0.3,
        sigma_y: Tensor | float | fixed = 0.3,
        occlusion: Tensor | float | fixed = fixed(1.0),  # noqa: B008 - frozen
        nodes: int = 240,
        constants: HeightfieldConstants = SMOOTH_HEIGHTFIELD,
    ):
        super().__init__()
        check_nodes("AnisotropicGaussianHeightfield", nodes)
        self.albedo = albedo
        self.sigma_x = sigma_x
        self.sigma_y = sigma_y
        self.occlusion = occlusion
        self.nodes = nodes
        self.constants = constants

    @classmethod
    def from_rms_slopes(
        cls,
        rms_slope_x: Tensor | float | fixed,
        rms_slope_y: Tensor | float | fixed,
        *,
        albedo: Tensor | float | fixed = 0.5,
        occlusion: Tensor | float | fixed = fixed(1.0),  # noqa: B008 - frozen
        nodes: int = 240,
        constants: HeightfieldConstants = SMOOTH_HEIGHTFIELD,
    ) -> "AnisotropicGaussianHeightfield":
        """Of rms slopes along and across the tangent [-] in [0, 1.482], scalar or (...)."""
        sigmas = [
            sigma_of("AnisotropicGaussianHeightfield.from_rms_slopes: " + name, slope)
            for name, slope in (("rms_slope_x", rms_slope_x), ("rms_slope_y", rms_slope_y))
        ]
        return cls(
            albedo=albedo, sigma_x=sigmas[0], sigma_y=sigmas[1], occlusion=occlusion, nodes=nodes, constants=constants
        )

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(((self.sigma_x**2 + self.sigma_y**2) / 2).sqrt())

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        slopes = rms_slope_from_sigma(self.sigma_x), rms_slope_from_sigma(self.sigma_y)
        frame = anisotropic_slope_frame(cosines, *slopes)
        direct = direct_light(frame, self.occlusion, self.constants, QUADRATURES[self.nodes])
        return {"direct": torch.atleast_1d(self.albedo) * direct[..., None]}
