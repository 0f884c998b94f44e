"""Recover the reflectance of a surface of known shape from photographs under known lights.

The frame is x right, y up, z towards the camera. A scene says what was photographed; `render` shades
it, its sensor takes the photograph, and `fit` finds the parameters of a BRDF that explain photographs.
"""

from inverse.bootstrap import bootstrap
from inverse.fit import FitError, fit
from inverse.geometry import Surface, cylinder, from_depth, from_normals, plane, revolution, sphere, vase
from inverse.lights import Ambient, Distant
from inverse.measured import Measurements, read_gonioreflectometer, read_merl, read_optical_constants
from inverse.photos import Photographs, read_image, read_stack, usable, write_image, write_stack
from inverse.profile import belly_row, cross_section, peak_position
from inverse.result import FitResult
from inverse.scene import Scene
from inverse.sensor import Sensor
from inverse.shading import render
from inverse.solids import cuboid, side_by_side

__all__ = [
    "Ambient",
    "Distant",
    "FitError",
    "FitResult",
    "Measurements",
    "Photographs",
    "Scene",
    "Sensor",
    "Surface",
    "belly_row",
    "bootstrap",
    "cross_section",
    "cuboid",
    "cylinder",
    "fit",
    "from_depth",
    "from_normals",
    "peak_position",
    "plane",
    "read_gonioreflectometer",
    "read_image",
    "read_merl",
    "read_optical_constants",
    "read_stack",
    "render",
    "revolution",
    "side_by_side",
    "sphere",
    "usable",
    "vase",
    "write_image",
    "write_stack",
]
