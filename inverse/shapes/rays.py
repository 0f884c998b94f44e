"""Rays: where they start off a surface, and where they enter and leave boxes. Everything in float64."""

import torch
from torch import Tensor

# How far off the surface, along its normal, rays start: a share of the point's largest coordinate, a hundred times
# the rounding of float32, so that points stored in either precision are hidden alike.
_CLEARANCE = 1e-5


def lifted(points: Tensor, normals: Tensor) -> Tensor:
    """Points (point, 3) a hair off the surface, where rays may start, in float64."""
    points = points.double()
    return points + _CLEARANCE * points.abs().amax(-1, keepdim=True) * normals.double()


def dots(a: Tensor, b: Tensor) -> Tensor:
    """Dot products (...) of vectors (..., 3), in a third of the time that a sum over the last dimension takes."""
    (ax, ay, az), (bx, by, bz) = a.unbind(-1), b.unbind(-1)
    return ax * bx + ay * by + az * bz


def slab(start: Tensor, along: Tensor, size: Tensor | float) -> tuple[Tensor, Tensor]:
    """Where a ray enters and leaves |coordinate| < size, each (...); enter > leave where it never is inside."""
    parallel = along == 0
    step = along.masked_fill(parallel, 1.0)
    one, other = (-size - start) / step, (size - start) / step
    never, always = parallel & (start.abs() >= size), parallel & (start.abs() < size)
    enter = torch.minimum(one, other).masked_fill(never, torch.inf).masked_fill(always, -torch.inf)
    leave = torch.maximum(one, other).masked_fill(never, -torch.inf).masked_fill(always, torch.inf)
    return enter, leave


def box(start: Tensor, along: Tensor, sizes: Tensor) -> tuple[Tensor, Tensor]:
    """`slab` in all three coordinates (..., 3)."""
    enter, leave = slab(start, along, sizes)
    return enter.amax(-1), leave.amin(-1)


def row(values, like: Tensor) -> Tensor:
    """Numbers as a float64 tensor on the device of another."""
    return torch.tensor(values, dtype=torch.float64, device=like.device)
