"""Light that reaches points of a surface straight from the lights, less what the solid hides."""

import math
from collections.abc import Iterator, Sequence

from torch import Tensor

from inverse.scene import Arrival, Light, as_channels
from inverse.shapes import Solid, dots
from inverse.transport.shadows import Shadows


def unhidden(light: Light, shadows: Shadows) -> Iterator[Arrival]:
    """The directions from which a light reaches the points, with no irradiance where the solid hides it."""
    shadowless = shadows.solid is None or light.why_shadowless(shadows.solid) is not None
    for arrival in light.arrivals(shadows.points):
        if shadowless:
            yield arrival
            continue
        clear = shadows.clear(arrival.direction, light.distance(shadows.points))
        yield arrival._replace(irradiance=arrival.irradiance * clear[:, None])


def direct_irradiance(
    lights: Sequence[Light], points: Tensor, normals: Tensor, solid: Solid | None, sky: Tensor | None = None
) -> Tensor:
    """Irradiance (point, 1 or channel) at points (point, 3) of unit normals.

    `sky` is the share (point,) of uniform light that nothing hides; all of it if None.
    """
    total, shadows = normals.new_zeros(len(normals), 1), Shadows(solid, points, normals)
    for light in lights:
        if light.uniform is not None:
            uniform = math.pi * as_channels(light.uniform, normals)
            total = total + (uniform if sky is None else uniform * sky[:, None])
        for arrival in unhidden(light, shadows):
            cosine = dots(normals, arrival.direction)[:, None].clamp(min=0)
            total = total + cosine * arrival.irradiance
    return total
