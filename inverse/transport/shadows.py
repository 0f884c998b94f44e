"""Cast shadows: does the object itself hide a light from a point of its surface?

Attached shadows, where the surface faces away from the light, are not the matter here: the light's cosine
makes them. A shadow is there or not, so these masks are piecewise constant. They are differentiable almost
everywhere, with zero gradient: how a shadow's edge moves with the light or the shape is not followed.
"""

import torch
from torch import Tensor

from inverse.shapes import Solid, lifted


def unshadowed(
    solid: Solid, points: Tensor, normals: Tensor, direction: Tensor, distance: Tensor | None = None
) -> Tensor:
    """True (point,) where the solid does not stand between the light and the point.

    Args:
        points, normals: of the solid's surface (point, 3); the normals have unit length.
        direction: unit vectors to the light, (3,) or (point, 3).
        distance: to the lamp (point,), beyond which nothing matters; None is infinity.
    Only points that face the light are traced; those that face away are True: the light's cosine is 0 there.
    """
    direction = direction.expand(points.shape)
    facing = ((normals * direction).sum(-1) > 0).nonzero()[:, 0]
    clear = torch.ones(len(points), dtype=torch.bool, device=points.device)
    start = lifted(points, normals)[facing]
    reach = torch.inf if distance is None else distance[facing].double()
    clear[facing] = ~solid.blocks(start, direction[facing].double(), reach)
    return clear
