"""Every model once, with the laws it is known to break and why. Add a row for each new model."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch

from torchbrdf import (
    BRDF,
    EON,
    GGX,
    AnisotropicBeckmann,
    AnisotropicGGX,
    AnisotropicRoughSurface,
    AshikhminShirley,
    Beckmann,
    Burley,
    ClosedFormRoughSurface,
    ClosedFormVCavities,
    Conductor,
    Cosines,
    Coupled,
    Dampened,
    Dielectric,
    FastRoughSurface,
    FujiiOrenNayar,
    Hapke,
    HeTorrance,
    Lambert,
    LambertSphere,
    LommelSeeliger,
    MaxCosinePhong,
    Minnaert,
    Mirror,
    ModifiedPhong,
    OrenNayar,
    Oriented,
    Phong,
    QualitativeOrenNayar,
    RoughSurface,
    SingleSlopeVCavities,
    TabulatedBRDF,
    TabulatedRoughSurface,
    TorranceSparrow,
    UnidirectionalVCavities,
    fixed,
    v_cavities,
)
from torchbrdf.testing import TOLERANCE

# Every slope angle is a kink of its own, in the polar angle and in azimuth.
KINKED = 5e-5
# Grazing directions meet steep slopes with projections of some hundred, of which 1 is subtracted again.
STEEP = 1e-5
# The strip means of the modes are sums of terms that cancel by one digit.
MODAL = 1e-4
# The terms of a polynomial fit cancel by half a digit at grazing forward light: 2.9e-6 found.
FITTED = 5e-6


@dataclass(frozen=True)
class Model:
    """A row: how to build the model in a dtype, and its exceptions. Each exception needs a reason.

    `least` is the smallest value [1/sr] the model is known to reach, `energy_limit` the largest
    directional albedo; `reciprocal` says whether light and view may be exchanged. The tests also fail when an
    exception is no longer needed.
    """

    name: str
    make: Callable[[torch.dtype], BRDF]
    least: float = 0.0
    energy_limit: float = 1.0
    reason: str = ""
    integral: float = TOLERANCE[torch.float64].integral  # of the energy law: kinks inside its panels cost digits
    float32: float = 1e-6  # relative to the sum of the absolute terms
    captured: bool = True  # whether torch.compile is tried: the cheapest configuration of a model stands for the others
    isotropic: bool = True
    reciprocal: bool = True
    nodes: int = 24  # of the energy law: lobes narrower than diffuse ones need more
    albedo_error: float = 3e-4  # of `directional_albedo` with its default nodes

    def __post_init__(self):
        excepted = self.least < 0 or self.energy_limit > 1 or not self.reciprocal
        if excepted != bool(self.reason):
            raise ValueError(f"{self.name}: an exception needs a reason, and a reason an exception")


def colour(dtype: torch.dtype) -> torch.Tensor:
    """Albedo of a terracotta, say."""
    return torch.tensor([0.7, 0.45, 0.3], dtype=dtype)


def number(value: float, dtype: torch.dtype) -> torch.Tensor:
    return torch.tensor(value, dtype=dtype)


class Brushed(BRDF):
    """An anisotropic model with its tangent given once, so that the laws can pass three directions."""

    def __init__(self, brdf: BRDF, dtype: torch.dtype):
        super().__init__()
        self.brdf = brdf
        self.register_buffer("tangent", torch.tensor([0.6, 0.64, 0.48], dtype=dtype))

    def evaluate_components(self, cosines: Cosines) -> dict[str, torch.Tensor]:
        return self.brdf.evaluate_components(replace(cosines, tangent=self.tangent))


def mixture(dtype: torch.dtype) -> BRDF:
    """Every model in one sum, so that one compiled graph holds them all."""
    rough = OrenNayar(albedo=colour(dtype), sigma=number(0.5, dtype))
    grooved = QualitativeOrenNayar(albedo=number(0.6, dtype), sigma=number(0.3, dtype))
    return 0.5 * rough + 0.3 * grooved + 0.2 * Lambert(albedo=number(0.8, dtype))


def brushed(brdf: BRDF, dtype: torch.dtype) -> BRDF:
    """Anisotropic models get their tangent from a fixed direction: the laws choose normals, light and view."""
    return Oriented(brdf, torch.tensor([1.0, 0.0, 0.2], dtype=dtype))


def gold(dtype: torch.dtype) -> Conductor:
    return Conductor(eta=torch.tensor([0.18, 0.42, 1.37], dtype=dtype), k=torch.tensor([3.42, 2.35, 1.77], dtype=dtype))


def every_other(dtype: torch.dtype) -> BRDF:
    """The other models in one sum, for one compiled graph."""
    x = {m.name: m for m in OTHERS}
    names = ["torrance_sparrow, glass", "ggx, brushed", "beckmann", "eon", "hapke", "minnaert", "coupled, glass"]
    parts = [x[name].make(dtype) for name in names]
    inner = [part.brdf if isinstance(part, Oriented) else part for part in parts]
    total = 0.2 * inner[0]
    for part in inner[1:]:
        total = total + 0.2 * part
    return brushed(total, dtype)


# An exponent of some tens, or a power of 20, multiplies the rounding of what it is taken of; tan(g/2) of Hapke's surge
# is the root of 1 - cos(g). The largest error of 20,000 directions was 4e-5.
STEEP_LOBE = 2e-4
POWER = 2e-5
# Two or three roundings more than a diffuse model: 1.5e-6.
FACETS = 4e-6


OTHERS = [
    Model(
        "phong, classic",
        lambda dtype: Phong(diffuse=number(0.2, dtype), specular=number(0.3, dtype), exponent=number(20.0, dtype)),
        reciprocal=False,
        reason="the radiance over the irradiance: divided by the cosine of the light alone",
        nodes=32,
        albedo_error=2e-3,
        float32=POWER,
    ),
    Model(
        "phong, modified",
        lambda dtype: ModifiedPhong(diffuse=colour(dtype), specular=number(0.3, dtype), exponent=number(20.0, dtype)),
        nodes=32,
        albedo_error=2e-3,
        float32=POWER,
    ),
    Model(
        "phong, maximum of cosines",
        lambda dtype: MaxCosinePhong(
            diffuse=number(0.0001, dtype), specular=number(0.99, dtype), exponent=number(8.0, dtype)
        ),
        nodes=32,
        albedo_error=4e-3,
        float32=POWER,
    ),
    Model("minnaert", lambda dtype: Minnaert(albedo=colour(dtype), k=number(1.4, dtype)), nodes=96),
    Model(
        "minnaert, k < 1",
        lambda dtype: Minnaert(albedo=number(0.5, dtype), k=number(0.5, dtype)),
        energy_limit=3.47,
        reason="the directional albedo is rho cos^(k-1): 3.465 at 1.55 rad",
        nodes=96,
        albedo_error=1e-2,
    ),
    Model(
        "torrance_sparrow",
        lambda dtype: TorranceSparrow(sigma=number(0.5, dtype)),
        nodes=160,  # the kinks of G are no panel's end
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "torrance_sparrow, glass",
        lambda dtype: TorranceSparrow(sigma=number(0.5, dtype), fresnel=Dielectric(eta=number(1.5, dtype))),
        nodes=160,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model("coupled", lambda dtype: Coupled(albedo=colour(dtype))),
    Model(
        "coupled, glass",
        lambda dtype: Coupled(albedo=number(0.9, dtype), fresnel=Dielectric(eta=number(1.5, dtype))),
        nodes=48,
        albedo_error=1e-3,
        float32=2e-6,
    ),
    Model(
        "dampened",
        lambda dtype: Dampened(albedo=colour(dtype)),
        reciprocal=False,
        reason="dims the light that leaves and not the light that enters",
    ),
    Model("mirror", lambda dtype: Mirror(fresnel=gold(dtype))),
    Model(
        "ashikhmin_shirley",
        lambda dtype: brushed(
            AshikhminShirley(
                diffuse=colour(dtype),
                specular=number(0.1, dtype),
                exponent_x=number(4.0, dtype),
                exponent_y=number(15.0, dtype),
            ),
            dtype,
        ),
        nodes=32,
        albedo_error=1e-2,
        float32=FACETS,
    ),
    Model("fujii", lambda dtype: FujiiOrenNayar(albedo=colour(dtype), roughness=number(0.6, dtype)), float32=2e-6),
    Model("eon", lambda dtype: EON(albedo=colour(dtype), roughness=number(0.6, dtype))),
    Model(
        "eon, white",
        lambda dtype: EON(albedo=fixed(number(1.0, dtype)), roughness=number(0.9, dtype)),
        float32=2e-6,
    ),
    Model(
        "eon, fitted",
        lambda dtype: EON(albedo=colour(dtype), roughness=number(0.6, dtype), exact=False),
        albedo_error=1e-3,
    ),
    Model(
        "ggx",
        lambda dtype: GGX(alpha=number(0.5, dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "ggx, gold",
        lambda dtype: GGX(alpha=number(0.5, dtype), fresnel=gold(dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "ggx, brushed",
        lambda dtype: brushed(AnisotropicGGX(alpha_x=number(0.4, dtype), alpha_y=number(0.7, dtype)), dtype),
        nodes=64,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "beckmann",
        lambda dtype: Beckmann(alpha=number(0.5, dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32=STEEP_LOBE,
    ),
    Model(
        "beckmann, V-cavities",
        lambda dtype: Beckmann(alpha=number(0.5, dtype), masking=v_cavities),
        nodes=96,
        albedo_error=2e-2,
        float32=STEEP_LOBE,
    ),
    Model(
        "beckmann, brushed",
        lambda dtype: brushed(AnisotropicBeckmann(alpha_x=number(0.4, dtype), alpha_y=number(0.7, dtype)), dtype),
        nodes=64,
        albedo_error=2e-2,
        float32=STEEP_LOBE,
    ),
    Model(
        "burley",
        lambda dtype: Burley(albedo=fixed(number(1.0, dtype)), roughness=number(0.9, dtype)),
        energy_limit=1.5,
        reason="fitted by eye to measurements, not to conserve energy",
    ),
    Model("frostbite", lambda dtype: Burley(albedo=colour(dtype), roughness=number(0.7, dtype), renormalised=True)),
    Model("lommel_seeliger", lambda dtype: LommelSeeliger(albedo=colour(dtype))),
    Model("lambert_sphere", lambda dtype: LambertSphere(albedo=colour(dtype)), float32=5e-6),
    Model(
        "hapke",
        lambda dtype: Hapke(
            albedo=number(0.6, dtype),
            asymmetry=number(-0.3, dtype),
            surge=number(0.8, dtype),
            surge_width=number(0.1, dtype),
        ),
        nodes=64,
        albedo_error=5e-3,
        float32=STEEP_LOBE,
    ),
    Model(
        "he_torrance, aluminium",  # Figure 8; the specular part matters at grazing alone
        lambda dtype: HeTorrance(
            sigma0=number(0.28, dtype),
            tau=number(1.77, dtype),
            wavelength=torch.tensor([0.65, 0.5], dtype=dtype),
            eta=torch.tensor([1.49, 0.77], dtype=dtype),
            k=torch.tensor([7.82, 6.08], dtype=dtype),
            diffuse=number(0.02, dtype),  # covers the far tail of the lobe, which float32 cannot hold
        ),
        nodes=96,
        float32=FACETS,
    ),
    Model(
        "he_torrance, plastic",
        lambda dtype: HeTorrance(
            sigma0=number(0.2, dtype),
            tau=number(2.0, dtype),
            wavelength=fixed(number(0.55, dtype)),
            eta=number(1.5, dtype),
            diffuse=torch.tensor([0.28, 0.15], dtype=dtype),
        ),
        nodes=96,
        float32=FACETS,
    ),
    Model(
        "he_torrance, averaged spike",
        lambda dtype: HeTorrance(
            sigma0=number(0.05, dtype),
            tau=number(0.7, dtype),
            wavelength=number(0.55, dtype),
            eta=number(1.5, dtype),
            solid_angle=1.0,
            directional_diffuse=False,
            uniform_diffuse=False,
        ),
        nodes=96,
        integral=1e-3,  # the kinks at apex and rim of the spike are no panel's end
        albedo_error=2e-2,
        float32=2e-3,  # at the rim the spike is what two roots leave: relative to its apex all digits are right
    ),
    Model(
        "tabulated",
        lambda dtype: TabulatedBRDF.of(
            EON(albedo=colour(dtype), roughness=number(0.3, dtype)).to(dtype),
            nodes=(7, 7, 4),
            half_power=1.0,
            dtype=dtype,
        ),
        nodes=96,
        albedo_error=5e-3,
        float32=2e-3,  # phi_d near the mirror direction, where it has no meaning and the 7 nodes are far apart
    ),
]

MODELS = [
    Model("lambert", lambda dtype: Lambert(albedo=colour(dtype))),
    Model("lambert, white", lambda dtype: Lambert(albedo=fixed(number(1.0, dtype)))),
    Model("oren_nayar", lambda dtype: OrenNayar(albedo=colour(dtype), sigma=number(0.5, dtype))),
    Model(
        "oren_nayar, rough and dark",
        lambda dtype: OrenNayar(albedo=number(0.05, dtype), sigma=number(1.2, dtype)),
        least=-0.0033,
        reason="the cubic in C2 is a fit: (27) turns negative at forward grazing for sigma > 0.66 rad",
    ),
    Model(
        "oren_nayar, white",
        lambda dtype: OrenNayar(albedo=fixed(number(1.0, dtype)), sigma=number(0.309, dtype)),
        energy_limit=1.051,
        reason="(27) + (28) are fitted apart and do not conserve energy: 1.0499 at grazing, rho = 1, sigma = 0.31",
    ),
    Model(
        "oren_nayar, direct only",
        lambda dtype: OrenNayar(albedo=colour(dtype), sigma=number(0.6, dtype), interreflection=False),
    ),
    Model(
        "oren_nayar, interreflection only",
        lambda dtype: OrenNayar(albedo=colour(dtype), sigma=number(0.6, dtype), direct=False),
    ),
    Model(
        "oren_nayar, fixed sigma = 0", lambda dtype: OrenNayar(albedo=colour(dtype), sigma=fixed(number(0.0, dtype)))
    ),
    Model("qualitative", lambda dtype: QualitativeOrenNayar(albedo=colour(dtype), sigma=number(math.pi / 6, dtype))),
    Model(
        "qualitative, white",
        lambda dtype: QualitativeOrenNayar(albedo=fixed(number(1.0, dtype)), sigma=number(0.2, dtype)),
        energy_limit=1.016,
        reason="(30) keeps B of (27) without its forward term: 1.0151 at grazing, rho = 1, sigma = 0.2",
    ),
    Model(
        "qualitative, white, 0.57",
        lambda dtype: QualitativeOrenNayar(albedo=fixed(number(1.0, dtype)), sigma=number(0.3, dtype), a_constant=0.57),
        energy_limit=1.045,
        reason="0.57 stands for interreflection at one albedo only: 1.0442 at grazing, rho = 1, sigma = 0.3",
    ),
    Model("weighted sum", mixture),
    Model(
        "rough surface, direct",
        lambda dtype: RoughSurface(albedo=colour(dtype), sigma=number(0.5, dtype), nodes=4, bounces=1),
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "rough surface",
        lambda dtype: RoughSurface(albedo=colour(dtype), sigma=number(0.5, dtype), nodes=5, order=3),
        captured=False,
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "rough surface, white, all bounces",
        lambda dtype: RoughSurface(
            albedo=fixed(number(1.0, dtype)), sigma=number(0.9, dtype), nodes=3, order=6, graded=True, bounces="all"
        ),
        captured=False,
        integral=KINKED,
        float32=MODAL,
    ),
    Model(
        "rough surface, fixed sigma = 0",
        lambda dtype: RoughSurface(albedo=colour(dtype), sigma=fixed(number(0.0, dtype)), nodes=4, order=3),
        captured=False,
    ),
    Model(
        "tabulated rough surface",
        lambda dtype: TabulatedRoughSurface(
            albedo=colour(dtype), weights=torch.tensor([0.2, 0.5, 0.2, 0.1], dtype=dtype), order=3
        ),
        captured=False,
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "closed-form rough surface",
        lambda dtype: ClosedFormRoughSurface(albedo=colour(dtype), sigma=number(0.5, dtype), nodes=4),
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "fast rough surface, two bounces",
        lambda dtype: FastRoughSurface(albedo=colour(dtype), sigma=number(0.5, dtype), bounces=2),
        float32=FITTED,
    ),
    Model(
        "fast rough surface",
        lambda dtype: FastRoughSurface(albedo=colour(dtype), sigma=number(0.5, dtype)),
        captured=False,
        float32=FITTED,
    ),
    Model(
        "fast rough surface, white",
        lambda dtype: FastRoughSurface(albedo=fixed(number(1.0, dtype)), sigma=number(1.0, dtype)),
        energy_limit=1.02,
        reason="a fit of a surface that returns all its light at rho = 1: 1.0117 at normal incidence, sigma = 1",
        captured=False,
    ),
    Model(
        "fast rough surface, fixed sigma = 0",
        lambda dtype: FastRoughSurface(albedo=colour(dtype), sigma=fixed(number(0.0, dtype))),
        captured=False,
    ),
    Model(
        "single slope",
        lambda dtype: SingleSlopeVCavities(albedo=colour(dtype), slope=number(0.8, dtype), order=4),
        captured=False,
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "closed-form single slope",
        lambda dtype: ClosedFormVCavities(albedo=colour(dtype), slope=number(0.8, dtype)),
        captured=False,
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "grooves",
        lambda dtype: Brushed(UnidirectionalVCavities(albedo=colour(dtype), slope=number(0.8, dtype)), dtype),
        isotropic=False,
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "grooves, white, all bounces",
        lambda dtype: Brushed(
            UnidirectionalVCavities(
                albedo=fixed(number(1.0, dtype)), slope=fixed(number(1.1, dtype)), bounces="all", modes=6
            ),
            dtype,
        ),
        captured=False,
        isotropic=False,
        integral=KINKED,
        float32=MODAL,
    ),
    Model(
        "anisotropic rough surface",
        lambda dtype: Brushed(
            AnisotropicRoughSurface(
                albedo=colour(dtype), sigma_x=number(0.3, dtype), sigma_y=number(0.7, dtype), nodes=3, azimuths=4
            ),
            dtype,
        ),
        captured=False,
        isotropic=False,
        integral=KINKED,
        float32=STEEP,
    ),
    *OTHERS,
]
