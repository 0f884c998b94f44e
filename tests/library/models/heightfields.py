"""Directions, golden values and traced surfaces for the tests of the heightfield models."""

import json
import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from torchbrdf import MESHED_HEIGHTFIELD, Cosines, GaussianHeightfield, fixed, sigma_from_rms_slope

F64 = torch.float64
DATA = Path(__file__).parents[2] / "data"


def f64(value) -> Tensor:
    return torch.as_tensor(value, dtype=F64)


def held(value) -> fixed:
    return fixed(f64(value))


def rotation(generator: torch.Generator) -> Tensor:
    q, r = torch.linalg.qr(torch.randn(3, 3, dtype=F64, generator=generator))
    q = q * r.diagonal().sign()
    return q * torch.linalg.det(q)


def vectors(theta_i, theta_r, dphi, turn: Tensor | None = None) -> tuple[Tensor, Tensor, Tensor]:
    """Unit vectors (..., 3) at polar angles and azimuth difference (...) [rad], in a frame turned by a rotation."""
    i, r, d = torch.broadcast_tensors(f64(theta_i), f64(theta_r), f64(dphi))
    normal = torch.stack((0 * i, 0 * i, 0 * i + 1), -1)
    light = torch.stack((i.sin(), 0 * i, i.cos()), -1)
    view = torch.stack((r.sin() * d.cos(), r.sin() * d.sin(), r.cos()), -1)
    if turn is not None:
        normal, light, view = (v @ turn.T for v in (normal, light, view))
    return normal, light, view


def cosines(theta_i, theta_r, dphi, turn: Tensor | None = None) -> Cosines:
    return Cosines.of(*vectors(theta_i, theta_r, dphi, turn), normalize=True)


@lru_cache(maxsize=1)
def golden() -> dict[str, Tensor]:
    """The golden values by name, each (168,)."""
    values = json.loads((DATA / "heightfield.json").read_text())["values"]
    return {name: f64([entry[name] for entry in values]) for name in values[0]}


def golden_surface(rms_slope, occlusion, **settings) -> GaussianHeightfield:
    return GaussianHeightfield(
        albedo=held(1.0),
        sigma=fixed(sigma_from_rms_slope(f64(rms_slope))),
        occlusion=held(occlusion),
        constants=MESHED_HEIGHTFIELD,
        **settings,
    )


@lru_cache(maxsize=8)
def traced(name: str) -> tuple[float, Cosines, dict[str, Tensor]]:
    """Rms slope, directions (10, 10, 9) and what path tracing found there."""
    with np.load(DATA / "heightfield_traced.npz") as file:
        found = {key: f64(file[f"{name}_{key}"]) for key in ("f1", "f2", "full_0.9", "se")}
        theta, slope = f64(file["theta"]), float(file[f"{name}_s"])
    dphi = torch.arange(9, dtype=F64) * (math.pi / 8)
    return slope, cosines(theta[:, None, None], theta[:, None], dphi), found


def rms(error: Tensor) -> float:
    return float(error.square().mean().sqrt())


def all_azimuths(error: Tensor) -> Tensor:
    """Entries (..., 9) of dphi in [0, pi] repeated as those of the whole turn: (..., 16)."""
    return torch.cat((error, error[..., 1:-1]), -1)
