"""Cast shadows: does the object itself hide a light from a point of its surface?

Attached shadows, where the surface faces away from the light, are not the matter here: the light's cosine
makes them. A shadow is there or not, so these masks are piecewise constant. They are differentiable almost
everywhere, with zero gradient: how a shadow's edge moves with the light or the shape is not followed.
"""

import torch
from torch import Tensor

from inverse.lights import Ambient, Distant, Light, Point
from inverse.solids import Solid
from inverse.turned import Revolution

# How far off the surface, along its normal, rays start: a share of the point's largest coordinate, a hundred times
# the rounding of float32, so that points stored in either precision give the same mask.
_CLEARANCE = 1e-5


def shadowless(solid: Solid | None, light: Light) -> str | None:
    """Why nothing of this solid can be seen to cast a shadow on itself under this light; None where something may.

    Args:
        solid: of the surface; None where only the side in the image is known.
    The reasons are certain, bar that of an unknown solid: shadows may fall there, and cannot be found.
    """
    if isinstance(light, Ambient):
        return "ambient light comes from everywhere: its hidden share is sky_share's"
    if solid is None:
        return "unknown: nothing but the visible side is given"
    if solid.convex:
        return "convex: a ray that leaves the surface meets it nowhere else"
    # a level ray stays in a cross-section; from a point of a disc that faces the light it leaves the disc
    if isinstance(solid, Revolution) and isinstance(light, Distant) and light.direction[1] == 0:
        return "every level cross-section is a disc, which a level light lights to its limb"
    return None


def distance_to(light: Light, points: Tensor) -> Tensor | None:
    """Distance (point,) from points (point, 3) to a lamp; None for a light at infinity."""
    return (light.position.to(points) - points).norm(dim=-1) if isinstance(light, Point) else None


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


def lifted(points: Tensor, normals: Tensor) -> Tensor:
    """Points (point, 3) a hair off the surface, where rays may start, in float64."""
    points = points.double()
    return points + _CLEARANCE * points.abs().amax(-1, keepdim=True) * normals.double()
