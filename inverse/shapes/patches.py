"""Surfaces in small pieces, for the light that goes between them."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

# Turn of a spiral from each patch to the next, which spreads them evenly over a ball or a disc. [rad]
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


class Patches(NamedTuple):
    """A surface in small pieces: points (patch, 3), unit normals that leave the solid (patch, 3), areas (patch,)."""

    points: Tensor
    normals: Tensor
    areas: Tensor


def spiral(count: int) -> Tensor:
    """Unit vectors (count, 3), float64, each in the middle of an equal share of the sphere."""
    y, turn = middles(count, 1.0), _GOLDEN_ANGLE * torch.arange(count)
    around = (1 - y * y).sqrt()
    return torch.stack((around * turn.sin(), y, around * turn.cos()), -1)


def joined(pieces: list[Patches]) -> Patches:
    """The patches of several surfaces as those of one."""
    return Patches(*(torch.cat(values) for values in zip(*pieces, strict=True)))


def middles(count: int, half: float) -> Tensor:
    """Middles of `count` equal parts of [-half, half], float64."""
    return half * ((2 * torch.arange(count, dtype=torch.float64) + 1) / count - 1)


def disc(count: int, radius: float, core: float = math.inf) -> tuple[Tensor, Tensor, Tensor]:
    """A spiral over a disc: two coordinates and areas, each (count,). Patches grow with the distance beyond `core`."""
    share = (torch.arange(2 * count + 1, dtype=torch.float64)) / (2 * count)
    if core == math.inf:
        squared = radius**2 * share
    else:
        squared = core**2 * ((1 + (radius / core) ** 2) ** share - 1)
    turn, distance = _GOLDEN_ANGLE * torch.arange(count), squared[1::2].sqrt()
    return distance * turn.cos(), distance * turn.sin(), math.pi * squared[::2].diff()
