"""Directions, golden values and traced surfaces for the tests of the heightfield models."""

import json
import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from torchbrdf import (
    MESHED_HEIGHTFIELD,
    Cosines,
    GaussianHeightfield,
    HeightfieldConstants,
    fixed,
    sigma_from_rms_slope,
)
from torchbrdf import testing as laws

F64 = torch.float64
DATA = Path(__file__).parents[1] / "data"


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


GOLDEN_SLOPES = sorted(set(golden()["s"].tolist()))


def golden_fields(nodes, polar_nodes=14):
    """Orders (168, bounces) and their names, at the golden configurations."""
    g = golden()
    found = torch.zeros(len(g["s"]), 25, dtype=F64)
    for slope in GOLDEN_SLOPES:
        for occlusion in (0.0, 1.0, 1.15):
            here = (g["s"] == slope) & (g["occlusion"] == occlusion)
            brdf = golden_surface(slope, occlusion, nodes=nodes, polar_nodes=polar_nodes)
            found[here] = brdf.fields(cosines(*(g[k][here] for k in ("theta_i", "theta_r", "dphi"))))
    return found


# A turn so fast that two rays know nothing of each other: l = 1.
UNCORRELATED = HeightfieldConstants(level=0.5, grazing=0.3, turn=1e9, grazing_turn=0.0)


def smith_masking(theta, slope):
    """Lambda by the error function: Smith 1967 for Gaussian slopes."""
    t = slope * math.tan(theta)
    nu = 1 / (math.sqrt(2) * t)
    return (math.exp(-nu * nu) / (nu * math.sqrt(math.pi)) - math.erfc(nu)) / 2


def weights(brdf, degrees, draws):
    setting = laws.SamplingSetup.of(brdf, math.radians(degrees))
    with torch.no_grad():
        return setting.draw(draws, torch.Generator().manual_seed(0)).weight[:, 0]
