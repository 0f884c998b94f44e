"""Levenberg-Marquardt for a network of two small layers whose outputs make the BRDF at several albedos."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf.models.network import Network, bounded
from torchbrdf.models.oren_nayar.coordinates import Coordinates
from torchbrdf.models.oren_nayar.fast import CavityFields, fields_from, reflectance

PIECE = 1500  # points at a time: what the Jacobian holds
SIZES = (1.2, 3.0, 1.5, 1.5, 1.5, 2.0, 1.5)  # bring the coordinates to one size
BIASES = (0.0, -2.5, -3.0, -4.0, 0.5)  # of the outputs, for a middling roughness
DAMPING = (1e-2, 1e-9, 1e8)  # at first, least, and where to give up
LOUDNESS = (0.3, 6.0)  # bounds of what a residual counts under stress
TWO_COUNTS = 0.7  # errors of two bounces beside those of all
ROUNDING = 1e-12  # of a matrix that may be singular


def start(hidden: tuple[int, int], seed: int) -> Network:
    """Random weights."""
    generator = torch.Generator().manual_seed(seed)

    def drawn(rows: int, columns: int, size: float) -> Tensor:
        return size * torch.randn(rows, columns, generator=generator, dtype=torch.float64)

    first, second = hidden
    return Network(
        drawn(first, len(SIZES), 1.2) * torch.tensor(SIZES, dtype=torch.float64),
        drawn(first, 1, 0.7),
        drawn(second, first, 1.5 / math.sqrt(first)),
        drawn(second, 1, 0.5),
        drawn(len(BIASES), second, 0.3 / math.sqrt(second)),
        torch.tensor(BIASES, dtype=torch.float64)[:, None],
    )


def packed(network: Network) -> Tensor:
    return torch.cat([t.flatten() for t in network])


def unpacked(vector: Tensor, like: Network) -> Network:
    sizes = vector.split([t.numel() for t in like])
    return Network(*(part.reshape(t.shape) for part, t in zip(sizes, like, strict=True)))


class Data(NamedTuple):
    """Points with what they have to give, n first."""

    features: Tensor  # (n, 7)
    growth: Tensor  # (n,)
    share: Tensor  # (n,)
    two: Tensor  # (n, albedo) [1/sr]
    all: Tensor  # (n, albedo) [1/sr]
    weight: Tensor  # (n,)

    def some(self, which: Tensor) -> "Data":
        return Data(*(field[which] for field in self))

    def pieces(self) -> Iterator["Data"]:
        return (Data(*piece) for piece in zip(*(field.split(PIECE) for field in self), strict=True))


def fields_of(outputs: Tensor, data: Data) -> CavityFields:
    """The model's fields (n,) of the outputs (5, n) themselves."""
    as_network = _Given(outputs)
    return fields_from(Coordinates(data.features.T, data.growth, data.share), as_network)  # pyright: ignore


class _Given(NamedTuple):
    """In place of a network: its outputs."""

    values: Tensor

    def outputs(self, features: Tensor) -> Tensor:
        del features
        return self.values


def errors(outputs: Tensor, data: Data, albedos: Tensor) -> Tensor:
    """Weighted relative errors (n, 2 albedo) of all and of two bounces."""
    fields = [field[:, None] for field in fields_of(outputs, data)]
    every, two = reflectance(albedos, *fields), reflectance(albedos, *fields[:2])
    return torch.cat((every / data.all - 1, TWO_COUNTS * (two / data.two - 1)), 1) * data.weight[:, None]


def errors_with_slopes(outputs: Tensor, data: Data, albedos: Tensor) -> tuple[Tensor, Tensor]:
    """The errors and their derivatives by the outputs (n, 2 albedo, 5)."""
    outputs = outputs.detach()
    seeds = torch.eye(len(outputs), dtype=outputs.dtype)[:, :, None].expand(-1, -1, outputs.shape[1])

    def along(seed: Tensor) -> tuple[Tensor, Tensor]:
        return torch.func.jvp(lambda o: errors(o, data, albedos), (outputs,), (seed,))

    values, slopes = zip(*(along(seed) for seed in seeds), strict=True)
    return values[0], torch.stack(slopes, -1)


def jacobian(network: Network, features: Tensor) -> Tensor:
    """Derivatives of the outputs by all weights (n, 5, weights), in the order of `packed`."""
    w1, b1, w2, b2, w3, _ = network
    u1 = features @ w1.T + b1.T
    h1 = bounded(u1) - bounded(b1.T)
    u2 = h1 @ w2.T + b2.T
    h2 = bounded(u2) - bounded(b2.T)
    last, last_bias = w3 * _slope(u2)[:, None], w3 * (_slope(u2) - _slope(b2.T))[:, None]
    inner = last @ w2
    first, first_bias = inner * _slope(u1)[:, None], inner * (_slope(u1) - _slope(b1.T))[:, None]
    count, outputs = len(features), len(w3)
    itself = torch.eye(outputs, dtype=w3.dtype).expand(count, outputs, outputs)
    blocks = (
        first[..., None] * features[:, None, None],
        first_bias,
        last[..., None] * h1[:, None, None],
        last_bias,
        itself[..., None] * h2[:, None, None],
        itself,
    )
    return torch.cat([block.reshape(count, outputs, -1) for block in blocks], -1)


def _slope(u: Tensor) -> Tensor:
    return torch.rsqrt(1 + u * u) ** 3


def loss_of(network: Network, data: Data, albedos: Tensor) -> Tensor:
    return errors(network.outputs(data.features.T), data, albedos).square().mean()


def fit(network: Network, data: Data, albedos: Tensor, *, steps: int, stress: float = 0.0) -> Network:
    """Least squares of the errors; with `stress` each counts by that times its size over the rms, bounded."""
    damping, least, most = DAMPING
    vector = packed(network)
    free = torch.ones_like(vector)
    free[-len(BIASES)] = 0  # the first output has no bias: a smooth surface is Lambert's
    loss = loss_of(network, data, albedos)
    for _ in range(steps):
        normal, gradient = _normal_equations(unpacked(vector, network), data, albedos, stress / loss.sqrt())
        normal = normal * free * free[:, None] + torch.diag(1 - free)
        scale = normal.diagonal() + normal.diagonal().mean() * torch.finfo(torch.float32).eps
        while True:
            step = torch.linalg.solve(normal + torch.diag(damping * scale), gradient * free)
            trial = loss_of(unpacked(vector - step, network), data, albedos)
            if trial < loss or (stress > 0 and trial < 1.1 * loss):
                break
            damping *= 4
            if damping > most:
                return unpacked(vector, network)
        vector, loss, damping = vector - step, trial, max(damping / 3, least)
    return unpacked(vector, network)


def _normal_equations(network: Network, data: Data, albedos: Tensor, stress: Tensor) -> tuple[Tensor, Tensor]:
    """J^T J and J^T r; with `stress` each squared residual counts by `stress` times its size."""
    count, outputs = len(packed(network)), len(BIASES)
    normal, gradient = torch.zeros(count, count, dtype=torch.float64), torch.zeros(count, dtype=torch.float64)
    for piece in data.pieces():
        r, slopes = errors_with_slopes(network.outputs(piece.features.T), piece, albedos)
        if stress > 0:
            louder = (r.abs() * stress).clamp(*LOUDNESS).sqrt()
            r, slopes = r * louder, slopes * louder[..., None]
        j = jacobian(network, piece.features)
        gradient += torch.einsum("nop,nko,nk->p", j, slopes, r)
        # Five rows a point have the products that the rows of all albedos have.
        square = slopes.mT @ slopes
        size = square.diagonal(dim1=-2, dim2=-1).sum(-1)[:, None, None]
        root = torch.linalg.cholesky(square + ROUNDING * size * torch.eye(outputs, dtype=torch.float64))
        rows = (root.mT.float() @ j.float()).flatten(0, 1)
        normal += (rows.T @ rows).double()
    return normal, gradient
