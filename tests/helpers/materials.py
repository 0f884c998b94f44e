"""What the rows of the catalog are made of."""

from collections.abc import Callable
from dataclasses import dataclass

import torch

from torchbrdf import BRDF, Oriented
from torchbrdf.testing import TOLERANCE


@dataclass(frozen=True)
class Model:
    """A row: how to build the model in a dtype, and its exceptions. Each exception needs a reason.

    `least` is the smallest value [1/sr] the model is known to reach, `energy_limit` the largest
    directional albedo; `reciprocal` says whether light and view may be exchanged. The tests also fail when an
    exception is no longer needed.
    """

    name: str
    make: Callable[[torch.dtype], BRDF]
    least: float = 0.0
    energy_limit: float = 1.0
    reason: str = ""
    integral: float = TOLERANCE[torch.float64].integral  # of the energy law: kinks inside its panels cost digits
    float32: float = 1e-6  # relative to the sum of the absolute terms
    captured: bool = True  # whether torch.compile is tried: the cheapest configuration of a model stands for the others
    reciprocal: bool = True
    nodes: int = 24  # of the energy law: lobes narrower than diffuse ones need more
    albedo_error: float = 3e-4  # of `directional_albedo` with its default nodes

    def __post_init__(self):
        excepted = self.least < 0 or self.energy_limit > 1 or not self.reciprocal
        if excepted != bool(self.reason):
            raise ValueError(f"{self.name}: an exception needs a reason, and a reason an exception")


def colour(dtype: torch.dtype) -> torch.Tensor:
    """Albedo of a terracotta, say."""
    return torch.tensor([0.7, 0.45, 0.3], dtype=dtype)


def number(value: float, dtype: torch.dtype) -> torch.Tensor:
    return torch.tensor(value, dtype=dtype)


def brushed(brdf: BRDF, dtype: torch.dtype) -> BRDF:
    """Anisotropic models get their tangent from a fixed direction: the laws choose normals, light and view."""
    return Oriented(brdf, torch.tensor([1.0, 0.0, 0.2], dtype=dtype))
