"""Known shapes as solids: where a ray meets them first, and which way their surface faces there.

Cameras see them and lights are blocked by them, so every question is a ray's. Frame and unit are those of
`inverse.geometry`. Rays are answered in float64, whatever comes in.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor


class Solid(ABC):
    """A body, or several, that rays can meet. A convex one never shadows itself."""

    convex: bool

    @abstractmethod
    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        """Distance (...) along unit directions (..., 3) at which rays from outside first enter; inf where they miss."""

    @abstractmethod
    def meet(self, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
        """`hit`, and the unit vectors (..., 3) that leave the solid there (arbitrary where the ray misses)."""


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
        start, along = origin.double() - _row(self.centre, origin), direction.double()
        middle = -(start * along).sum(-1)
        beside = start + middle[..., None] * along  # the ray's point nearest to the centre
        entry = middle - (self.radius**2 - (beside * beside).sum(-1)).sqrt()  # NaN where the ray passes by
        return torch.where(entry > 0, entry, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        return (points - _row(self.centre, points)) / self.radius


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
        start, along = (k.double() * _row((1.0, 0.0, 1.0), k) for k in (origin, direction))
        squared = (along * along).sum(-1)
        upright = squared == 0
        squared = squared.masked_fill(upright, 1.0)
        middle = -(start * along).sum(-1) / squared
        beside = start + middle[..., None] * along
        room = self.radius**2 - (beside * beside).sum(-1)
        half = torch.where(upright & (room > 0), torch.inf, (room / squared).sqrt())  # NaN where the ray passes by
        enter, leave = _slab(origin.double()[..., 1], direction.double()[..., 1], self.half_height)
        enter, leave = torch.maximum(enter, middle - half), torch.minimum(leave, middle + half)
        return torch.where((enter > 0) & (enter < leave), enter, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        x, y, z = points.unbind(-1)
        around = torch.stack((x, 0 * y, z), -1)
        cap = torch.stack((0 * x, y.sign(), 0 * z), -1)
        on_wall = (torch.hypot(x, z) - self.radius).abs() <= (y.abs() - self.half_height).abs()
        return torch.where(on_wall[..., None], around / around.norm(dim=-1, keepdim=True), cap)


@dataclass(frozen=True)
class Plane(Body):
    """Half space below the plane through a point; `normal_vector` leaves it."""

    normal_vector: tuple[float, float, float] = (0.0, 0.0, 1.0)
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    convex = True

    def __post_init__(self):
        length = math.hypot(*self.normal_vector)
        if not 0 < length < math.inf:
            raise ValueError(f"Plane.normal_vector must be finite and not 0; found {self.normal_vector}.")
        object.__setattr__(self, "normal_vector", tuple(k / length for k in self.normal_vector))

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        normal = _row(self.normal_vector, origin)
        height = ((origin.double() - _row(self.point, origin)) * normal).sum(-1)
        falling = -(direction.double() * normal).sum(-1)
        return torch.where((height > 0) & (falling > 0), height / falling, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        return _row(self.normal_vector, points).to(points.dtype).expand(points.shape)


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
        enter, leave = _box(origin.double() @ axes, direction.double() @ axes, _row(self.half_sizes, origin))
        return torch.where((enter > 0) & (enter < leave), enter, torch.inf)

    def normal(self, points: Tensor) -> Tensor:
        axes = self._axes(points)
        own = points.double() @ axes
        face = (own.abs() - _row(self.half_sizes, points)).argmax(-1)
        outward = torch.nn.functional.one_hot(face, 3) * own.sign()
        return (outward @ axes.T).to(points.dtype)

    def _axes(self, like: Tensor) -> Tensor:
        """Columns: the box's axes in the image frame."""
        a, b = math.radians(self.yaw), math.radians(self.pitch)
        about_y = [[math.cos(a), 0.0, math.sin(a)], [0.0, 1.0, 0.0], [-math.sin(a), 0.0, math.cos(a)]]
        about_x = [[1.0, 0.0, 0.0], [0.0, math.cos(b), -math.sin(b)], [0.0, math.sin(b), math.cos(b)]]
        return _row(about_x, like) @ _row(about_y, like)


@dataclass(frozen=True)
class Revolution(Body):
    """Solid of revolution about the y axis, closed by discs at both ends.

    Attributes:
        radius: r(y) for a NumPy array of heights in [low, high], positive inside.
        slope: its derivative dr/dy.
        low, high: the heights of the ends.
        steps: points tried along the part of a ray inside the surrounding box; a ray that dips into
            the solid between two of them passes.
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
        clipped = y.clamp(self.low, self.high).cpu().numpy()
        r = torch.as_tensor(self.radius(clipped)).to(points)
        return r * r - x * x - z * z

    def widest(self) -> float:
        """A radius that no height exceeds by more than the steps can tell."""
        heights = torch.linspace(self.low, self.high, 4 * self.steps, dtype=torch.float64)
        return float(torch.as_tensor(self.radius(heights.numpy())).max())

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        origin, direction = torch.broadcast_tensors(origin.double(), direction.double())
        flat = [k.reshape(-1, 3) for k in (origin, direction)]
        found = [self._march(*piece) for piece in zip(*(k.split(1 << 14) for k in flat), strict=True)]
        return torch.cat(found).reshape(origin.shape[:-1])

    def normal(self, points: Tensor) -> Tensor:
        x, y, z = points.double().unbind(-1)
        heights = y.clamp(self.low, self.high).cpu().numpy()
        r, dr = (torch.as_tensor(f(heights)).to(y) for f in (self.radius, self.slope))
        side = torch.stack((x, -r * dr, z), -1)
        # a point nearer to an end than to the wall lies on that end
        wall = (r - torch.hypot(x, z)).abs()
        end = torch.minimum((y - self.low).abs(), (self.high - y).abs())
        cap = torch.stack((0 * y, torch.where(y > (self.low + self.high) / 2, 1.0, -1.0).to(y), 0 * y), -1)
        unit = torch.where((end < wall)[..., None], cap, side / side.norm(dim=-1, keepdim=True))
        return unit.to(points.dtype)

    def _march(self, origin: Tensor, direction: Tensor) -> Tensor:
        """First crossing (ray,) from outside to inside, by `steps` trials and then by bisection."""
        middle, half, widest = (self.low + self.high) / 2, (self.high - self.low) / 2, self.widest()
        box = _row((widest, half, widest), origin)
        start, beyond = _box(origin - _row((0.0, middle, 0.0), origin), direction, box)
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


@dataclass(frozen=True)
class Group(Solid):
    """Several solids that do not overlap."""

    solids: tuple[Solid, ...]

    convex = False

    def __post_init__(self):
        object.__setattr__(self, "solids", tuple(self.solids))
        if not self.solids:
            raise ValueError("Group.solids must hold at least one solid; found none.")

    def hit(self, origin: Tensor, direction: Tensor) -> Tensor:
        return torch.stack([solid.hit(origin, direction) for solid in self.solids]).amin(0)

    def meet(self, origin: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
        distances, normals = zip(*(solid.meet(origin, direction) for solid in self.solids), strict=True)
        distance, nearest = torch.stack(distances).min(0)
        chosen = nearest[None, ..., None].expand(1, *nearest.shape, 3)
        return distance, torch.stack(normals).gather(0, chosen)[0]


def _slab(start: Tensor, along: Tensor, size: Tensor | float) -> tuple[Tensor, Tensor]:
    """Where a ray enters and leaves |coordinate| < size, each (...); enter > leave where it never is inside."""
    parallel = along == 0
    step = along.masked_fill(parallel, 1.0)
    one, other = (-size - start) / step, (size - start) / step
    never, always = parallel & (start.abs() >= size), parallel & (start.abs() < size)
    enter = torch.minimum(one, other).masked_fill(never, torch.inf).masked_fill(always, -torch.inf)
    leave = torch.maximum(one, other).masked_fill(never, -torch.inf).masked_fill(always, torch.inf)
    return enter, leave


def _box(start: Tensor, along: Tensor, sizes: Tensor) -> tuple[Tensor, Tensor]:
    """`_slab` in all three coordinates (..., 3)."""
    enter, leave = _slab(start, along, sizes)
    return enter.amax(-1), leave.amin(-1)


def _row(values, like: Tensor) -> Tensor:
    return torch.tensor(values, dtype=torch.float64, device=like.device)
