"""A depth map as a solid: what the camera sees, and everything behind it."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from inverse.shapes.rays import box, row
from inverse.shapes.solids import Absence, Body

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
        # a trial after each pixel; a steeper ray is through the relief within a few
        lowest, highest = (float(k) for k in torch.aminmax(self.heights[self.heights.isfinite()]))
        sizes = row([(k - 1) / 2 for k in self.heights.shape[::-1]] + [(highest - lowest) / 2 + 1], origin)
        middle = row((sizes[0], -sizes[1], (highest + lowest) / 2), origin)
        start, beyond = box(flat_origin - middle, flat_direction, sizes)
        start = start.clamp(min=0)
        pace = 1 / flat_direction[:, :2].abs().amax(-1).maximum(flat_direction[:, 2].abs() / sizes[2])
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

    def why_no_exchange(self) -> Absence | None:
        return Absence("unknown: nothing but the visible side is given", certain=False)

    def normal(self, points: Tensor) -> Tensor:
        # central differences; one-sided at the image's edges
        down, right = torch.gradient(self.heights)
        slopes = [_bilinear(k, points.double()) for k in (right, -down)]
        upward = torch.stack((-slopes[0], -slopes[1], torch.ones_like(slopes[0])), -1)
        return (upward / upward.norm(dim=-1, keepdim=True)).to(points.dtype)

    def _behind(self, points: Tensor) -> Tensor:
        return points[..., 2] < _bilinear(self.heights, points)  # False next to NaN

    def _crossing(self, origin: Tensor, direction: Tensor, low: Tensor, high: Tensor) -> Tensor:
        for _ in range(_BISECTIONS):
            mid = (low + high) / 2
            behind = self._behind(origin + mid[:, None] * direction)
            low, high = torch.where(behind, low, mid), torch.where(behind, mid, high)
        return high


def _bilinear(image: Tensor, points: Tensor) -> Tensor:
    """Values (...) of an image (rows, columns) at points (..., 3) inside it; NaN next to a NaN."""
    rows, columns = image.shape
    x = 2 * points[..., 0] / max(columns - 1, 1) - 1
    y = -2 * points[..., 1] / max(rows - 1, 1) - 1
    grid = torch.stack((x, y), -1).reshape(1, 1, -1, 2)
    values = grid_sample(image[None, None], grid, padding_mode="border", align_corners=True)
    return values.reshape(points.shape[:-1])
