"""A depth map as a solid: what the camera sees, and everything behind it."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import grid_sample, max_pool2d

from inverse.shapes.rays import box, row
from inverse.shapes.solids import Absence, Body

# Trials that are looked at together: where the ray is above the highest point of the pixels around, none is behind.
_RUNS = (64, 16, 4)
# Rays looked at together: their numbers stay in the processor's cache.
_RAYS = 4096
# By this share of a height a ray must be above it, to be so with every rounding.
_ROUNDING = 1e-12
# Trials between which the rays that are decided are put aside.
_BATCH = 16
_BISECTIONS = 40


@dataclass(frozen=True, eq=False)
class HeightField(Body):
    """Relief z = height over the pixels of an image: x = column, y = -row. [pixel]

    Attributes:
        heights: towards the camera (rows, columns); NaN where nothing is known. Bilinear between pixels.
    Every point behind the relief counts as solid, since the camera cannot tell: an overhang or a gap behind a front
    rim is filled. Nothing is known outside the image and where a corner of a pixel's square is NaN: such places
    hide no light, though the object may well go on there.
    """

    heights: Tensor

    def __post_init__(self):
        if self.heights.ndim != 2 or not self.heights.isfinite().any():
            raise ValueError(
                f"HeightField.heights must be (rows, columns) with a finite entry; found {tuple(self.heights.shape)}."
            )
        object.__setattr__(self, "heights", self.heights.detach().double())

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        """First crossing from in front to behind, by trials one pixel apart in the image, then by bisection."""
        origin, direction = torch.broadcast_tensors(origin.double(), direction.double())
        flat_origin, flat_direction = origin.reshape(-1, 3), direction.reshape(-1, 3)
        result = flat_origin.new_full((len(flat_origin),), torch.inf)
        start, beyond, pace = self._path(flat_origin, flat_direction)
        rays, trial = (start < beyond).nonzero()[:, 0], 0
        outside = torch.ones_like(rays, dtype=torch.bool)
        while len(rays):
            open_, high = torch.ones_like(outside), start[rays]
            for _ in range(_BATCH):
                low = start[rays] + trial * pace[rays]
                high = torch.minimum(low + pace[rays], beyond[rays])
                behind = self._behind(flat_origin[rays] + high[:, None] * flat_direction[rays])
                met = (open_ & outside & behind).nonzero()[:, 0]
                if len(met):
                    which = rays[met]
                    result[which] = self._crossing(flat_origin[which], flat_direction[which], low[met], high[met])
                    open_[met] = False
                outside, trial = ~behind, trial + 1
            open_ &= high < beyond[rays]
            rays, outside = rays[open_], outside[open_]
        return result.reshape(origin.shape[:-1])

    def blocks(self, origin: Tensor, direction: Tensor, reach: Tensor | float = math.inf) -> Tensor:
        """`hit` before `reach`, at the same trials; runs of them that pass above all there is below are left out."""
        shape = torch.broadcast_shapes(origin.shape, direction.shape)[:-1]
        start_at, along = (k.double().expand(*shape, 3).reshape(-1, 3) for k in (origin, direction))
        reach = torch.as_tensor(reach).to(start_at).expand(shape).reshape(-1)
        start, beyond, pace = self._path(start_at, along)
        paths = torch.stack((*start_at.unbind(-1), *along.unbind(-1), start, pace, beyond, beyond.minimum(reach)), -1)
        first = torch.full_like(reach, torch.inf)
        inside = (start < paths[:, -1]).nonzero()[:, 0]
        for some in inside.split(_RAYS) if len(inside) else ():
            first[some] = self._first_behind(paths[some])
        beyond = (first + pace).minimum(beyond)
        blocked = first.isfinite() & (beyond < reach)
        unsure = (first.isfinite() & ~blocked).nonzero()[:, 0]  # whether before or behind the lamp
        crossing = self._crossing(start_at[unsure], along[unsure], first[unsure], beyond[unsure])
        blocked[unsure] = crossing < reach[unsure]
        return blocked.reshape(shape)

    def why_no_exchange(self) -> Absence | None:
        return Absence("unknown: nothing but the visible side is given", certain=False)

    def normal(self, points: Tensor) -> Tensor:
        # central differences; one-sided at the image's edges
        down, right = torch.gradient(self.heights)
        slopes = [_bilinear(k, *points.double().unbind(-1)[:2]) for k in (right, -down)]
        upward = torch.stack((-slopes[0], -slopes[1], torch.ones_like(slopes[0])), -1)
        return (upward / upward.norm(dim=-1, keepdim=True)).to(points.dtype)

    def _path(self, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Distances at which rays enter and leave the box around the relief, and between two trials, each (ray,)."""
        lowest, highest = (float(k) for k in torch.aminmax(self.heights[self.heights.isfinite()]))
        sizes = row([(k - 1) / 2 for k in self.heights.shape[::-1]] + [(highest - lowest) / 2 + 1], origin)
        middle = row((sizes[0], -sizes[1], (highest + lowest) / 2), origin)
        start, beyond = box(origin - middle, direction, sizes)
        # a trial after each pixel; a steeper ray is through the relief within a few
        pace = 1 / direction[:, :2].abs().amax(-1).maximum(direction[:, 2].abs() / sizes[2])
        return start.clamp(min=0), beyond, pace

    @cached_property
    def _highest(self) -> dict[int, Tensor]:
        """By length of a run of trials: the highest that the relief is where it passes, by the pixel of its middle."""
        top, reached, tops = self.heights.nan_to_num(-torch.inf)[None, None], 0, {}
        for run in reversed(_RUNS):
            # half a run, half a pixel by which its middle is rounded, and the corners of the pixels' squares
            half = run // 2 + 2
            for size in ((2 * (half - reached) + 1, 1), (1, 2 * (half - reached) + 1)):
                top = max_pool2d(top, size, 1, (size[0] // 2, size[1] // 2))
            tops[run], reached = top[0, 0], half
        return tops

    def _first_behind(self, paths: Tensor) -> Tensor:
        """Distance (ray,) of the trial before the first that is behind the relief, inf where none is, of `_Path`s
        (ray, 10)."""
        ray, trial = torch.arange(len(paths), device=paths.device), paths.new_zeros(len(paths))
        whole = _Path(*paths.unbind(-1))
        longest = int(((whole.end - whole.start) / whole.pace).amax()) + 1
        for run, parent in zip(_RUNS, (longest, *_RUNS), strict=False):
            some = _Path(*paths.index_select(0, ray)[:, None].unbind(-1))
            low = some.start + (trial[:, None] + torch.arange(0, parent, run, device=ray.device)) * some.pace
            open_ = (low < some.end) & self._may_be_behind(some, low, low + run * some.pace, run)
            which, part = open_.nonzero().unbind(-1)
            ray, trial = ray[which], trial[which] + part * run
        some = _Path(*paths.index_select(0, ray)[:, None].unbind(-1))
        low = some.start + (trial[:, None] + torch.arange(_RUNS[-1], device=ray.device)) * some.pace
        high = torch.minimum(low + some.pace, some.beyond)
        x, y, z = some.x + high * some.dx, some.y + high * some.dy, some.z + high * some.dz
        earliest = low.where((low < some.end) & (z < _bilinear(self.heights, x, y)), torch.inf).amin(-1)
        return torch.full_like(whole.start, torch.inf).scatter_reduce(0, ray, earliest, "amin")

    def _may_be_behind(self, path: "_Path", low: Tensor, high: Tensor, run: int) -> Tensor:
        """False (...) where no point between two distances, `run` trials apart, is behind the relief."""
        middle = (low + high) / 2
        rows, columns = self.heights.shape
        column = (path.x + middle * path.dx).round().long().clamp(0, columns - 1)
        line = (-path.y - middle * path.dy).round().long().clamp(0, rows - 1)
        top = self._highest[run].to(low.device)[line, column]
        return (path.z + path.dz * low).minimum(path.z + path.dz * high) <= top + _ROUNDING * top.abs()

    def _behind(self, points: Tensor) -> Tensor:
        return points[..., 2] < _bilinear(self.heights, points[..., 0], points[..., 1])  # False next to NaN

    def _crossing(self, origin: Tensor, direction: Tensor, low: Tensor, high: Tensor) -> Tensor:
        for _ in range(_BISECTIONS):
            mid = (low + high) / 2
            behind = self._behind(origin + mid[:, None] * direction)
            low, high = torch.where(behind, low, mid), torch.where(behind, mid, high)
        return high


class _Path(NamedTuple):
    """Rays, each number (...): origin, unit direction, and the distances at which trials start, how far they are
    apart, where the box around the relief is left, and beyond which nothing matters."""

    x: Tensor
    y: Tensor
    z: Tensor
    dx: Tensor
    dy: Tensor
    dz: Tensor
    start: Tensor
    pace: Tensor
    beyond: Tensor
    end: Tensor


def _bilinear(image: Tensor, x: Tensor, y: Tensor) -> Tensor:
    """Values (...) of an image (rows, columns) at points (...) inside it; NaN next to a NaN."""
    rows, columns = image.shape
    grid = torch.stack((2 * x / max(columns - 1, 1) - 1, -2 * y / max(rows - 1, 1) - 1), -1).reshape(1, 1, -1, 2)
    values = grid_sample(image[None, None], grid, padding_mode="border", align_corners=True)
    return values.reshape(x.shape)
