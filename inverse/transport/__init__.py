"""Light on its way: shadows, what lights and other parts of a solid bring, and the image a camera gets of it."""

from inverse.transport.direct import unhidden
from inverse.transport.radiometry import (
    exitance,
    irradiance,
    solid_angle_of_band,
    solid_angle_of_cone,
    solid_angle_of_patch,
)
from inverse.transport.radiosity import why_no_interreflection
from inverse.transport.rendering import Contraction, images_of, radiance_of, render
from inverse.transport.shadows import Shadows

__all__ = [
    "Contraction",
    "Shadows",
    "exitance",
    "images_of",
    "irradiance",
    "radiance_of",
    "render",
    "solid_angle_of_band",
    "solid_angle_of_cone",
    "solid_angle_of_patch",
    "unhidden",
    "why_no_interreflection",
]
