"""Levenberg-Marquardt for a network of two small layers whose four outputs make the BRDF at several albedos."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf.models.heightfield.coordinates import Coordinates
from torchbrdf.models.heightfield.fast import Network, fields_from, reflectance

PIECE = 1000  # points at a time: what the Jacobian holds
FEATURES, OUTPUTS = 7, 4
DAMPING = (1e-2, 1e-9, 1e8)  # at first, least, and where to give up
LOUDNESS = (0.3, 6.0)  # bounds of what a residual counts under stress


def start(hidden: tuple[int, int], seed: int) -> Network:
    """Random weights; the last biases are those of a middling roughness."""
    generator = torch.Generator().manual_seed(seed)

    def drawn(rows: int, columns: int, size: float) -> Tensor:
        return size * torch.randn(rows, columns, generator=generator, dtype=torch.float64)

    first, second = hidden
    return Network(
        drawn(first, FEATURES, 1.2),
        drawn(first, 1, 0.7),
        drawn(second, first, 1.5 / math.sqrt(first)),
        drawn(second, 1, 0.5),
        drawn(OUTPUTS, second, 0.3 / math.sqrt(second)),
        torch.tensor([[0.0], [-2.5], [-3.0], [0.5]], dtype=torch.float64),
    )


def packed(network: Network) -> Tensor:
    return torch.cat([t.flatten() for t in network])


def unpacked(vector: Tensor, like: Network) -> Network:
    parts = vector.split([t.numel() for t in like])
    return Network(*(part.reshape(t.shape) for part, t in zip(parts, like, strict=True)))


class Data(NamedTuple):
    """Points with what they have to give, n first."""

    features: Tensor  # (n, 7)
    masked: Tensor  # (n,)
    share: Tensor  # (n,)
    truth: Tensor  # (n, albedo) [1/sr]
    weight: Tensor  # (n,)

    def first(self, count: int) -> "Data":
        return Data(*(field[:count] for field in self))

    def pieces(self) -> Iterator["Data"]:
        return (Data(*piece) for piece in zip(*(field.split(PIECE) for field in self), strict=True))


def residuals(network: Network, data: Data, albedos: Tensor) -> Tensor:
    """Weighted relative errors (n, albedo)."""
    parts = reflectance(albedos, fields_from(Coordinates(data.features.T, data.masked, data.share), network))
    f = parts["direct"] + parts["two_bounce"] + parts["higher"]
    return (f / data.truth - 1) * data.weight[:, None]


def jacobian(network: Network, data: Data, albedos: Tensor) -> Tensor:
    """d residual/d parameters (n, albedo, parameters)."""

    def one(vector: Tensor, point: Data) -> Tensor:
        return residuals(unpacked(vector, network), Data(*(field[None] for field in point)), albedos)[0]

    return torch.func.vmap(torch.func.jacrev(one), in_dims=(None, 0))(packed(network), data)


def fit(network: Network, data: Data, albedos: Tensor, *, steps: int, stress: float = 0.0) -> Network:
    """Least squares of the residuals; with `stress` each counts by that times its size over the rms, bounded."""
    damping, least, most = DAMPING
    vector = packed(network)
    kept = torch.ones_like(vector)
    kept[-OUTPUTS] = 0  # the first output has no bias: a smooth surface is Lambert's
    loss = residuals(network, data, albedos).square().mean()
    for _ in range(steps):
        normal, gradient = _normal_equations(unpacked(vector, network), data, albedos, stress / loss.sqrt())
        normal = normal * kept * kept[:, None] + torch.diag(1 - kept)
        scale = normal.diagonal() + normal.diagonal().mean() * torch.finfo(torch.float32).eps
        while True:
            step = torch.linalg.solve(normal + torch.diag(damping * scale), gradient * kept)
            trial = residuals(unpacked(vector - step, network), data, albedos).square().mean()
            if trial < loss or (stress > 0 and trial < 1.1 * loss):
                break
            damping *= 4
            if damping > most:
                return unpacked(vector, network)
        vector, loss, damping = vector - step, trial, max(damping / 3, least)
    return unpacked(vector, network)


def _normal_equations(network: Network, data: Data, albedos: Tensor, stress: Tensor) -> tuple[Tensor, Tensor]:
    """J^T J and J^T r; with `stress` each squared residual counts by `stress` times its size."""
    count = sum(t.numel() for t in network)
    normal, gradient = torch.zeros(count, count, dtype=torch.float64), torch.zeros(count, dtype=torch.float64)
    for piece in data.pieces():
        r, j = residuals(network, piece, albedos), jacobian(network, piece, albedos)
        if stress > 0:
            louder = (r.abs() * stress).clamp(*LOUDNESS).sqrt()
            r, j = r * louder, j * louder[..., None]
        gradient += torch.einsum("nkp,nk->p", j, r)
        rows = j.flatten(0, 1).float()
        normal += (rows.T @ rows).double()
    return normal, gradient
