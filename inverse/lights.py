"""Lights: the direction to them and the irradiance they give a surface that faces them."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class Distant:
    """Light so far away that its direction and irradiance are the same everywhere.

    Attributes:
        direction: unit vector (3,) towards the light; scaled to unit length on construction.
        irradiance: on a surface facing the light, scalar or (channel,). [W/m^2, or any unit of radiance times sr]
    """

    direction: Tensor
    irradiance: Tensor | float = 1.0

    def __post_init__(self):
        direction = torch.as_tensor(self.direction)
        if not direction.is_floating_point():
            direction = direction.double()
        length = direction.norm()
        if direction.shape != (3,) or not length.isfinite() or length == 0:
            raise ValueError(f"Distant.direction must be a finite non-zero vector (3,); found {self.direction}.")
        _check_strength("Distant.irradiance", self.irradiance)
        object.__setattr__(self, "direction", direction / length)

    @classmethod
    def from_angle(cls, degrees: float, irradiance: Tensor | float = 1.0) -> "Distant":
        """Horizontal light, `degrees` to the right of the camera as the camera sees the object."""
        angle = math.radians(degrees)
        return cls(torch.tensor([math.sin(angle), 0.0, math.cos(angle)], dtype=torch.float64), irradiance)


@dataclass(frozen=True)
class Ambient:
    """The same radiance from every direction, scalar or (channel,)."""

    radiance: Tensor | float = 1.0

    def __post_init__(self):
        _check_strength("Ambient.radiance", self.radiance)


def _check_strength(name: str, value: Tensor | float) -> None:
    strength = torch.as_tensor(value)
    if not (strength.isfinite() & (strength >= 0)).all():
        raise ValueError(f"{name} must be finite and not negative; found {value}.")


Light = Distant | Ambient
