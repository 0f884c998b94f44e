"""Recover the parameters of a BRDF from measured reflectance: what `fit` is to photographs."""

import copy
import math
import time

import torch
from torch import Tensor

from inverse.files import Measurements
from inverse.fitting.levenberg_marquardt import Residuals
from inverse.fitting.photographs import best_of_starts, checked_model, judged
from inverse.fitting.prediction import sample_predictor
from inverse.fitting.result import FitResult
from inverse.fitting.unknowns import Unknowns
from torchbrdf import BRDF, Cosines, is_per_texel


def fit_measurements(
    measurements: Measurements,
    model: BRDF,
    *,
    knee: float = math.inf,
    starts: int = 1,
    seed: int = 0,
    max_steps: int = 100,
    throw: bool = True,
) -> FitResult:
    """Least-squares fit of the model's trainable parameters to measured f_r, all samples and wavelengths jointly.

    The residual is the difference of `weighted_reflectance` between model and measurement. A parameter with one
    entry for each wavelength (`albedo=torch.full((31,), 0.5)`) is fitted at each, a single number is shared. Pairs
    of directions at or below the horizon do not count. The x axis of the measurements is the tangent.

    Args:
        model: start values; it is copied, not changed. Its parameters are shared by all samples.
        knee: of `weighted_reflectance`. [1/sr] Infinite, the highest samples decide; of a glossy material those
            are few, and their height that of the instrument's resolution.
            Errors take the noise to be even in what is compared: noise that is a share of each value asks for a
            knee below the values that count, or the errors come out too small.
        starts: number of starts; after the model's own, drawn at random over the finite domains.
        seed: of the random starts.
        max_steps: of each start.
        throw: raise FitError when the fit diverges, instead of returning it.
    Returns: FitResult; residual_rms in 1/sr. Its status says when the measurements do not determine a parameter.
    Raises: ValueError for measurements that are not finite or do not match the model, parameters per texel, a knee
        that is not positive, and when no sample is above the horizon; FitError.
    """
    began = time.perf_counter()
    checked_model(model, starts, max_steps)
    if not knee > 0:
        raise ValueError(f"knee must be above 0 1/sr; found {knee}.")
    values = measurements.values
    if values.ndim != 2 or len(values) != len(measurements.light) or not values.isfinite().all():
        raise ValueError(
            f"measurements.values must be finite, (sample, wavelength) with {len(measurements.light)} samples; "
            f"found shape {tuple(values.shape)}, {int((~values.isfinite()).sum())} entries not finite."
        )
    if is_per_texel(model):
        raise ValueError("fit_measurements needs parameters that all samples share; found one with pixel axes.")
    cosines = measurements.cosines()
    samples = int(cosines.above_horizon.sum())
    if not samples:
        raise ValueError(f"no sample is left to fit: none of {len(values)} has light and view above the horizon.")
    model = copy.deepcopy(model).to(values.dtype)
    everywhere = torch.arange(len(values))
    unknowns = Unknowns(model, everywhere, len(values), 1, free_exposure=False, free_ambient=False)
    predict = sample_predictor(cosines, model)
    channels = predict(unknowns.unpack(*unknowns.pack())[0]).shape[-1]
    if channels not in (1, values.shape[-1]):
        raise ValueError(f"the measurements have {values.shape[-1]} wavelengths, and the model {channels}.")
    target = weighted_reflectance(cosines, values, knee)

    def residual(shared: Tensor, own: Tensor) -> Tensor:
        raw, _, _ = unknowns.unpack(shared, own)
        return (weighted_reflectance(cosines, predict(raw), knee) - target)[None]

    best = best_of_starts(
        Residuals(residual), unknowns.pack()[1], unknowns, starts=starts, seed=seed, max_steps=max_steps
    )
    return judged(
        model, unknowns, best, samples=samples * values.shape[-1], unit="1/sr", throw=throw, began=began
    )  # fmt: skip


def weighted_reflectance(cosines: Cosines, values: Tensor, knee: float = math.inf) -> Tensor:
    r"""f_r (sample, channel) as `fit_measurements` compares it. [1/sr]

    .. math:: k \,\mathrm{asinh}(y / k), \quad y = f_r \cos\theta_i \cos\theta_r

    The cosines take the weight from grazing directions, where f_r is a small signal divided by one. y itself
    below the knee k [1/sr], its logarithm far above: there the relative error counts. 0 below the horizon.
    Source: the cosine weight and the logarithm are those of Loew, Kronander, Ynnerman & Unger 2012, "BRDF models for
        accurate and efficient rendering of glossy surfaces", DOI 10.1145/2077341.2077350, made symmetric in light and
        view.
    """
    y = cosines.zero_below_horizon(values * (cosines.light * cosines.view)[:, None])
    return y if math.isinf(knee) else knee * (y / knee).asinh()
