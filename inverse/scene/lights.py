"""Lights: the directions they come from and the irradiance they give a surface that faces them."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor

from inverse.shapes import Absence, Solid
from torchbrdf import any_tangent

# Effects of lights that a scene could do without, by name.
NEAR_LIGHT = "distance fall-off"
SOFTNESS = "extent of the source"
MAP_DETAIL = "detail of the environment"
AMBIENT = "ambient light"

# A vector that was scaled to unit length has it to within so many units in the last place.
_UNIT_ROUNDING = 4


class Arrival(NamedTuple):
    """Light that reaches every point from one direction.

    Attributes:
        direction: unit vector towards the light, (3,), or (point, 3) where the points see it in different ones.
        irradiance: on a surface facing it, (1 or point, 1 or channel).
    """

    direction: Tensor
    irradiance: Tensor


class SimplerLight(NamedTuple):
    """What could be simulated instead of a light.

    Attributes:
        effect: what is left out.
        choice: what is done instead, in words.
        light: the stand-in; None: no light at all.
    """

    effect: str
    choice: str
    light: "Light | None"


class StoredLight(NamedTuple):
    """A light in numbers, as a folder of photographs keeps it: the sum of what its fields hold, in float64.

    Attributes:
        directions: unit vectors (ray, 3) to light that is the same at every point.
        irradiances: on a surface that faces each of them, (ray, 1 or channel).
        positions: of small lamps, (lamp, 3).
        intensities: of each, as of `Point`, (lamp, 1 or channel).
        uniform: radiance from everywhere, (1 or channel,).
    """

    directions: Tensor | None = None
    irradiances: Tensor | None = None
    positions: Tensor | None = None
    intensities: Tensor | None = None
    uniform: Tensor | None = None


class Light(ABC):
    """What lights a surface: from directions, and uniformly from everywhere.

    A light of your own implements `arrivals`. What else it knows of itself spares work: the answers here are safe.

    Attributes:
        extended: its directions stand for an area that a mirror would show, and may be too many to keep at once.
        parallel: the one unit vector (3,) that all its light comes from; None where there are several or none.
        uniform: radiance, scalar or (channel,), that comes from every direction besides; None for none.
    """

    extended: bool = False
    parallel: Tensor | None = None
    uniform: Tensor | float | None = None

    @abstractmethod
    def arrivals(self, points: Tensor) -> Iterator[Arrival]:
        """The directions from which it reaches points (point, 3); uniform light left out."""

    def seen(self, direction: Tensor) -> Tensor:
        """Radiance (..., channel) that comes from unit directions (..., 3), as a mirror would show it."""
        return torch.zeros_like(direction[..., :1])

    def distance(self, points: Tensor) -> Tensor | None:
        """Distance (point,) from points (point, 3), beyond which nothing hides it; None for a light at infinity."""
        return None

    def beams(self) -> tuple["Light", ...]:
        """Lights of one direction a point whose shadows have their edges where this light's have."""
        return ()

    def why_shadowless(self, solid: Solid | None) -> Absence | None:
        """Why nothing of a solid can be seen to cast a shadow on itself in this light; None where something may.

        `solid` is None where only the side in the image is known: shadows may fall there, and cannot be found.
        """
        if solid is None:
            return Absence("unknown: nothing but the visible side is given", certain=False)
        return solid.why_unshaded(self.parallel)

    def simpler(self, middle: Tensor) -> tuple[SimplerLight, ...]:
        """Stand-ins that simulate less, for an object about a point (3,): one an effect."""
        return ()

    def stored(self, points: Tensor) -> StoredLight:
        """Itself in numbers that give points (point, 3) the light that `arrivals` and `uniform` do.

        Raises: ValueError where arrivals depend on the point. Such a light says here which lamps it is made of.
        """
        rays = [_same_for_all(type(self).__name__, arrival) for arrival in self.arrivals(points)]
        uniform = None if self.uniform is None else _in_full(self.uniform)
        if not rays:
            return StoredLight(uniform=uniform)
        channels = max(len(irradiance) for _, irradiance in rays)
        irradiances = torch.stack([irradiance.expand(channels) for _, irradiance in rays])
        return StoredLight(torch.stack([direction for direction, _ in rays]), irradiances, uniform=uniform)


@dataclass(frozen=True)
class Distant(Light):
    """Light so far away that its direction and irradiance are the same everywhere.

    Attributes:
        direction: unit vector (3,) towards the light; scaled to unit length on construction.
        irradiance: on a surface facing the light, scalar or (channel,). [W/m^2, or any unit of radiance times sr]
    """

    direction: Tensor
    irradiance: Tensor | float = 1.0

    def __post_init__(self):
        object.__setattr__(self, "direction", _unit("Distant.direction", self.direction))
        _check_strength("Distant.irradiance", self.irradiance)

    @classmethod
    def from_angle(cls, degrees: float, irradiance: Tensor | float = 1.0) -> "Distant":
        """Horizontal light, `degrees` to the right of the camera as the camera sees the object."""
        angle = math.radians(degrees)
        return cls(torch.tensor([math.sin(angle), 0.0, math.cos(angle)], dtype=torch.float64), irradiance)

    def arrivals(self, points: Tensor) -> Iterator[Arrival]:
        """The one direction, for points (point, 3)."""
        yield Arrival(self.direction.to(points), _row(self.irradiance, points))

    @property
    def parallel(self) -> Tensor:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.direction

    def beams(self) -> tuple[Light, ...]:
        return (self,)


@dataclass(frozen=True)
class Point(Light):
    """A small lamp: irradiance I/r^2 on a surface that faces it.

    Attributes:
        position: (3,), in the unit of the surface's points (half image heights).
        intensity: scalar or (channel,). [W/sr for lengths in m]
    Source: Fleet & Hertzmann 2006, "Computer Graphics Lecture Notes", University of Toronto, eqs. (20), (26).
    """

    position: Tensor
    intensity: Tensor | float = 1.0

    def __post_init__(self):
        position = _vector("Point.position", self.position)
        object.__setattr__(self, "position", position)
        _check_strength("Point.intensity", self.intensity)

    def arrivals(self, points: Tensor) -> Iterator[Arrival]:
        """A direction for each of the points (point, 3). ValueError where one is unknown or at the lamp."""
        away = self.position.to(points) - points
        distance = away.norm(dim=-1, keepdim=True)
        if not (distance.isfinite() & (distance > 0)).all():
            raise ValueError(
                "Point light needs known positions away from the lamp; found a normal map without positions, or a "
                f"surface point at the lamp's position {self.position.tolist()}."
            )
        yield Arrival(away / distance, _row(self.intensity, points) / distance.square())

    def distance(self, points: Tensor) -> Tensor:
        return (self.position.to(points) - points).norm(dim=-1)

    def beams(self) -> tuple[Light, ...]:
        return (self,)

    def simpler(self, middle: Tensor) -> tuple[SimplerLight, ...]:
        away = self.position.to(middle) - middle
        distant = Distant(away, self.intensity / (away * away).sum())
        choice = "as strong as in the middle of the object, from one direction"
        return (SimplerLight(NEAR_LIGHT, choice, distant),)

    def stored(self, points: Tensor) -> StoredLight:
        return StoredLight(positions=self.position.detach().double()[None], intensities=_in_full(self.intensity)[None])


@dataclass(frozen=True)
class Disc(Light):
    """A distant source of finite size: a round patch of sky of uniform radiance, such as the sun.

    Attributes:
        direction: unit vector (3,) towards its centre; scaled to unit length on construction.
        half_angle: of the cone it fills. [rad] in (0, pi/2]
        irradiance: on a surface facing its centre, pi radiance sin^2(half_angle), scalar or (channel,).
        rings: of the quadrature: `rings` cosines times 4 `rings` azimuths. Exact for a surface that sees all of it;
            where the horizon cuts it, as good as the rings are many.
    """

    direction: Tensor
    half_angle: float
    irradiance: Tensor | float = 1.0
    rings: int = 3

    extended = True

    def __post_init__(self):
        object.__setattr__(self, "direction", _unit("Disc.direction", self.direction))
        if not 0 < self.half_angle <= math.pi / 2:
            raise ValueError(f"Disc.half_angle must lie in (0, pi/2] rad; found {self.half_angle}.")
        if not isinstance(self.rings, int) or self.rings < 1:
            raise ValueError(f"Disc.rings must be a whole number of at least 1; found {self.rings}.")
        _check_strength("Disc.irradiance", self.irradiance)

    @property
    def radiance(self) -> Tensor:
        """Of every point of the source, (channel,) or scalar."""
        given = isinstance(self.irradiance, Tensor)
        strength = torch.as_tensor(self.irradiance, dtype=None if given else torch.float64)
        return strength / (math.pi * math.sin(self.half_angle) ** 2)

    def arrivals(self, points: Tensor) -> Iterator[Arrival]:
        """The nodes of Fleet & Hertzmann 2006, eq. (31): radiance times the solid angle each stands for."""
        edge = math.cos(self.half_angle)
        nodes, weights = leggauss(self.rings)
        axis = self.direction.double()
        across = any_tangent(axis)
        turned = torch.linalg.cross(axis, across)
        count = 4 * self.rings
        for node, weight in zip(nodes, weights, strict=True):
            cos = edge + (1 - edge) * (1 + node) / 2
            sin = math.sqrt((1 - cos) * (1 + cos))
            solid_angle = (1 - edge) * weight / 2 * 2 * math.pi / count
            for step in range(count):
                azimuth = 2 * math.pi * (step + 0.5) / count
                direction = cos * axis + sin * (math.cos(azimuth) * across + math.sin(azimuth) * turned)
                yield Arrival(direction.to(points), _row(self.radiance, points) * solid_angle)

    def seen(self, direction: Tensor) -> Tensor:
        """Radiance (..., channel) that comes from unit directions (..., 3)."""
        inside = (direction * self.direction.to(direction)).sum(-1, keepdim=True) >= math.cos(self.half_angle)
        return as_channels(self.radiance, direction) * inside

    def beams(self) -> tuple[Light, ...]:
        return (self._centred(),)

    def simpler(self, middle: Tensor) -> tuple[SimplerLight, ...]:
        return (SimplerLight(SOFTNESS, "all its light from its centre", self._centred()),)

    def _centred(self) -> Distant:
        return Distant(self.direction, self.irradiance)


@dataclass(frozen=True)
class Environment(Light):
    """Radiance from every direction, as an equirectangular image around the object.

    Row 0 looks up (+y), the last row down. The middle column looks away from the camera (-z), the columns to
    its right towards +x, and both edges towards the camera's side (+z).

    Attributes:
        radiance: (rows, columns, channel). Each texel is one direction of light, so a shaded image costs as many
            evaluations as the map has texels that are not black: `reduced` makes it smaller.
    """

    radiance: Tensor

    extended = True

    def __post_init__(self):
        radiance = torch.as_tensor(self.radiance)
        if radiance.ndim != 3 or not radiance.numel() or not radiance.is_floating_point():
            raise ValueError(
                "Environment.radiance must be floating-point of shape (rows, columns, channel); "
                f"found {radiance.dtype} {tuple(radiance.shape)}."
            )
        _check_strength("Environment.radiance", radiance)
        object.__setattr__(self, "radiance", radiance)

    def solid_angles(self) -> Tensor:
        """Of a texel of each row (rows,), float64. [sr]"""
        rows, columns = self.radiance.shape[:2]
        edges = torch.linspace(0, math.pi, rows + 1, dtype=torch.float64).cos()
        return (edges[:-1] - edges[1:]) * (2 * math.pi / columns)

    def directions(self) -> Tensor:
        """Unit vectors (rows, columns, 3) to the middles of the texels, float64."""
        rows, columns = self.radiance.shape[:2]
        polar = (torch.arange(rows, dtype=torch.float64) + 0.5) * (math.pi / rows)
        azimuth = ((torch.arange(columns, dtype=torch.float64) + 0.5) / columns - 0.5) * (2 * math.pi)
        polar, azimuth = torch.meshgrid(polar, azimuth, indexing="ij")
        return torch.stack((polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()), -1)

    def arrivals(self, points: Tensor) -> Iterator[Arrival]:
        """One for each texel that is not black: radiance times solid angle."""
        strength = self.radiance * self.solid_angles()[:, None, None].to(self.radiance)
        bright = (self.radiance > 0).any(-1)
        for direction, irradiance in zip(self.directions()[bright], strength[bright], strict=True):
            yield Arrival(direction.to(points), _row(irradiance, points))

    def seen(self, direction: Tensor) -> Tensor:
        """Radiance (..., channel) of the texels in unit directions (..., 3)."""
        rows, columns = self.radiance.shape[:2]
        x, y, z = direction.unbind(-1)
        row = (torch.acos(y.clamp(-1, 1)) * (rows / math.pi)).long().clamp(0, rows - 1)
        column = ((torch.atan2(x, -z) / (2 * math.pi) + 0.5) * columns).long().clamp(0, columns - 1)
        return self.radiance.to(direction)[row, column]

    def simpler(self, middle: Tensor) -> tuple[SimplerLight, ...]:
        rows, columns = self.radiance.shape[:2]
        if rows % 2 or columns % 2:
            return ()
        return (SimplerLight(MAP_DETAIL, "a map of half as many rows", self.reduced(rows // 2)),)

    def reduced(self, rows: int) -> "Environment":
        """The map in `rows` rows, a divisor of its own; texels are averaged by their solid angles."""
        if not isinstance(rows, int) or rows < 1 or self.radiance.shape[0] % rows:
            raise ValueError(f"rows must divide the map's {self.radiance.shape[0]} rows; found {rows}.")
        size = self.radiance.shape[0] // rows
        if self.radiance.shape[1] % size:
            raise ValueError(f"blocks of {size} texels must divide the map's {self.radiance.shape[1]} columns.")
        share = self.solid_angles()[:, None, None].to(self.radiance)
        blocks = (self.radiance * share).unflatten(0, (rows, size)).unflatten(2, (-1, size))
        return Environment(blocks.sum((1, 3)) / (share.unflatten(0, (rows, size)).sum(1) * size))


@dataclass(frozen=True)
class Ambient(Light):
    """The same radiance from every direction, scalar or (channel,)."""

    radiance: Tensor | float = 1.0

    def __post_init__(self):
        _check_strength("Ambient.radiance", self.radiance)

    @property
    def uniform(self) -> Tensor | float:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.radiance

    def arrivals(self, points: Tensor) -> Iterator[Arrival]:
        """None: what is uniform is not cut into directions."""
        yield from ()

    def why_shadowless(self, solid: Solid | None) -> Absence | None:
        return Absence("ambient light comes from everywhere: its hidden share is sky_share's")

    def simpler(self, middle: Tensor) -> tuple[SimplerLight, ...]:
        return (SimplerLight(AMBIENT, "none", None),)


def _same_for_all(kind: str, arrival: Arrival) -> tuple[Tensor, Tensor]:
    """Direction (3,) and irradiance (1 or channel,) of light that is the same at every point; ValueError otherwise."""
    rows = torch.atleast_2d(arrival.direction), arrival.irradiance
    if not all((row == row[:1]).all() for row in rows):
        raise ValueError(
            f"{kind} cannot be stored: what arrives depends on the point. A light that is made of small lamps says "
            f"which in its method `stored`."
        )
    direction, irradiance = (row[0].detach().double() for row in rows)
    return direction, irradiance


def _vector(name: str, value: Tensor) -> Tensor:
    vector = torch.as_tensor(value)
    if not vector.is_floating_point():
        vector = vector.double()
    if vector.shape != (3,) or not vector.isfinite().all():
        raise ValueError(f"{name} must be a finite vector (3,); found {value}.")
    return vector


def _unit(name: str, value: Tensor) -> Tensor:
    vector = _vector(name, value)
    length = vector.norm()
    if length == 0:
        raise ValueError(f"{name} must be a vector (3,) other than 0; found {value}.")
    if (length - 1).abs() <= _UNIT_ROUNDING * torch.finfo(vector.dtype).eps:
        return vector  # so that what was scaled once keeps its digits
    return vector / length


def as_channels(strength: Tensor | float, like: Tensor) -> Tensor:
    """A strength as (1 or channel,), in the dtype and on the device of another tensor."""
    return torch.atleast_1d(torch.as_tensor(strength, dtype=like.dtype, device=like.device))


def _in_full(strength: Tensor | float) -> Tensor:
    """A strength as (1 or channel,) in float64: a number keeps the digits that the default dtype would cost it."""
    return torch.atleast_1d(torch.as_tensor(strength, dtype=torch.float64)).detach()


def _row(strength: Tensor | float, points: Tensor) -> Tensor:
    """A strength as (1, 1 or channel), in the dtype of the points."""
    return as_channels(strength, points)[None]


def _check_strength(name: str, value: Tensor | float) -> None:
    strength = torch.as_tensor(value)
    if not (strength.isfinite() & (strength >= 0)).all():
        raise ValueError(f"{name} must be finite and not negative; found {value}.")
