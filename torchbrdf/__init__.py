"""Reflectance of rough surfaces as differentiable torch modules.

Conventions, stated once:

- `normal`, `light`, `view`: unit vectors (..., 3) that leave the surface, always in that order.
- A BRDF f_r is in 1/sr and does not include the cosine. Reflected radiance = f_r * cos(light) * irradiance,
  where irradiance is that of a surface facing the source.
- f_r is (..., channel); albedo rho is scalar, (channel,) or (..., channel); roughness sigma [rad] is scalar or (...).
- Light is linear; angles are radians (`sigma_from_degrees` converts).
- Below the horizon f_r is 0 with zero gradient.
"""

from torchbrdf.brdf import BRDF, ImageBRDF, LinearBRDF, WeightedSum
from torchbrdf.directions import Cosines
from torchbrdf.models.lambert import Lambert
from torchbrdf.models.oren_nayar.anisotropic import AnisotropicRoughSurface
from torchbrdf.models.oren_nayar.fast import FastRoughSurface, fast_rough_surface
from torchbrdf.models.oren_nayar.functional import OrenNayar, oren_nayar
from torchbrdf.models.oren_nayar.qualitative import QualitativeOrenNayar, qualitative
from torchbrdf.models.oren_nayar.rough_surface import ClosedFormRoughSurface, RoughSurface, TabulatedRoughSurface
from torchbrdf.models.oren_nayar.single_slope import ClosedFormVCavities, SingleSlopeVCavities, UnidirectionalVCavities
from torchbrdf.parameters import (
    Constrained,
    Interval,
    Simplex,
    fixed,
    is_per_texel,
    sigma_from_beckmann_alpha,
    sigma_from_degrees,
    sigma_from_mean_slope,
    trainable,
)
from torchbrdf.slopes import gaussian_weights, sample_slope, shared_slopes, tabulated_weights

__all__ = [  # noqa: RUF022 - in plain order
    "AnisotropicRoughSurface",
    "BRDF",
    "ClosedFormRoughSurface",
    "ClosedFormVCavities",
    "Constrained",
    "Cosines",
    "FastRoughSurface",
    "ImageBRDF",
    "Interval",
    "Lambert",
    "LinearBRDF",
    "OrenNayar",
    "QualitativeOrenNayar",
    "RoughSurface",
    "Simplex",
    "SingleSlopeVCavities",
    "TabulatedRoughSurface",
    "UnidirectionalVCavities",
    "WeightedSum",
    "fast_rough_surface",
    "fixed",
    "gaussian_weights",
    "is_per_texel",
    "oren_nayar",
    "qualitative",
    "sample_slope",
    "shared_slopes",
    "sigma_from_beckmann_alpha",
    "sigma_from_degrees",
    "sigma_from_mean_slope",
    "tabulated_weights",
    "trainable",
]
