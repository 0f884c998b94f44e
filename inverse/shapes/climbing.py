"""Whether rays that climb meet a solid of revolution: bounds first, and height by height where they leave it open."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

# Heights that one straight bound spans in the second look.
_SPAN = 16
# Rays looked at together: their numbers stay in the processor's cache.
_RAYS = 4096
# A bound clears a ray by more than the look height by height can err, as a share of the squares involved.
_ROUNDING = 1e-12


class Ascent(NamedTuple):
    """Rays that climb, each number (...): the squared distance from the axis is a + 2 b t + c t^2 at the distance t.

    Attributes:
        level, rise: height of the origin, and what is gained a unit of length, positive.
        own: r^2 of the solid at that height.
        end, end_squared: height at which a ray ends, and r^2 there.
        enter, leave: the distances between which it is inside the box around the solid.
    """

    a: Tensor
    b: Tensor
    c: Tensor
    level: Tensor
    rise: Tensor
    own: Tensor
    end: Tensor
    end_squared: Tensor
    enter: Tensor
    leave: Tensor

    def below(self, level: Tensor, slope: Tensor, excess: Tensor | float, first: Tensor, last: Tensor) -> Tensor:
        """Whether rays may come below r^2 = level + slope (y - y of the origin) + excess between two distances.

        False only where they surely do not.
        """
        drop = slope * self.rise
        lowest = ((drop / 2 - self.b) / self.c).nan_to_num(0.0).maximum(first).minimum(last)
        gap = self.a - level - excess + lowest * (2 * self.b - drop + self.c * lowest)
        return (first < last) & ~(gap > _ROUNDING * (self.a + level.abs() + excess))


class Climb:
    """A profile r(y)^2 that is straight between nodes, for rays that climb past it.

    Args:
        nodes: heights, ascending (node,).
        squared: r^2 there (node,).
    """

    def __init__(self, nodes: Tensor, squared: Tensor):
        self._nodes, self._squared = nodes, squared
        self._steepest = nodes.new_tensor(_steepest(nodes.tolist(), squared.tolist()))
        edges = torch.arange(0, len(nodes) + _SPAN - 1, _SPAN, device=nodes.device).clamp(max=len(nodes) - 1)
        within = (edges[:-1, None] + torch.arange(_SPAN + 1, device=nodes.device)).clamp(max=len(nodes) - 1)
        self._span_nodes, self._span_squared = nodes[within], squared[within]
        self._edges = nodes[edges]
        self._base = squared[edges[:-1]]
        self._slope = (squared[edges[1:]] - self._base) / self._edges.diff()
        straight = self._base[:, None] + self._slope[:, None] * (self._span_nodes - self._edges[:-1, None])
        self._excess = (self._span_squared - straight).amax(1).clamp(min=0)

    def to(self, device: torch.device) -> "Climb":
        """The same on a device."""
        return self if self._nodes.device == device else Climb(self._nodes.to(device), self._squared.to(device))

    def blocked(self, rays: Ascent) -> Tensor:
        """True (ray,) where a ray comes below the profile.

        The heights of both ends of the ray are nodes too, so that the chords touch the surface there.
        """
        blocked = torch.zeros_like(rays.a, dtype=torch.bool)
        open_ = self._below_the_hull(rays).nonzero()[:, 0]
        table = torch.stack(rays, -1)  # whose rows are gathered faster than ten tensors
        for some in open_.split(_RAYS):
            these = table.index_select(0, some)[:, None]
            ray, span = self._below_a_span(Ascent(*these.unbind(-1))).nonzero().unbind(-1)
            for pair, over in zip(ray.split(_RAYS), span.split(_RAYS), strict=True):
                ascent = Ascent(*these.index_select(0, pair).unbind(-1))
                blocked[some[pair[self._below_a_chord(ascent, over)]]] = True
        return blocked

    def _below_the_hull(self, rays: Ascent) -> Tensor:
        """Whether it may come below the straight line from the profile beside its start that tops all further nodes."""
        entry = rays.level + rays.rise * rays.enter
        upper = torch.searchsorted(self._nodes, entry, right=True).clamp(1, len(self._nodes) - 1)
        node, squared = self._nodes[upper - 1], self._squared[upper - 1]
        off = rays.level >= node  # between two nodes, and not far below the box
        node, squared = torch.where(off, rays.level, node), torch.where(off, rays.own, squared)
        slope = ((self._squared[upper] - squared) / (self._nodes[upper] - node)).maximum(self._steepest[upper])
        level = squared + slope * (rays.level - node)
        return rays.below(level, slope, _over(rays, level, slope, node, torch.inf), rays.enter, rays.leave)

    def _below_a_span(self, rays: Ascent) -> Tensor:
        """The same (ray, span) of a line above `_SPAN` heights, for rays (ray, 1)."""
        low, high = self._edges[:-1], self._edges[1:]
        level = self._base + self._slope * (rays.level - low)
        first = ((low - rays.level) / rays.rise).maximum(rays.enter)
        last = ((high - rays.level) / rays.rise).minimum(rays.leave)
        return rays.below(level, self._slope, self._excess + _over(rays, level, self._slope, low, high), first, last)

    def _below_a_chord(self, rays: Ascent, span: Tensor) -> Tensor:
        """Whether rays (ray, 1) come below the profile (ray,) somewhere in a span (ray,)."""
        nodes, squared = self._span_nodes.index_select(0, span), self._span_squared.index_select(0, span)
        over = nodes > rays.end
        nodes, squared = nodes.minimum(rays.end), torch.where(over, rays.end_squared, squared)
        ahead = nodes > rays.level
        nodes, squared = torch.where(ahead, nodes, rays.level), torch.where(ahead, squared, rays.own)
        below, below_squared, node = nodes[:, :-1], squared[:, :-1], nodes[:, 1:]
        first = ((below - rays.level) / rays.rise).maximum(rays.enter)
        last = ((node - rays.level) / rays.rise).minimum(rays.leave)
        slope = (squared[:, 1:] - below_squared) / (node - below)
        # a + 2 b t + c t^2 less the chord, at its lowest between first and last (0/0: upright by a straight wall)
        chord, drop = below_squared + slope * (rays.level - below), slope * rays.rise
        lowest = ((drop / 2 - rays.b) / rays.c).nan_to_num(0.0).maximum(first).minimum(last)
        gap = rays.a - chord + lowest * (2 * rays.b - drop + rays.c * lowest)
        return ((first < last) & (gap < 0)).any(1)


def _over(rays: Ascent, level: Tensor, slope: Tensor, low: Tensor, high: Tensor | float) -> Tensor:
    """How far the solid at a ray's ends, no nodes of the profile, is above a line between two heights."""
    start = (rays.own - level).where((rays.level >= low) & (rays.level <= high), 0.0)
    stop = rays.end_squared - level - slope * (rays.end - rays.level)
    stop = stop.where((rays.end >= low) & (rays.end <= high), 0.0)
    return start.maximum(stop).clamp(min=0)


def _steepest(nodes: list[float], squared: list[float]) -> list[float]:
    """Slope of the straight line from each node that no later node is above; the last has none."""

    def slope(one: int, other: int) -> float:
        return (squared[other] - squared[one]) / (nodes[other] - nodes[one])

    corners, slopes = [len(nodes) - 1], [-math.inf]  # of the hull of the later nodes, nearest last
    for node in reversed(range(len(nodes) - 1)):
        while len(corners) > 1 and slope(node, corners[-1]) <= slope(node, corners[-2]):
            corners.pop()
        slopes.append(slope(node, corners[-1]))
        corners.append(node)
    return slopes[::-1]
