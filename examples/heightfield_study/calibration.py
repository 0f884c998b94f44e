"""The model's constants from traced surfaces: least squares on light reflected once, and how the bounces turn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from samples import Sample, distinct
from scipy.optimize import least_squares
from surfaces import Array

START = (0.5, 0.3, 3.0, 1.0)  # a, b, K, k
FLOOR = 0.002  # relative error of a good model: entries known better than that all count alike
TURN_LIMIT = np.radians(61)  # polar angles beyond are left out of the fit of azimuths


class Model(Protocol):
    """Constants that the library has, the highest occlusion E it takes, and the BRDF by bounce."""

    @property
    def constants(self) -> Sequence[float]: ...

    @property
    def highest_occlusion(self) -> float: ...

    def __call__(self, slope: float, occlusion: float, constants: Sequence[float], bounces: int) -> Array:
        """f_1, f_2, .. (n, i, r, k) at the directions of the samples. [1/sr]"""
        ...


@dataclass(frozen=True)
class Fit:
    """Values with their standard errors between surfaces (nan where single surfaces are not kept)."""

    values: Array
    errors: Array


def constants(model: Model, samples: Sequence[Sample]) -> Fit:
    """a, b, K, k of the visibility: relative errors of f_1, all samples at once, occlusion 1."""
    return _fit(lambda values, slope: distinct(model(slope, 1.0, values, 1)[0]), samples, START)


def occlusion(model: Model, values: Sequence[float], samples: Sequence[Sample]) -> Fit:
    """E of surfaces of another spectrum, the constants given."""

    def predict(e: Array, slope: float) -> Array:
        return distinct(model(slope, float(e[0]), values, 1)[0])

    return _fit(predict, samples, (1.0,), model.highest_occlusion)


def _fit(
    predict: Callable[[Array, float], Array],
    samples: Sequence[Sample],
    start: Sequence[float],
    upper: float = np.inf,
) -> Fit:
    data = [distinct(sample.f[0]) for sample in samples]
    spread = [np.hypot(FLOOR * f, distinct(sample.f_se[0])) for f, sample in zip(data, samples, strict=True)]

    def residuals(values: Array) -> Array:
        rows = zip(samples, data, spread, strict=True)
        return np.concatenate([(predict(values, sample.slope) - f) / width for sample, f, width in rows])

    best = least_squares(residuals, start, bounds=(0, upper), diff_step=1e-4, x_scale=start)
    response = np.linalg.pinv(best.jac)  # of the values to residuals' data
    parts = np.split(response, np.cumsum([len(f) for f in data])[:-1], axis=1)
    variances = [
        _variance([part @ (distinct(each[0]) / width) for each in sample.each])
        if sample.each is not None
        else np.full(len(start), np.nan)
        for sample, width, part in zip(samples, spread, parts, strict=True)
    ]
    return Fit(best.x, np.sqrt(np.sum(variances, axis=0)))


def _variance(values: Sequence[Array]) -> Array:
    """Of the mean of values of independent surfaces."""
    return np.var(values, axis=0, ddof=1) / len(values)


def turn(predicted: Array, sample: Sample, bounce: int) -> Fit:
    """How much stronger than predicted f_bounce swings with azimuth: traced mode 1 over the model's, up to 60 degrees.

    Mean over pairs of directions weighted by the sines, to which mode 1 is about proportional.
    """
    n = bounce - 1
    dphi = 2 * np.pi * np.arange(predicted.shape[-1]) / predicted.shape[-1]
    sine = np.where(sample.polar < TURN_LIMIT, np.sin(sample.polar), 0)

    def swing(f: Array) -> Array:
        return np.einsum("...irk,k,i,r->...", f, np.cos(dphi), sine, sine)

    model = swing(predicted[n])
    errors = np.nan if sample.each is None else np.sqrt(_variance(swing(sample.each[:, n]) / model))
    return Fit(swing(sample.f[n]) / model, np.asarray(errors))


@dataclass(frozen=True)
class Error:
    """Relative error of a model: rms over all entries, its standard error, the largest, and the data's own noise."""

    rms: float
    rms_se: float
    largest: float
    noise: float


def error(predicted: Array, sample: Sample, weights: Sequence[float]) -> Error:
    """Of sum_n weights_n f_n: (1,) is direct light, (0, 1) two bounces, rho^n the full BRDF."""
    weight = np.zeros(len(sample.f))
    weight[: len(weights)] = weights
    model = distinct(np.tensordot(weight[: len(predicted)], predicted, axes=1))
    truth = distinct(np.tensordot(weight, sample.f, axes=1))
    relative = model / truth - 1
    rms = np.sqrt(np.mean(relative**2))
    if sample.each is None:
        rms_se = noise = np.nan
    else:
        each = distinct(np.tensordot(sample.each, weight, axes=(1, 0)))
        rms_se = np.sqrt(_variance(np.mean(relative * model / truth**2 * each, axis=1) / rms))
        noise = np.sqrt(np.mean(_variance(each) / truth**2))
    return Error(float(rms), float(rms_se), float(np.abs(relative).max()), float(noise))
