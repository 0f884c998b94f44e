"""The solid of revolution: the vase and its like."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from inverse.shapes.climbing import Ascent, Climb
from inverse.shapes.form_factors import Exchange, RingExchange
from inverse.shapes.patches import Patches, disc, joined
from inverse.shapes.rays import box, row
from inverse.shapes.solids import Absence, Body

# Smallest height that a ray climbs a unit of length: a level ray is taken as one that climbs this much,
# a trillionth of the solid's size over its width.
_LEVEL = 1e-12
_PATCHES = 16384  # of the wall, whose rings are alike


@dataclass(frozen=True)
class Revolution(Body):
    """Solid of revolution about the y axis, closed by discs at both ends.

    Attributes:
        radius: r(y) for a NumPy array of heights in [low, high], positive inside.
        slope: its derivative dr/dy.
        low, high: the heights of the ends.
        steps: points tried along the part of a ray inside the surrounding box; a ray that dips into
            the solid between two of them passes. For shadows, the heights between which r(y)^2 is taken
            as straight.
        convex: say True where the profile is concave, to save the search for shadows.
    """

    radius: Callable
    slope: Callable
    low: float
    high: float
    steps: int = 256
    convex: bool = False

    def inside(self, points: Tensor) -> Tensor:
        """r(y)^2 - x^2 - z^2 (...) of float64 points: positive inside, between the ends."""
        x, y, z = points.unbind(-1)
        r = self._radii(y)
        return r * r - x * x - z * z

    def widest(self) -> float:
        """A radius that no height exceeds by more than the steps can tell."""
        heights = torch.linspace(self.low, self.high, 4 * self.steps, dtype=torch.float64)
        return float(torch.as_tensor(self.radius(heights.numpy())).max())

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        origin, direction = torch.broadcast_tensors(origin.double(), direction.double())
        flat = [k.reshape(-1, 3) for k in (origin, direction)]
        distances = [self._march(*piece) for piece in zip(*(k.split(1 << 14) for k in flat), strict=True)]
        return torch.cat(distances).reshape(origin.shape[:-1])

    def normal(self, points: Tensor) -> Tensor:
        x, y, z = points.double().unbind(-1)
        r, dr = self._radii(y), torch.as_tensor(self.slope(y.clamp(self.low, self.high).cpu().numpy())).to(y)
        side = torch.stack((x, -r * dr, z), -1)
        cap = torch.stack((0 * y, torch.where(y > (self.low + self.high) / 2, 1.0, -1.0).to(y), 0 * y), -1)
        unit = torch.where(self.on_end(points)[..., None], cap, side / side.norm(dim=-1, keepdim=True))
        return unit.to(points.dtype)

    def on_end(self, points: Tensor) -> Tensor:
        """True (...) for points of the surface (..., 3) that are nearer to one of the flat ends than to the wall."""
        x, y, z = points.double().unbind(-1)
        wall = (self._radii(y) - torch.hypot(x, z)).abs()
        return torch.minimum((y - self.low).abs(), (self.high - y).abs()) < wall

    def blocks(self, origin: Tensor, direction: Tensor, reach: Tensor | float = math.inf) -> Tensor:
        """By height, as a ray climbs or falls steadily: between two heights the squared distance from the axis is a
        parabola, which is below the straight r(y)^2 somewhere or nowhere: however level a ray, it skips nothing.
        """
        shape = torch.broadcast_shapes(origin.shape, direction.shape)[:-1]
        start, along = (k.double().expand(*shape, 3).reshape(-1, 3) for k in (origin, direction))
        reach = torch.as_tensor(reach).to(start).expand(shape).reshape(-1)
        blocked = torch.zeros(len(start), dtype=torch.bool, device=start.device)
        enter, leave = self._box(start, along)
        enter, leave = enter.clamp(min=0), torch.minimum(leave, reach)
        rising = along[:, 1] >= 0
        for same_way, flip in ((rising, False), (~rising, True)):
            rays = (same_way & (enter < leave)).nonzero()[:, 0]
            if len(rays):
                span = enter[rays], leave[rays]
                ascent = self._ascent(start[rays], along[rays], reach[rays], span, flip)
                blocked[rays] = self._climbs[flip].to(start.device).blocked(ascent)
        return blocked.reshape(shape)

    def why_unshaded(self, direction: Tensor | None) -> Absence | None:
        # a level ray stays in a cross-section; from a point of a disc that faces the light it leaves the disc
        if not self.convex and direction is not None and direction[1] == 0:
            return Absence("every level cross-section is a disc, which a level light lights to its limb")
        return super().why_unshaded(direction)

    def exchange(self, count: int | None) -> Exchange:
        rings = round(math.sqrt(count or _PATCHES))
        return RingExchange(self, self.wall(rings), rings, self.on_end)

    def wall(self, rings: int) -> Patches:
        """The surface between the ends in `rings` rings of `rings` patches, ring by ring from the lower end.

        The rings are as high as each other along the profile; their first patches lie at azimuth 0, towards +z.
        """
        fine = np.linspace(self.low, self.high, 16 * self.steps)
        length = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(fine), np.diff(self.radius(fine))))))
        heights = np.interp(np.linspace(0, length[-1], 2 * rings + 1), length, fine)
        r = self.radius(heights)
        areas = np.pi * (r[2::2] + r[:-1:2]) * np.hypot(np.diff(r[::2]), np.diff(heights[::2]))  # frustums
        turn = np.arange(rings) * (2 * np.pi / rings)
        x, z = np.outer(r[1::2], np.sin(turn)), np.outer(r[1::2], np.cos(turn))
        y = np.broadcast_to(heights[1::2, None], x.shape)
        points = torch.from_numpy(np.stack((x, y, z), -1).reshape(-1, 3))
        return Patches(points, self.normal(points), torch.from_numpy(np.repeat(areas / rings, rings)))

    def patches(self, count: int) -> Patches:
        wall = self.wall(round(math.sqrt(count)))
        pieces = [wall]
        for height, up in ((self.low, -1.0), (self.high, 1.0)):
            r = float(self.radius(np.array([height]))[0])
            x, z, areas = disc(math.ceil(math.pi * r * r / wall.areas.mean().item()), r)
            points = torch.stack((x, torch.full_like(x, height), z), -1)
            pieces.append(Patches(points, row((0.0, up, 0.0), x).expand(points.shape), areas))
        return joined(pieces)

    def _radii(self, heights: Tensor) -> Tensor:
        return torch.as_tensor(self.radius(heights.clamp(self.low, self.high).cpu().numpy())).to(heights)

    def _box(self, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
        """Where rays enter and leave the box around the solid, each (ray,)."""
        widest = self.widest()
        sizes = row((widest, (self.high - self.low) / 2, widest), origin)
        return box(origin - row((0.0, (self.low + self.high) / 2, 0.0), origin), direction, sizes)

    @cached_property
    def _climbs(self) -> tuple[Climb, Climb]:
        """The profile as it is, and turned over for rays that fall."""
        nodes = torch.linspace(self.low, self.high, self.steps + 1, dtype=torch.float64)
        squared = self._radii(nodes).square()
        return Climb(nodes, squared), Climb(-nodes.flip(0), squared.flip(0))

    def _ascent(
        self, origin: Tensor, direction: Tensor, reach: Tensor, span: tuple[Tensor, Tensor], flip: bool
    ) -> Ascent:
        """Rays that all climb, or with `flip` all fall, between two distances."""
        level, rise = origin[:, 1], direction[:, 1].abs().clamp(min=_LEVEL)
        end = level + reach * (-rise if flip else rise)
        own, end_squared = (self._radii(k).square() for k in (level, end))
        if flip:
            level, end = -level, -end
        flat = row((1.0, 0.0, 1.0), origin)
        a, b, c = (k.sum(-1) for k in ((origin * flat) ** 2, origin * direction * flat, (direction * flat) ** 2))
        return Ascent(a, b, c, level, rise, own, end, end_squared, *span)

    def _march(self, origin: Tensor, direction: Tensor) -> Tensor:
        """First crossing (ray,) from outside to inside, by `steps` trials and then by bisection."""
        start, beyond = self._box(origin, direction)
        start = start.clamp(min=0.0)
        rays = (start < beyond).nonzero()[:, 0]
        result = torch.full_like(start, torch.inf)
        if not len(rays):
            return result
        start, length = start[rays], (beyond - start)[rays]

        def value(share: Tensor) -> Tensor:
            t = start + share * length
            return self.inside(origin[rays] + t[:, None] * direction[rays])

        trials = torch.linspace(0.0, 1.0, self.steps + 1, dtype=torch.float64, device=origin.device)
        inside = torch.stack([value(trial) > 0 for trial in trials], -1)
        entering = inside & ~torch.cat((torch.zeros_like(inside[:, :1]), inside[:, :-1]), -1)
        met, first = entering.any(-1), entering.to(torch.uint8).argmax(-1)
        high = trials[first]
        low = (high - 1 / self.steps).clamp(min=0.0)
        for _ in range(40):
            mid = (low + high) / 2
            low, high = torch.where(value(mid) > 0, low, mid), torch.where(value(mid) > 0, mid, high)
        result[rays] = torch.where(met, start + high * length, torch.inf)
        return result
