"""What all lights have in common at the points of an image: normals, views and their cosine, and what hides lights."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import torch
from torch import Tensor

from inverse.scene import Arrival, Footprints, Light
from inverse.shapes import dots
from inverse.transport.direct import unhidden
from inverse.transport.shadows import Shadows
from torchbrdf import Cosines

# Pairs of a point and a direction of light that are shaded at once, if that takes several directions.
_TOGETHER = 1 << 13
# A vector of unit length within so many roundings is not scaled again.
_UNIT_ROUNDING = 8


class CommonGeometry:
    """Footprints as all their lights see them.

    Attributes:
        normals, view: unit vectors (point, 3), and (3,) or (point, 3).
        cos_view: normal . view (point,).
    Raises: ValueError for normals or views that are not finite, or 0.
    """

    def __init__(self, footprints: Footprints):
        self.normals, self.view = footprints.normals, footprints.view
        if not (_are_unit(self.normals) and _are_unit(self.view)):
            self.normals, _, self.view = _scaled(self.normals, self.normals, self.view)
        self.cos_view = dots(self.normals, self.view)
        self._shadows = Shadows(footprints.solid, footprints.points, self.normals)

    def arrivals(self, light: Light) -> Iterator[Arrival]:
        """The directions from which a light reaches the points, with no irradiance where it is hidden."""
        return unhidden(light, self._shadows)

    def batches(self, light: Light) -> Iterator[Arrival]:
        """The same, several at a time where the points are few: direction (batch, 1 or point, 3), irradiance (batch, 1
        or point, 1 or channel)."""
        size = max(1, _TOGETHER // len(self.normals))
        arrivals = self.arrivals(light)
        while batch := list(islice(arrivals, size)):
            directions, irradiances = zip(*batch, strict=True)
            rows = torch.broadcast_tensors(*(torch.atleast_2d(direction) for direction in directions))
            yield Arrival(torch.stack(rows), torch.stack(torch.broadcast_tensors(*irradiances)))

    def cosines(self, direction: Tensor) -> Cosines:
        """Cosines (..., point) of light from directions (..., 3), of any length but 0, in the points' dtype; leading
        shapes broadcast with the points'."""
        if direction.dtype != self.normals.dtype or not _are_unit(direction):
            _, direction, _ = _scaled(self.normals, direction, self.view)
        products = dots(self.normals, direction), self.cos_view, dots(direction, self.view)
        return replace(Cosines.from_products(*products), vectors=(self.normals, direction, self.view))


def _are_unit(vectors: Tensor) -> bool:
    with torch.no_grad():
        off = (dots(vectors, vectors) - 1).abs().amax()
        return bool(off <= _UNIT_ROUNDING * torch.finfo(vectors.dtype).eps)


def _scaled(normal: Tensor, light: Tensor, view: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Vectors (..., 3) of unit length; raises what `Cosines.of` does."""
    vectors = Cosines.of(normal, light, view, normalize=True).vectors
    assert vectors is not None
    return vectors
