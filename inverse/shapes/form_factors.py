"""Which patches of a surface light which, and how strongly: the kernel of diffuse interreflection."""

import math
from collections.abc import Callable, Iterator
from typing import Protocol

import torch
from torch import Tensor

from inverse.shapes.patches import Patches
from inverse.shapes.rays import lifted

# Pairs of a point and a patch handled at once.
_PAIRS = 1 << 19


class Blocker(Protocol):
    """What may stand between two points: a `Solid`, whose rays tell."""

    def blocks(self, origin: Tensor, direction: Tensor, reach: Tensor | float = ...) -> Tensor:
        """True (...) where something is met along unit directions (..., 3) before the distance `reach` (...)."""
        ...


class Exchange(Protocol):
    """The light between the patches of one solid.

    Attributes:
        patches: in float64.
        share: of its cosine-weighted sky that each patch loses to the others (patch,).
    """

    patches: Patches
    share: Tensor

    def carry(self, exitance: Tensor) -> Tensor:
        """Irradiance of the patches (..., patch, channel) by their exitance (..., patch, channel)."""
        ...

    def arriving(self, exitance: Tensor, points: Tensor, normals: Tensor) -> Tensor:
        """Irradiance at points (..., point, channel) of the surface by the patches' exitance."""
        ...

    def share_at(self, points: Tensor, normals: Tensor) -> Tensor:
        """`share` at points (point, 3) of the surface."""
        ...


class PairExchange(Exchange):
    """Every pair of patches, and of points and patches; `blocker` is None where nothing stands between any two."""

    def __init__(self, blocker: Blocker | None, patches: Patches):
        self.patches, self._blocker = patches, blocker
        self._factors = torch.cat(list(self._pieces(patches.points, patches.normals)))
        self.share = self._factors.sum(-1)

    def carry(self, exitance: Tensor) -> Tensor:
        return self._factors @ exitance

    def arriving(self, exitance: Tensor, points: Tensor, normals: Tensor) -> Tensor:
        return torch.cat([factors @ exitance for factors in self._pieces(points, normals)], -2)

    def share_at(self, points: Tensor, normals: Tensor) -> Tensor:
        return torch.cat([factors.sum(-1) for factors in self._pieces(points, normals)])

    def _pieces(self, points: Tensor, normals: Tensor) -> Iterator[Tensor]:
        """Form factors (some points, patch), piece by piece."""
        size = max(1, _PAIRS // len(self.patches.areas))
        for piece in zip(points.double().split(size), normals.double().split(size), strict=True):
            yield form_factors(*piece, self.patches, self._blocker)


class RingExchange(Exchange):
    """A solid of revolution: rings look the same from every azimuth.

    The kernel depends on two heights and the difference of two azimuths, so it is computed for one azimuth only and
    applied as a product of Fourier series. Points take the irradiance of the patches around them, linear in
    height and azimuth; within half a patch of an end, that of the last ring. The flat ends see nothing of the solid
    and are left out: `on_end` tells their points (..., 3).
    """

    def __init__(self, blocker: Blocker, wall: Patches, rings: int, on_end: Callable[[Tensor], Tensor]):
        self.patches, self._on_end = wall, on_end
        # as seen from azimuth 0 both sides are alike
        half = [k.unflatten(0, (rings, rings))[:, : rings // 2 + 1] for k in self.patches]
        here = [k[:, 0] for k in half]
        factors = form_factors(here[0], here[1], Patches(*(k.flatten(0, 1) for k in half)), blocker)
        turns = torch.arange(rings)
        factors = factors.unflatten(1, (rings, -1))[..., torch.minimum(turns, rings - turns)]
        self._heights = here[0][:, 1].contiguous()
        self._series = torch.fft.rfft(factors)
        self.share = factors.sum((1, 2)).repeat_interleave(rings)

    def carry(self, exitance: Tensor) -> Tensor:
        rings = len(self._heights)
        series = torch.fft.rfft(exitance.unflatten(-2, (rings, rings)), dim=-2)
        carried = torch.einsum("hkf,...kfc->...hfc", self._series, series)
        return torch.fft.irfft(carried, rings, dim=-2).flatten(-3, -2)

    def arriving(self, exitance: Tensor, points: Tensor, normals: Tensor) -> Tensor:
        return self._at(self.carry(exitance), points)

    def share_at(self, points: Tensor, normals: Tensor) -> Tensor:
        return self._at(self.share[:, None], points)[..., 0]

    def _at(self, values: Tensor, points: Tensor) -> Tensor:
        """Values (..., patch, channel) at points (..., point, channel)."""
        points, rings = points.double(), len(self._heights)
        x, y, z = (k.contiguous() for k in points.unbind(-1))
        upper = torch.searchsorted(self._heights, y).clamp(1, rings - 1)
        low, high = self._heights[upper - 1], self._heights[upper]
        rise = ((y - low) / (high - low)).clamp(0, 1)[:, None]
        turn = torch.atan2(x, z) * (rings / (2 * math.pi))
        left, on = turn.floor().long(), (turn - turn.floor())[:, None]
        total = 0.0
        for row, by_height in ((upper - 1, 1 - rise), (upper, rise)):
            for column, by_turn in ((left, 1 - on), (left + 1, on)):
                total = total + by_height * by_turn * values[..., row * rings + column % rings, :]
        return total * ~self._on_end(points)[:, None]


def form_factors(points: Tensor, normals: Tensor, patches: Patches, blocker: Blocker | None) -> Tensor:
    r"""Share (point, patch) of the cosine-weighted sky of float64 points (point, 3) that each patch takes.

    .. math:: F = \frac{\cos\theta\,P}{\pi r^2 + P}, \qquad P = A \cos\theta'

    which is cos cos' A / (pi r^2) for a patch that is small at its distance r, and right for a disc straight ahead at
    any distance. A patch behind the blocker, or that faces away, has none.
    """
    squared, ahead, facing = points.new_zeros(3, len(points), len(patches.areas))
    for axis in range(3):
        apart = patches.points[:, axis] - points[:, axis, None]
        squared += apart * apart
        ahead += apart * normals[:, axis, None]
        facing -= apart * patches.normals[:, axis]
    here, there = ((ahead > 0) & (facing > 0)).nonzero().unbind(-1)
    if blocker is not None:
        start = lifted(points, normals)[here]
        apart = lifted(patches.points, patches.normals)[there] - start
        distance = apart.norm(dim=-1)
        seen = ~blocker.blocks(start, apart / distance[:, None], distance)
        here, there = here[seen], there[seen]
    distance = squared[here, there].sqrt()
    projected = patches.areas[there] * facing[here, there] / distance
    factors = torch.zeros_like(squared)
    factors[here, there] = ahead[here, there] / distance * projected / (math.pi * distance**2 + projected)
    return factors
