"""Light that reaches points of a surface straight from the lights, less what the solid hides."""

import math
from collections.abc import Iterator, Sequence

from torch import Tensor

from inverse.scene import Arrival, Light, as_channels
from inverse.shapes import Solid
from inverse.transport.shadows import unshadowed


def unhidden(light: Light, points: Tensor, normals: Tensor, solid: Solid | None) -> Iterator[Arrival]:
    """The directions from which a light reaches points (point, 3), with no irradiance where the solid hides it."""
    for arrival in light.arrivals(points):
        if solid is None or light.why_shadowless(solid) is not None:
            yield arrival
            continue
        clear = unshadowed(solid, points, normals, arrival.direction, light.distance(points))
        yield arrival._replace(irradiance=arrival.irradiance * clear[:, None])


def direct_irradiance(
    lights: Sequence[Light], points: Tensor, normals: Tensor, solid: Solid | None, sky: Tensor | None = None
) -> Tensor:
    """Irradiance (point, 1 or channel) at points (point, 3) of unit normals.

    `sky` is the share (point,) of uniform light that nothing hides; all of it if None.
    """
    total = normals.new_zeros(len(normals), 1)
    for light in lights:
        if light.uniform is not None:
            uniform = math.pi * as_channels(light.uniform, normals)
            total = total + (uniform if sky is None else uniform * sky[:, None])
        for arrival in unhidden(light, points, normals, solid):
            cosine = (normals * arrival.direction).sum(-1, keepdim=True).clamp(min=0)
            total = total + cosine * arrival.irradiance
    return total
