"""Parameters of a BRDF from photographs and from measured reflectance, with standard errors and an honest status."""

from inverse.fitting.measurements import fit_measurements, weighted_reflectance
from inverse.fitting.photographs import FitError, fit
from inverse.fitting.prediction import predictor
from inverse.fitting.resampling import bootstrap
from inverse.fitting.result import FitResult
from inverse.fitting.selection import usable

__all__ = [
    "FitError",
    "FitResult",
    "bootstrap",
    "fit",
    "fit_measurements",
    "predictor",
    "usable",
    "weighted_reflectance",
]
