"""Which terms, and with which coefficients: matching pursuit and a reweighted linear fit."""

import math

import torch
from torch import Tensor


def pursue(designs: list[Tensor], targets: list[Tensor], count: int) -> list[int]:
    """Orthogonal matching pursuit: indices of `count` of the N candidates; designs (S)(rows, N), targets (S)(rows)."""
    left, rest = torch.stack(designs), torch.stack(targets)
    start = left.square().sum(1)
    scale = rest.square().sum(1, keepdim=True)
    chosen: list[int] = []
    for _ in range(count):
        norms = left.square().sum(1)
        gain = torch.einsum("srn,sr->sn", left, rest).square() / norms.clamp(min=1e-30) / scale
        gain = torch.where(norms > 1e-9 * start, gain, 0.0).sum(0)
        gain[chosen] = -1
        chosen.append(int(gain.argmax()))
        column = left[..., chosen[-1]]
        length = column.square().sum(1, keepdim=True).sqrt()
        unit = torch.where(length > 0, column / length.clamp(min=1e-30), 0.0)
        rest = rest - unit * (unit * rest).sum(1, keepdim=True)
        left = left - unit[..., None] * torch.einsum("sr,srn->sn", unit, left)[:, None]
    return chosen


def solve(
    designs: list[Tensor], targets: list[Tensor], series: list[Tensor], rounds: int = 7, pull: float = 0.15
) -> Tensor:
    """Coefficients (N, M) of all roughnesses at once; designs (S)(rows, N), series (S)(N, M).

    Rows of one roughness are first reduced to N by QR, exactly. Weights grow with the error of the round before.
    """
    n, length = series[0].shape
    weights = [torch.ones_like(t) for t in targets]
    found = torch.zeros(n, length, dtype=torch.float64)
    for turn in range(rounds):
        rows, sides = [], []
        for design, target, weight, part in zip(designs, targets, weights, series, strict=True):
            q, r = torch.linalg.qr(design * weight[:, None])
            rows.append((r[:, :, None] * part[None]).reshape(n, -1))
            sides.append(q.T @ (target * weight))
        full, side = torch.cat(rows), torch.cat(sides)
        scale = full.norm(dim=0).clamp(min=1e-30)
        ridge = 3e-6 * math.sqrt(len(designs)) * torch.eye(n * length, dtype=torch.float64)
        found = (
            torch.linalg.lstsq(
                torch.cat((full / scale, ridge)),
                torch.cat((side, torch.zeros(n * length, dtype=torch.float64)))[:, None],
                driver="gelsd",
            ).solution[:, 0]
            / scale
        )
        found = found.reshape(n, length)
        if turn < rounds - 1:
            for k, (design, target, part) in enumerate(zip(designs, targets, series, strict=True)):
                error = design @ (part * found).sum(-1) - target
                spread = error.square().mean().sqrt().clamp(min=1e-12)
                weights[k] = (1 + pull * (error / spread).square()).clamp(max=4).sqrt()
    return found
