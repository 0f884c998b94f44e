"""What one model calls its roughness in the words of another: fitted to the Gaussian heightfield.

Sigma, the rms slope and the alpha of Beckmann's distribution name one slope distribution: conversions between them are
formulas (`rms_slope_from_sigma`, `rms_slope_from_beckmann_alpha`). The roughness r of Fujii's model and of EON names no
slopes: the r meant here is the one with the least rms relative error of the BRDF.
"""

import math
from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.models.heightfield.surface import GaussianHeightfield
from torchbrdf.parameters import ROUGHNESS, fixed

_ALBEDOS = (0.3, 0.6, 0.9)
_ANGLES = 14  # of light, of view and between their azimuths
_LARGEST = math.radians(85)
_STEPS = 1000  # of r, from 0 to 1
# Roughness of EON and of Fujii's model, every 2.5 degrees of sigma: `examples/benchmarks/roughness_conversions.py`.
_STEP = math.radians(2.5)
_EON = (
    0.0, 0.012, 0.047, 0.107, 0.191, 0.29, 0.392, 0.485, 0.564, 0.631, 0.687, 0.736, 0.779, 0.818,
    0.852, 0.883, 0.911, 0.935, 0.957, 0.977, 0.995, 1.0, 1.0, 1.0, 1.0,
)  # fmt: skip
_FUJII = (
    0.0, 0.011, 0.042, 0.095, 0.169, 0.258, 0.351, 0.438, 0.513, 0.577, 0.632, 0.679, 0.722, 0.759,
    0.792, 0.822, 0.849, 0.873, 0.894, 0.913, 0.93, 0.945, 0.959, 0.972, 0.983,
)  # fmt: skip


def fitted_roughness(build: Callable[[Tensor, Tensor], BRDF], sigma: Tensor) -> tuple[Tensor, Tensor]:
    """Roughness r [-] in [0, 1] with which a model is closest to a Gaussian heightfield, and its rms relative error.

    Args:
        build: makes the model from albedo and r, scalar or (...).
        sigma: of the heightfield, scalar. [rad]
    Light and view up to 85 degrees and the azimuth between them are uniform; albedo 0.3, 0.6 and 0.9, the same in both.
    """
    cosines = _grid()
    r = torch.linspace(0, 1, _STEPS + 1, dtype=torch.float64)
    with torch.no_grad():
        squares = []
        for rho in torch.tensor(_ALBEDOS, dtype=torch.float64):
            truth = GaussianHeightfield(albedo=rho, sigma=fixed(sigma.double())).evaluate(cosines)
            squares.append((build(rho, r[:, None]).evaluate(cosines) / truth - 1).square().mean((-2, -1)))
        error, place = torch.stack(squares).mean(0).sqrt().min(0)
    return r[place], error


def _grid() -> Cosines:
    middle = (torch.arange(_ANGLES, dtype=torch.float64) + 0.5) / _ANGLES
    light, view, azimuth = torch.cartesian_prod(_LARGEST * middle, _LARGEST * middle, math.pi * middle).T
    phase = light.cos() * view.cos() + light.sin() * view.sin() * azimuth.cos()
    return Cosines.from_products(light.cos(), view.cos(), phase)


def eon_roughness_from_sigma(sigma: Tensor) -> Tensor:
    """Roughness r (...) of `EON` [-] closest to a Gaussian heightfield of sigma (...) in [0, pi/2] [rad].

    Interpolated between fits every 2.5 degrees (`fitted_roughness`). Above 52 degrees EON is not rough enough: 1.
    """
    return _interpolated("eon_roughness_from_sigma", _EON, sigma)


def fujii_roughness_from_sigma(sigma: Tensor) -> Tensor:
    """As `eon_roughness_from_sigma`, for `FujiiOrenNayar`."""
    return _interpolated("fujii_roughness_from_sigma", _FUJII, sigma)


def _interpolated(name: str, values: tuple[float, ...], sigma: Tensor) -> Tensor:
    ROUGHNESS.check(f"{name}: sigma", sigma)
    degrees = np.arange(len(values)) * _STEP
    return torch.as_tensor(np.interp(sigma.detach().cpu().numpy(), degrees, values), dtype=sigma.dtype)
