"""Known shapes as solids: where a ray meets them first, and which way their surface faces there.

Cameras see them and lights are blocked by them, so every question is a ray's. Frame and unit are those of
`inverse.scene.surface`. Rays are answered in float64, whatever comes in.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from inverse.shapes.form_factors import Exchange, PairExchange
from inverse.shapes.patches import Patches, disc, joined, middles, spiral
from inverse.shapes.rays import box, row, slab
from torchbrdf import any_tangent

# How far a plane takes part in the light between it and what stands on it, in half sizes of that. A wall one half
# size above the plane loses the strip of it below the horizon: 2/(1000 pi) of its sky.
_FAR = 1000.0
_PAIRED_PATCHES = 1500  # where every pair counts


class Absence(NamedTuple):
    """Why an effect of light is not simulated.

    Attributes:
        reason: in words.
        certain: the effect is not there; False where it may be, and cannot be told.
    """

    reason: str
    certain: bool = True


class Solid(ABC):
    """A body, or several, that rays can meet.

    A solid of your own implements `hit` and `meet`; the other answers are safe ones that cost more than they need to.

    Attributes:
        convex: no straight line between two points of the surface leaves the solid.
        endless: a plane and its like, of which `patches` are only to be had near other bodies.
    """

    convex: bool = False
    endless: bool = False

    @abstractmethod
    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        """Distance (...) along unit directions (..., 3) at which rays from outside first enter; inf where they miss."""

    @abstractmethod
    def meet(self, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
        """`hit`, and the unit vectors (..., 3) that leave the solid there (arbitrary where the ray misses)."""

    def blocks(self, origin: Tensor, direction: Tensor, reach: Tensor | float = math.inf) -> Tensor:
        """True (...) where a ray from outside meets the solid at a distance below `reach` (...)."""
        return self.hit(origin, direction) < reach

    def why_unshaded(self, direction: Tensor | None) -> Absence | None:
        """Why no point whose surface faces a unit direction (3,), or None: any direction, is hidden from there by the
        solid itself; None where one may be."""
        return Absence("convex: a ray that leaves the surface meets it nowhere else") if self.convex else None

    def why_no_exchange(self) -> Absence | None:
        """Why no light goes from one part of the surface to another; None where some may."""
        return Absence("convex: no part of the surface sees another") if self.convex else None

    def patches(self, count: int) -> Patches:
        """The whole surface in about `count` pieces, float64. ValueError for a solid whose extent is unknown."""
        raise ValueError(f"{type(self).__name__} has no patches: it has no end, or its back is unknown.")

    def patches_near(self, points: Tensor, count: int) -> Patches:
        """Those of its surface that matter to bodies at points (point, 3): all of it, unless it is endless."""
        return self.patches(count)

    def exchange(self, count: int | None) -> Exchange:
        """The light between its parts, in about `count` patches, or a number that suits the solid."""
        return PairExchange(self, self.patches(count or _PAIRED_PATCHES))


class Body(Solid):
    """A solid with one surface, whose normals are a function of the point."""

    @abstractmethod
    def normal(self, points: Tensor) -> Tensor:
        """Unit vectors (..., 3) that leave the solid at points (..., 3) of its surface."""

    def meet(self, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
        distance = self.hit(origin, direction)
        reached = distance.masked_fill(~distance.isfinite(), 0.0)[..., None]
        return distance, self.normal(origin.double() + reached * direction.double())


@dataclass(frozen=True)
class Sphere(Body):
    """Sphere of a radius about a centre."""

    radius: float = 0.9
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    convex = True

    def __post_init__(self):
        if not 0 < self.radius < math.inf:
            raise ValueError(f"Sphere.radius must be positive and finite; found {self.radius}.")

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        start, along = origin.double() - row(self.centre, origin), direction.double()
        middle = -(start * along).sum(-1)
        beside = start + middle[..., None] * along  # the ray's point nearest to the centre
        entry = middle - (self.radius**2 - (beside * beside).sum(-1)).sqrt()  # NaN where the ray passes by
        return torch.where(entry > 0, entry, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        return (points - row(self.centre, points)) / self.radius

    def patches(self, count: int) -> Patches:
        normals = spiral(count)
        areas = torch.full_like(normals[:, 0], 4 * math.pi * self.radius**2 / count)
        return Patches(row(self.centre, normals) + self.radius * normals, normals, areas)


@dataclass(frozen=True)
class Cylinder(Body):
    """Upright cylinder about the y axis, from -half_height to half_height."""

    radius: float = 0.6
    half_height: float = 0.9
    convex = True

    def __post_init__(self):
        if not (0 < self.radius < math.inf and 0 < self.half_height < math.inf):
            raise ValueError(
                f"Cylinder.radius and half_height must be positive and finite; found {self.radius}, {self.half_height}."
            )

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        start, along = (k.double() * row((1.0, 0.0, 1.0), k) for k in (origin, direction))
        squared = (along * along).sum(-1)
        upright = squared == 0
        squared = squared.masked_fill(upright, 1.0)
        middle = -(start * along).sum(-1) / squared
        beside = start + middle[..., None] * along
        room = self.radius**2 - (beside * beside).sum(-1)
        half = torch.where(upright & (room > 0), torch.inf, (room / squared).sqrt())  # NaN where the ray passes by
        enter, leave = slab(origin.double()[..., 1], direction.double()[..., 1], self.half_height)
        enter, leave = torch.maximum(enter, middle - half), torch.minimum(leave, middle + half)
        return torch.where((enter > 0) & (enter < leave), enter, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        x, y, z = points.unbind(-1)
        around = torch.stack((x, 0 * y, z), -1)
        cap = torch.stack((0 * x, y.sign(), 0 * z), -1)
        on_wall = (torch.hypot(x, z) - self.radius).abs() <= (y.abs() - self.half_height).abs()
        return torch.where(on_wall[..., None], around / around.norm(dim=-1, keepdim=True), cap)

    def patches(self, count: int) -> Patches:
        wall, cap = 4 * math.pi * self.radius * self.half_height, math.pi * self.radius**2
        side = math.sqrt((wall + 2 * cap) / count)
        columns, rows = math.ceil(2 * math.pi * self.radius / side), math.ceil(2 * self.half_height / side)
        turn, level = torch.meshgrid(middles(columns, math.pi), middles(rows, self.half_height), indexing="ij")
        around = torch.stack((turn.sin(), 0 * turn, turn.cos()), -1).flatten(0, 1)
        on_wall = self.radius * around + level.flatten()[:, None] * row((0.0, 1.0, 0.0), around)
        x, z, areas = disc(math.ceil(cap / side**2), self.radius)
        pieces = [Patches(on_wall, around, torch.full_like(on_wall[:, 0], wall / (columns * rows)))]
        for sign in (-1.0, 1.0):
            points = torch.stack((x, torch.full_like(x, sign * self.half_height), z), -1)
            pieces.append(Patches(points, row((0.0, sign, 0.0), x).expand(points.shape), areas))
        return joined(pieces)


@dataclass(frozen=True)
class Plane(Body):
    """Half space below the plane through a point; `normal_vector` leaves it."""

    normal_vector: tuple[float, float, float] = (0.0, 0.0, 1.0)
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    convex = True
    endless = True

    def __post_init__(self):
        length = math.hypot(*self.normal_vector)
        if not 0 < length < math.inf:
            raise ValueError(f"Plane.normal_vector must be finite and not 0; found {self.normal_vector}.")
        object.__setattr__(self, "normal_vector", tuple(k / length for k in self.normal_vector))

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        normal = row(self.normal_vector, origin)
        height = ((origin.double() - row(self.point, origin)) * normal).sum(-1)
        falling = -(direction.double() * normal).sum(-1)
        return torch.where((height > 0) & (falling > 0), height / falling, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        return row(self.normal_vector, points).to(points.dtype).expand(points.shape)

    def patches_near(self, points: Tensor, count: int) -> Patches:
        """The part of the plane near bodies at points (point, 3): a disc of 1000 half sizes, finest in the middle."""
        normal = row(self.normal_vector, points)
        centre = (points.amin(0) + points.amax(0)) / 2
        size = (points - centre).norm(dim=-1).max()
        centre = centre - ((centre - row(self.point, points)) @ normal) * normal
        across = any_tangent(normal)
        u, v, areas = disc(count, _FAR, core=1.0)
        offsets = u[:, None] * across + v[:, None] * torch.linalg.cross(normal, across)
        return Patches(centre + size * offsets, normal.expand(count, 3), size**2 * areas)


@dataclass(frozen=True)
class Cuboid(Body):
    """Box about the origin, turned by yaw about y and then pitch about x. [degree]

    Positive yaw turns its front to the right; positive pitch tips its top towards the camera.
    """

    half_sizes: tuple[float, float, float] = (0.5, 0.5, 0.5)
    yaw: float = 0.0
    pitch: float = 0.0
    convex = True

    def __post_init__(self):
        if not all(0 < size < math.inf for size in self.half_sizes):
            raise ValueError(f"Cuboid.half_sizes must be positive and finite; found {self.half_sizes}.")

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        axes = self._axes(origin)
        enter, leave = box(origin.double() @ axes, direction.double() @ axes, row(self.half_sizes, origin))
        return torch.where((enter > 0) & (enter < leave), enter, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        axes = self._axes(points)
        own = points.double() @ axes
        face = (own.abs() - row(self.half_sizes, points)).argmax(-1)
        outward = torch.nn.functional.one_hot(face, 3) * own.sign()
        return (outward @ axes.T).to(points.dtype)

    def patches(self, count: int) -> Patches:
        sizes, axes = self.half_sizes, self._axes(torch.empty(0))
        side = math.sqrt(8 * (sizes[0] * sizes[1] + sizes[1] * sizes[2] + sizes[2] * sizes[0]) / count)
        pieces = []
        for face in range(3):
            one, other = (face + 1) % 3, (face + 2) % 3
            u, v = (middles(math.ceil(2 * sizes[k] / side), sizes[k]) for k in (one, other))
            area = 4 * sizes[one] * sizes[other] / (len(u) * len(v))
            for sign in (-1.0, 1.0):
                own = torch.zeros(len(u), len(v), 3, dtype=torch.float64)
                own[..., face], own[..., one], own[..., other] = sign * sizes[face], u[:, None], v
                points = own.flatten(0, 1) @ axes.T
                pieces.append(Patches(points, (sign * axes[:, face]).expand(points.shape), 0 * points[:, 0] + area))
        return joined(pieces)

    def _axes(self, like: Tensor) -> Tensor:
        """Columns: the box's axes in the image frame."""
        a, b = math.radians(self.yaw), math.radians(self.pitch)
        about_y = [[math.cos(a), 0.0, math.sin(a)], [0.0, 1.0, 0.0], [-math.sin(a), 0.0, math.cos(a)]]
        about_x = [[1.0, 0.0, 0.0], [0.0, math.cos(b), -math.sin(b)], [0.0, math.sin(b), math.cos(b)]]
        return row(about_x, like) @ row(about_y, like)


@dataclass(frozen=True)
class Group(Solid):
    """Several solids that do not overlap."""

    solids: tuple[Solid, ...]

    def __post_init__(self):
        object.__setattr__(self, "solids", tuple(self.solids))
        if not self.solids:
            raise ValueError("Group.solids must hold at least one solid; found none.")

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        return torch.stack([solid.hit(origin, direction) for solid in self.solids]).amin(0)

    def blocks(self, origin: Tensor, direction: Tensor, reach: Tensor | float = math.inf) -> Tensor:
        return torch.stack([solid.blocks(origin, direction, reach) for solid in self.solids]).any(0)

    def patches(self, count: int) -> Patches:
        """As many for each solid; of a plane, which has no end, the part near the other solids."""
        share = max(1, count // len(self.solids))
        bodies = [solid.patches(share) for solid in self.solids if not solid.endless]
        if not bodies:
            raise ValueError("Group.patches needs a solid of finite extent; found planes only.")
        around = joined(bodies).points
        return joined(bodies + [solid.patches_near(around, share) for solid in self.solids if solid.endless])

    def meet(self, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
        distances, normals = zip(*(solid.meet(origin, direction) for solid in self.solids), strict=True)
        distance, nearest = torch.stack(distances).min(0)
        chosen = nearest[None, ..., None].expand(1, *nearest.shape, 3)
        return distance, torch.stack(normals).gather(0, chosen)[0]
