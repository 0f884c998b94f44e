"""Recover the reflectance of a surface of known shape from photographs under known lights.

The frame is x right, y up, z towards the camera. A scene says what was photographed; `render` shades
it, its sensor takes the photograph, and `fit` finds the parameters of a BRDF that explain photographs.
"""

from inverse.bootstrap import bootstrap
from inverse.camera import photographed, pinhole
from inverse.fit import FitError, fit
from inverse.geometry import (
    Surface,
    cuboid,
    cylinder,
    orthographic,
    plane,
    revolution,
    side_by_side,
    sphere,
    vase,
)
from inverse.lights import Ambient, Disc, Distant, Environment, Point
from inverse.maps import from_depth, from_normals
from inverse.measured import Measurements, read_gonioreflectometer, read_merl, read_optical_constants
from inverse.measured_fit import fit_measurements, weighted_reflectance
from inverse.photos import Photographs, read_image, read_stack, usable, write_image, write_stack
from inverse.plan import Effect, Plan
from inverse.planning import plan
from inverse.profile import belly_row, cross_section, peak_position
from inverse.radiometry import exitance, irradiance, solid_angle_of_band, solid_angle_of_cone, solid_angle_of_patch
from inverse.result import FitResult
from inverse.scene import Scene
from inverse.sensor import Sensor
from inverse.shading import render
from inverse.simplify import everything
from inverse.solids import Cuboid, Cylinder, Group, Plane, Solid, Sphere
from inverse.turned import Revolution

__all__ = [
    "Ambient",
    "Cuboid",
    "Cylinder",
    "Disc",
    "Distant",
    "Effect",
    "Environment",
    "FitError",
    "FitResult",
    "Group",
    "Measurements",
    "Photographs",
    "Plan",
    "Plane",
    "Point",
    "Revolution",
    "Scene",
    "Sensor",
    "Solid",
    "Sphere",
    "Surface",
    "belly_row",
    "bootstrap",
    "cross_section",
    "cuboid",
    "cylinder",
    "everything",
    "exitance",
    "fit",
    "fit_measurements",
    "from_depth",
    "from_normals",
    "irradiance",
    "orthographic",
    "peak_position",
    "photographed",
    "pinhole",
    "plan",
    "plane",
    "read_gonioreflectometer",
    "read_image",
    "read_merl",
    "read_optical_constants",
    "read_stack",
    "render",
    "revolution",
    "side_by_side",
    "solid_angle_of_band",
    "solid_angle_of_cone",
    "solid_angle_of_patch",
    "sphere",
    "usable",
    "vase",
    "weighted_reflectance",
    "write_image",
    "write_stack",
]
