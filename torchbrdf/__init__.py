"""Reflectance of rough surfaces as differentiable torch modules.

Conventions, stated once:

- `normal`, `light`, `view`: unit vectors (..., 3) that leave the surface, always in that order.
- A BRDF f_r is in 1/sr and does not include the cosine. Reflected radiance = f_r * cos(light) * irradiance,
  where irradiance is that of a surface facing the source.
- f_r is (..., channel); albedo rho is scalar, (channel,) or (..., channel); roughness sigma [rad] is scalar or (...).
- Light is linear; angles are radians (`sigma_from_degrees` converts).
- Below the horizon f_r is 0 with zero gradient.
"""

import importlib
import warnings

from torchbrdf.brdf import BRDF, Option
from torchbrdf.checks import unchecked
from torchbrdf.directions import (
    Cosines,
    any_tangent,
)
from torchbrdf.effects import (
    EFFECTS,
    simulated,
)
from torchbrdf.facets import (
    HalfVector,
    smith_correlated,
    smith_separable,
    v_cavities,
    v_cavity_masking,
)
from torchbrdf.fields import FieldBRDF
from torchbrdf.fresnel import (
    Conductor,
    ConstantFresnel,
    Dielectric,
    Fresnel,
    Perfect,
    Schlick,
    conductor,
    conductor_amplitudes,
    dielectric,
    dielectric_average,
    f0_from_index,
    schlick,
)
from torchbrdf.interpolation.images import TableGrid
from torchbrdf.kernels import native
from torchbrdf.linear import ImageBRDF, LinearBRDF
from torchbrdf.mixture import WeightedSum
from torchbrdf.models.ashikhmin_shirley import (
    AshikhminShirley,
)
from torchbrdf.models.burley import (
    Burley,
    burley,
)
from torchbrdf.models.ggx_and_beckmann import (
    GGX,
    AnisotropicBeckmann,
    AnisotropicGGX,
    Beckmann,
)
from torchbrdf.models.he_torrance.model import (
    HeTorrance,
)
from torchbrdf.models.he_torrance.polarised import (
    coherency,
    he_torrance_polarised,
    polarised_specular_reflectivity,
)
from torchbrdf.models.he_torrance.reflectance import (
    he_torrance,
    specular_reflectivity,
)
from torchbrdf.models.heightfield.anisotropic import AnisotropicGaussianHeightfield, anisotropic_gaussian_heightfield
from torchbrdf.models.heightfield.fast import FastGaussianHeightfield, fast_gaussian_heightfield
from torchbrdf.models.heightfield.interpolated import (
    InterpolatedGaussianHeightfield,
    interpolated_gaussian_heightfield,
)
from torchbrdf.models.heightfield.neighbours import NEIGHBOURING_FACETS, NeighbouringFacets
from torchbrdf.models.heightfield.roughness import (
    rms_slope_from_beckmann_alpha,
    rms_slope_from_sigma,
    sigma_from_rms_slope,
)
from torchbrdf.models.heightfield.surface import GaussianHeightfield, gaussian_heightfield
from torchbrdf.models.heightfield.transport import INDEPENDENT_FACETS
from torchbrdf.models.heightfield.visibility import MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD, HeightfieldConstants
from torchbrdf.models.lambert import (
    Lambert,
)
from torchbrdf.models.layered import (
    Coupled,
    Dampened,
    Mirror,
)
from torchbrdf.models.minnaert import (
    Minnaert,
    minnaert,
)
from torchbrdf.models.oren_nayar.anisotropic import (
    AnisotropicRoughSurface,
)
from torchbrdf.models.oren_nayar.fast import (
    FastRoughSurface,
    fast_rough_surface,
)
from torchbrdf.models.oren_nayar.functional import (
    OrenNayar,
    oren_nayar,
)
from torchbrdf.models.oren_nayar.interpolated import (
    InterpolatedRoughSurface,
    interpolated_rough_surface,
)
from torchbrdf.models.oren_nayar.qualitative import (
    QualitativeOrenNayar,
    qualitative,
)
from torchbrdf.models.oren_nayar.rough_surface import (
    ClosedFormRoughSurface,
    RoughSurface,
    TabulatedRoughSurface,
)
from torchbrdf.models.oren_nayar.single_slope import (
    ClosedFormVCavities,
    SingleSlopeVCavities,
    UnidirectionalVCavities,
)
from torchbrdf.models.oriented import (
    Oriented,
)
from torchbrdf.models.phong import (
    MaxCosinePhong,
    ModifiedPhong,
    Phong,
    phong_radiance,
)
from torchbrdf.models.planetary import (
    Hapke,
    LambertSphere,
    LommelSeeliger,
    lambert_sphere_fast,
)
from torchbrdf.models.rough_diffuse import (
    EON,
    FujiiOrenNayar,
    eon_albedo_from_directional,
    eon_albedo_from_white_sky,
)
from torchbrdf.models.tabulated import (
    TabulatedBRDF,
    rusinkiewicz_angles,
)
from torchbrdf.models.torrance_sparrow import (
    TorranceSparrow,
    torrance_sparrow,
)
from torchbrdf.optical_constants import (
    ACRYLIC,
    ALUMINIUM,
    COPPER,
    CROWN_GLASS,
    FUSED_SILICA,
    GOLD,
    MAGNESIUM_OXIDE,
    SILVER,
    MeasuredIndex,
    SellmeierIndex,
)
from torchbrdf.parameters import (
    Constrained,
    Interval,
    ParameterValue,
    Simplex,
    fixed,
    is_per_texel,
    sigma_from_beckmann_alpha,
    sigma_from_degrees,
    sigma_from_mean_slope,
    trainable,
)
from torchbrdf.sampling import (
    Sample,
)
from torchbrdf.slopes import (
    gaussian_weights,
    sample_slope,
    shared_slopes,
    tabulated_weights,
)

__version__ = "0.2.0"

__all__ = [  # noqa: RUF022 - in plain order
    "ACRYLIC",
    "ALUMINIUM",
    "AnisotropicBeckmann",
    "AnisotropicGGX",
    "AnisotropicGaussianHeightfield",
    "AnisotropicRoughSurface",
    "AshikhminShirley",
    "BRDF",
    "Beckmann",
    "Burley",
    "COPPER",
    "CROWN_GLASS",
    "ClosedFormRoughSurface",
    "ClosedFormVCavities",
    "Conductor",
    "ConstantFresnel",
    "Constrained",
    "Cosines",
    "Coupled",
    "Dampened",
    "Dielectric",
    "EFFECTS",
    "EON",
    "FUSED_SILICA",
    "FastGaussianHeightfield",
    "FastRoughSurface",
    "FieldBRDF",
    "Fresnel",
    "FujiiOrenNayar",
    "GGX",
    "GOLD",
    "GaussianHeightfield",
    "HalfVector",
    "Hapke",
    "HeTorrance",
    "HeightfieldConstants",
    "INDEPENDENT_FACETS",
    "ImageBRDF",
    "InterpolatedGaussianHeightfield",
    "InterpolatedRoughSurface",
    "Interval",
    "Lambert",
    "LambertSphere",
    "LinearBRDF",
    "LommelSeeliger",
    "MAGNESIUM_OXIDE",
    "MESHED_HEIGHTFIELD",
    "MaxCosinePhong",
    "MeasuredIndex",
    "Minnaert",
    "Mirror",
    "ModifiedPhong",
    "NEIGHBOURING_FACETS",
    "NeighbouringFacets",
    "Option",
    "OrenNayar",
    "Oriented",
    "ParameterValue",
    "Perfect",
    "Phong",
    "QualitativeOrenNayar",
    "RoughSurface",
    "SILVER",
    "SMOOTH_HEIGHTFIELD",
    "Sample",
    "Schlick",
    "SellmeierIndex",
    "Simplex",
    "SingleSlopeVCavities",
    "TableGrid",
    "TabulatedBRDF",
    "TabulatedRoughSurface",
    "TorranceSparrow",
    "UnidirectionalVCavities",
    "WeightedSum",
    "anisotropic_gaussian_heightfield",
    "any_tangent",
    "burley",
    "coherency",
    "conductor",
    "conductor_amplitudes",
    "dielectric",
    "dielectric_average",
    "eon_albedo_from_directional",
    "eon_albedo_from_white_sky",
    "f0_from_index",
    "fast_gaussian_heightfield",
    "fast_rough_surface",
    "fixed",
    "gaussian_heightfield",
    "gaussian_weights",
    "he_torrance",
    "he_torrance_polarised",
    "interpolated_gaussian_heightfield",
    "interpolated_rough_surface",
    "is_per_texel",
    "lambert_sphere_fast",
    "minnaert",
    "native",
    "oren_nayar",
    "phong_radiance",
    "polarised_specular_reflectivity",
    "qualitative",
    "rms_slope_from_beckmann_alpha",
    "rms_slope_from_sigma",
    "rusinkiewicz_angles",
    "sample_slope",
    "schlick",
    "shared_slopes",
    "sigma_from_beckmann_alpha",
    "sigma_from_degrees",
    "sigma_from_mean_slope",
    "sigma_from_rms_slope",
    "simulated",
    "smith_correlated",
    "smith_separable",
    "specular_reflectivity",
    "tabulated_weights",
    "torrance_sparrow",
    "trainable",
    "unchecked",
    "v_cavities",
    "v_cavity_masking",
]

_MOVED = {"sampling_laws": "torchbrdf.testing", "accuracy_series": "torchbrdf.accuracy"}


def __getattr__(name: str) -> object:
    """Names of version 0.1, for one more version."""
    if name in _MOVED:
        warnings.warn(f"torchbrdf.{name} is now part of {_MOVED[name]}", DeprecationWarning, stacklevel=2)
        return importlib.import_module(_MOVED[name])
    if name != "options":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn("torchbrdf.options(model) is now model.stand_ins()", DeprecationWarning, stacklevel=2)
    return lambda model: model.stand_ins()
