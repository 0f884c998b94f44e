"""Lights made anew from their numbers."""

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from inverse.scene.lights import Ambient, Arrival, Distant, Light, Point, StoredLight

# Text and float32 round.
_UNIT_TOLERANCE = 1e-5


@dataclass(frozen=True)
class Rays(Light):
    """Distant light from several directions at once: what numbers keep of an extended light. A mirror shows none of it.

    Attributes:
        directions: unit vectors (ray, 3) towards the light.
        irradiances: on a surface that faces each of them, (ray, 1 or channel).
    """

    directions: Tensor
    irradiances: Tensor

    extended = True

    def __post_init__(self):
        shape = self.irradiances.shape
        if self.directions.ndim != 2 or self.directions.shape[-1] != 3 or len(shape) != 2 or shape[0] != len(self):
            raise ValueError(
                "Rays needs directions (ray, 3) and irradiances (ray, channel); found "
                f"{tuple(self.directions.shape)} and {tuple(shape)}."
            )
        lengths = self.directions.double().norm(dim=-1)
        if not ((lengths - 1).abs() < _UNIT_TOLERANCE).all():
            raise ValueError(f"Rays.directions must be unit vectors; found lengths {lengths.min()} to {lengths.max()}.")
        if not (self.irradiances.isfinite() & (self.irradiances >= 0)).all():
            raise ValueError("Rays.irradiances must be finite and not negative.")

    def __len__(self) -> int:
        return len(self.directions)

    def arrivals(self, points: Tensor) -> Iterator[Arrival]:
        """One a ray, for points (point, 3)."""
        for direction, irradiance in zip(self.directions, self.irradiances, strict=True):
            yield Arrival(direction.to(points), irradiance.to(points)[None])

    def beams(self) -> tuple[Light, ...]:
        """All its light from its middle, if all comes from one side."""
        middle = (self.directions * self.irradiances.mean(-1, keepdim=True)).sum(0)
        if not (self.directions @ middle > 0).all():
            return ()
        return (Distant(middle, self.irradiances.sum(0)),)


def from_numbers(stored: StoredLight) -> tuple[Light, ...]:
    """Lights whose sum is the one that was stored."""
    directions, irradiances, positions, intensities, uniform = stored
    lights: list[Light] = []
    if (directions is None) != (irradiances is None) or (positions is None) != (intensities is None):
        raise ValueError("a stored light has irradiances with its directions, and intensities with its positions.")
    if directions is not None and irradiances is not None:
        rays = Rays(directions, irradiances)
        lights.append(Distant(directions[0], _plain(irradiances[0])) if len(rays) == 1 else rays)
    if positions is not None and intensities is not None:
        if positions.ndim != 2 or intensities.ndim != 2:
            raise ValueError("a stored light has positions (lamp, 3) and intensities (lamp, channel).")
        lights += [Point(x, _plain(strength)) for x, strength in zip(positions, intensities, strict=True)]
    if uniform is not None:
        lights.append(Ambient(_plain(torch.atleast_1d(uniform))))
    if not lights:
        raise ValueError("a stored light has directions, positions or a uniform part; found none of them.")
    return tuple(lights)


def _plain(strength: Tensor) -> Tensor | float:
    """(channel,), or a number where there is one."""
    return strength.item() if len(strength) == 1 else strength
