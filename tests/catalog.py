"""Every model once, with the laws it is known to break and why. Add a row for each new model."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch

from torchbrdf import (
    BRDF,
    EON,
    GGX,
    AnisotropicBeckmann,
    AnisotropicGGX,
    AshikhminShirley,
    Beckmann,
    Burley,
    Conductor,
    Coupled,
    Dampened,
    Dielectric,
    FujiiOrenNayar,
    Hapke,
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
    TabulatedBRDF,
    TorranceSparrow,
    fixed,
    v_cavities,
)


@dataclass(frozen=True)
class Model:
    """A row: how to build the model in a dtype, and its exceptions. Each exception needs a reason.

    `least` is the smallest value [1/sr] the model is known to reach, `energy_limit` the largest
    directional albedo; `reciprocal` says whether light and view may be exchanged. The tests also fail when an
    exception is no longer needed.

    Not exceptions to a law but to its arithmetic: `nodes` of the energy quadrature and `albedo_error` of the
    default one, for lobes narrower than diffuse ones; `float32_error`, relative to the magnitude, for models
    that amplify the rounding of a dot product, with the reason beside the row.
    """

    name: str
    make: Callable[[torch.dtype], BRDF]
    least: float = 0.0
    energy_limit: float = 1.0
    reciprocal: bool = True
    reason: str = ""
    nodes: int = 24
    albedo_error: float = 3e-4
    float32_error: float = 1e-6

    def __post_init__(self):
        excepted = self.least < 0 or self.energy_limit > 1 or not self.reciprocal
        if excepted != bool(self.reason):
            raise ValueError(f"{self.name}: an exception needs a reason, and a reason an exception")


def colour(dtype: torch.dtype) -> torch.Tensor:
    """Albedo of a terracotta, say."""
    return torch.tensor([0.7, 0.45, 0.3], dtype=dtype)


def number(value: float, dtype: torch.dtype) -> torch.Tensor:
    return torch.tensor(value, dtype=dtype)


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


# The half vector is a difference of cosines where no tangent is given: 1e-7 grows as 1/width^2 near the highlight,
# and as 1/|light + view|^2 where both graze.
FACETS = 2e-4
# Within a degree of the grain's own direction a normal leaves the tangent two digits less.
GRAIN = 2e-4

OTHERS = [
    Model(
        "phong, classic",
        lambda dtype: Phong(diffuse=number(0.2, dtype), specular=number(0.3, dtype), exponent=number(20.0, dtype)),
        reciprocal=False,
        reason="the radiance over the irradiance: divided by the cosine of the light alone",
        nodes=32,
        albedo_error=2e-3,
        float32_error=FACETS,
    ),
    Model(
        "phong, modified",
        lambda dtype: ModifiedPhong(diffuse=colour(dtype), specular=number(0.3, dtype), exponent=number(20.0, dtype)),
        nodes=32,
        albedo_error=2e-3,
        float32_error=FACETS,
    ),
    Model(
        "phong, maximum of cosines",
        lambda dtype: MaxCosinePhong(
            diffuse=number(0.0001, dtype), specular=number(0.99, dtype), exponent=number(8.0, dtype)
        ),
        nodes=32,
        albedo_error=4e-3,
        float32_error=FACETS,
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
        float32_error=FACETS,
    ),
    Model(
        "torrance_sparrow, glass",
        lambda dtype: TorranceSparrow(sigma=number(0.5, dtype), fresnel=Dielectric(eta=number(1.5, dtype))),
        nodes=160,
        albedo_error=2e-2,
        float32_error=FACETS,
    ),
    Model("coupled", lambda dtype: Coupled(albedo=colour(dtype))),
    Model(
        "coupled, glass",
        lambda dtype: Coupled(albedo=number(0.9, dtype), fresnel=Dielectric(eta=number(1.5, dtype))),
        nodes=48,
        albedo_error=1e-3,
        float32_error=2e-6,
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
        float32_error=GRAIN,
    ),
    Model(
        "fujii", lambda dtype: FujiiOrenNayar(albedo=colour(dtype), roughness=number(0.6, dtype)), float32_error=2e-6
    ),
    Model("eon", lambda dtype: EON(albedo=colour(dtype), roughness=number(0.6, dtype))),
    Model(
        "eon, white",
        lambda dtype: EON(albedo=fixed(number(1.0, dtype)), roughness=number(0.9, dtype)),
        float32_error=2e-6,
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
        float32_error=FACETS,
    ),
    Model(
        "ggx, gold",
        lambda dtype: GGX(alpha=number(0.5, dtype), fresnel=gold(dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32_error=FACETS,
    ),
    Model(
        "ggx, brushed",
        lambda dtype: brushed(AnisotropicGGX(alpha_x=number(0.4, dtype), alpha_y=number(0.7, dtype)), dtype),
        nodes=64,
        albedo_error=2e-2,
        float32_error=GRAIN,
    ),
    Model(
        "beckmann",
        lambda dtype: Beckmann(alpha=number(0.5, dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32_error=FACETS,
    ),
    Model(
        "beckmann, V-cavities",
        lambda dtype: Beckmann(alpha=number(0.5, dtype), masking=v_cavities),
        nodes=96,
        albedo_error=2e-2,
        float32_error=FACETS,
    ),
    Model(
        "beckmann, brushed",
        lambda dtype: brushed(AnisotropicBeckmann(alpha_x=number(0.4, dtype), alpha_y=number(0.7, dtype)), dtype),
        nodes=64,
        albedo_error=2e-2,
        float32_error=GRAIN,
    ),
    Model(
        "burley",
        lambda dtype: Burley(albedo=fixed(number(1.0, dtype)), roughness=number(0.9, dtype)),
        energy_limit=1.5,
        reason="fitted by eye to measurements, not to conserve energy",
    ),
    Model("frostbite", lambda dtype: Burley(albedo=colour(dtype), roughness=number(0.7, dtype), renormalised=True)),
    Model("lommel_seeliger", lambda dtype: LommelSeeliger(albedo=colour(dtype))),
    Model("lambert_sphere", lambda dtype: LambertSphere(albedo=colour(dtype)), float32_error=5e-6),
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
        float32_error=FACETS,  # tan(g/2) near retro is the root of 1 - cos(g)
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
        float32_error=1e-3,  # angles whose cosine is near 1, by steep roots
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
    *OTHERS,
]
