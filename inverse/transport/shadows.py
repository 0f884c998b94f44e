"""Cast shadows: does the object itself hide a light from a point of its surface?

Attached shadows, where the surface faces away from the light, are not the matter here: the light's cosine
makes them. A shadow is there or not, so these masks are piecewise constant. They are differentiable almost
everywhere, with zero gradient: how a shadow's edge moves with the light or the shape is not followed.
"""

from functools import cached_property

import torch
from torch import Tensor

from inverse.shapes import Solid, dots, lifted


class Shadows:
    """Shadows that a solid casts on points (point, 3) of its own surface, of unit normals (point, 3).

    What all lights have in common is done once. `solid` is None where nothing is known to hide lights.
    """

    def __init__(self, solid: Solid | None, points: Tensor, normals: Tensor):
        self.solid, self.points, self.normals = solid, points, normals

    @cached_property
    def _starts(self) -> Tensor:
        return lifted(self.points, self.normals)

    def clear(self, direction: Tensor, distance: Tensor | None = None) -> Tensor:
        """True (point,) where the solid does not stand between the light and the point.

        Args:
            direction: unit vectors to the light, (3,) or (point, 3).
            distance: to the lamp (point,), beyond which nothing matters; None is infinity.
        Only points that face the light are traced; those that face away are True: the light's cosine is 0 there.
        """
        clear = torch.ones(len(self.points), dtype=torch.bool, device=self.points.device)
        if self.solid is not None:
            facing = (dots(self.normals, direction) > 0).nonzero()[:, 0]
            reach = torch.inf if distance is None else distance[facing].double()
            along = direction if direction.ndim == 1 else direction[facing]
            clear[facing] = ~self.solid.blocks(self._starts[facing], along.double(), reach)
        return clear
