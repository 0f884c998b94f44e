"""The rows of Lambert, Oren-Nayar and the V-cavity surfaces."""

import math

import torch

from helpers.coarse_tables import COARSE_ROUGH
from helpers.materials import Model, brushed, colour, number
from torchbrdf import (
    BRDF,
    AnisotropicRoughSurface,
    ClosedFormRoughSurface,
    ClosedFormVCavities,
    FastRoughSurface,
    InterpolatedRoughSurface,
    Lambert,
    OrenNayar,
    QualitativeOrenNayar,
    RoughSurface,
    SingleSlopeVCavities,
    TabulatedRoughSurface,
    UnidirectionalVCavities,
    fixed,
)

# Every slope angle is a kink of its own, in the polar angle and in azimuth.
KINKED = 5e-5
# Grazing directions meet steep slopes with projections of some hundred, of which 1 is subtracted again.
STEEP = 1e-5
# The strip means of the modes are sums of terms that cancel by one digit.
MODAL = 1e-4
# Exponents are sums whose terms cancel by half a digit, most at grazing forward light: 3.3e-6 found.
FITTED = 5e-6
# A dozen images of both signs are summed, which costs half a digit: 1.05e-6 found.
SUMMED = 2e-6


def mixture(dtype: torch.dtype) -> BRDF:
    """Every model in one sum, so that one compiled graph holds them all."""
    rough = OrenNayar(albedo=colour(dtype), sigma=number(0.5, dtype))
    grooved = QualitativeOrenNayar(albedo=number(0.6, dtype), sigma=number(0.3, dtype))
    return 0.5 * rough + 0.3 * grooved + 0.2 * Lambert(albedo=number(0.8, dtype))


OREN_NAYAR = [
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
        lambda dtype: RoughSurface(albedo=colour(dtype), sigma=number(0.5, dtype), nodes=4, order=6),
        captured=False,
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "rough surface, white, all bounces",
        lambda dtype: RoughSurface(
            albedo=fixed(number(1.0, dtype)),
            sigma=number(0.5, dtype),
            nodes=3,
            order=6,
            graded=True,
            bounces="all",
            modes=4,
        ),
        nodes=48,  # a kink of each of eight slopes
        energy_limit=1.0064,
        reason="direct light on 5 slopes, what bounces on 3: the sum conserves energy as the slopes grow in number",
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
            albedo=colour(dtype), weights=torch.tensor([0.2, 0.5, 0.2, 0.1], dtype=dtype), order=6
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
        energy_limit=1.006,
        reason="a fit of a surface that returns all its light at rho = 1: 1.005 at 88.8 degrees, sigma = 1",
        captured=False,
        float32=FITTED,
    ),
    Model(
        "fast rough surface, fixed sigma = 0",
        lambda dtype: FastRoughSurface(albedo=colour(dtype), sigma=fixed(number(0.0, dtype))),
        captured=False,
    ),
    Model(
        "interpolated rough surface",
        lambda dtype: InterpolatedRoughSurface(albedo=colour(dtype), sigma=number(0.5, dtype), grid=COARSE_ROUGH),
        float32=SUMMED,
    ),
    Model(
        "interpolated rough surface, white",
        lambda dtype: InterpolatedRoughSurface(
            albedo=fixed(number(1.0, dtype)), sigma=number(0.9, dtype), grid=COARSE_ROUGH
        ),
        energy_limit=1.002,
        reason="a table of few sites of a surface that returns all its light: 1.0016 at 1.55 rad",
        captured=False,
        float32=SUMMED,
    ),
    Model(
        "interpolated rough surface, fixed sigma = 0",
        lambda dtype: InterpolatedRoughSurface(
            albedo=colour(dtype), sigma=fixed(number(0.0, dtype)), grid=COARSE_ROUGH
        ),
        captured=False,
    ),
    Model(
        "single slope",
        lambda dtype: SingleSlopeVCavities(albedo=colour(dtype), slope=number(0.8, dtype), order=8),
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
        lambda dtype: brushed(UnidirectionalVCavities(albedo=colour(dtype), slope=number(0.8, dtype)), dtype),
        integral=KINKED,
        float32=STEEP,
    ),
    Model(
        "grooves, white, all bounces",
        lambda dtype: brushed(
            UnidirectionalVCavities(
                albedo=fixed(number(1.0, dtype)), slope=fixed(number(1.1, dtype)), bounces="all", modes=6
            ),
            dtype,
        ),
        captured=False,
        nodes=48,  # the kinks of the one slope, across the plane of the view, are no panel's end
        integral=KINKED,
        float32=MODAL,
    ),
    Model(
        "anisotropic rough surface",
        lambda dtype: brushed(
            AnisotropicRoughSurface(
                albedo=colour(dtype), sigma_x=number(0.3, dtype), sigma_y=number(0.7, dtype), nodes=3, azimuths=4
            ),
            dtype,
        ),
        captured=False,
        integral=KINKED,
        float32=STEEP,
    ),
]
