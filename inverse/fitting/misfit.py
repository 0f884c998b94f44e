"""Residuals that are no noise: what a fit that has converged may still be wrong about."""

import math
from statistics import NormalDist

import torch
from torch import Tensor

from inverse.scene import Sensor

# Share of clean fits that each of the questions below may call suspicious; there are three.
_FALSE_ALARMS = 1e-3
# How much wider than the median of the others the residuals of an image are that is named alone.
_OUTSTANDING = 2.0
# Samples that place the limits of the classes of brightness.
_ENOUGH = 8192


def warnings_of(sensor: Sensor, predicted: Tensor, residuals: Tensor, used: Tensor, unknowns: int) -> tuple[str, ...]:
    """What residuals (image, pixel, channel) of a sensor of known noise say against the fit; empty where nothing.

    Three questions, each with a false alarm in at most 1 of 1000 fits to photographs with the stated noise: are they
    larger than it (chi-square), in some image (the same of each), and is their mean other than 0 in one of ten classes
    of brightness?
    A sensor that states no noise says nothing.

    Args:
        used: bool of the residuals' shape; the others do not count.
        unknowns: number of fitted values.
    """
    if not sensor.noisy:
        return ()
    from scipy.special import chdtri  # deferred: half a second

    variance = sensor.variance(predicted)
    if sensor.bits is not None:
        variance = variance + (1 / (2**sensor.bits - 1)) ** 2 / 12
    squares = (residuals.square() / variance).where(used, 0.0).double()
    counts, sums = used.sum((1, 2)).double(), squares.sum((1, 2))
    freedom = float(counts.sum()) - unknowns
    if freedom <= 0:
        return ()
    notes = []
    widths = (sums / counts.clamp(min=1)).sqrt()
    if float(sums.sum()) > chdtri(freedom, _FALSE_ALARMS):
        wider = math.sqrt(float(sums.sum()) / freedom)
        notes.append(f"the residuals are {wider:.2g} times as wide as the sensor's noise")
    limits = torch.tensor(chdtri(counts.clamp(min=1).numpy(), _FALSE_ALARMS / len(counts)))
    loud = ((sums > limits) & (counts > 0)).nonzero()[:, 0].tolist()
    typical = widths[counts > 0].median()
    outstanding = [k for k in loud if widths[k] > _OUTSTANDING * typical]
    if loud:
        named = outstanding or loud
        listed = ", ".join(f"{k} ({widths[k]:.2g} times the noise)" for k in named)
        cause = "its light, place or exposure may be another" if outstanding else "lights, shape or model may be off"
        notes.append(f"image {listed}: {cause}")
    return (*notes, *_by_brightness(predicted, residuals, variance, used))


def _by_brightness(predicted: Tensor, residuals: Tensor, variance: Tensor, used: Tensor) -> tuple[str, ...]:
    """Whether the mean residual differs from 0 in one of ten classes of brightness."""
    z, level = (residuals / variance.sqrt())[used].double(), predicted[used].double()
    some = level[:: max(1, len(level) // _ENOUGH)]  # the classes need not be equal, only chosen without the residuals
    limits = torch.quantile(some, torch.arange(1, 10, dtype=torch.float64, device=some.device) / 10)
    place = torch.bucketize(level, limits)
    counts = torch.bincount(place, minlength=10)
    sums = torch.bincount(place, z, minlength=10)[counts > 0]
    counts = counts[counts > 0]
    worst = float((sums.abs() / counts.sqrt()).max())
    if worst <= -NormalDist().inv_cdf(_FALSE_ALARMS / 2 / len(counts)):
        return ()
    return ("the residuals follow the brightness: model, exposure or linearity may be off",)
