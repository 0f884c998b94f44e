"""What reaches points of a surface straight from the lights, less what its solid hides."""

import math
from collections.abc import Iterator, Sequence

import torch
from torch import Tensor

from inverse.lights import Ambient, Arrival, Directional, Light
from inverse.solids import Solid
from inverse.visibility import distance_to, shadowless, unshadowed


def arriving(light: Directional, points: Tensor, normals: Tensor, solid: Solid | None) -> Iterator[Arrival]:
    """The directions from which a light reaches points (point, 3), with no irradiance where the solid hides it."""
    for arrival in light.arrivals(points):
        if solid is None or shadowless(solid, light) is not None:
            yield arrival
            continue
        clear = unshadowed(solid, points, normals, arrival.direction, distance_to(light, points))
        yield arrival._replace(irradiance=arrival.irradiance * clear[:, None])


def direct_irradiance(
    lights: Sequence[Light], points: Tensor, normals: Tensor, solid: Solid | None, sky: Tensor | None = None
) -> Tensor:
    """Irradiance (point, 1 or channel) at points (point, 3) of unit normals: (24), (26).

    `sky` is the share (point,) of uniform light that nothing hides; all of it if None.
    """
    total = normals.new_zeros(len(normals), 1)
    for light in lights:
        if isinstance(light, Ambient):
            uniform = math.pi * torch.atleast_1d(torch.as_tensor(light.radiance)).to(normals)
            total = total + (uniform if sky is None else uniform * sky[:, None])
            continue
        for arrival in arriving(light, points, normals, solid):
            cosine = (normals * arrival.direction).sum(-1, keepdim=True).clamp(min=0)
            total = total + cosine * arrival.irradiance
    return total
