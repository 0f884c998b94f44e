"""Recover the reflectance of a surface of known shape from photographs under known lights.

The frame is x right, y up, z towards the camera. A scene says what was photographed; `render` shades
it, its sensor takes the photograph, and `fit` finds the parameters of a BRDF that explain photographs.
"""

import warnings

from inverse.files import (
    Measurements,
    Photographs,
    read_gonioreflectometer,
    read_image,
    read_merl,
    read_optical_constants,
    read_stack,
    write_image,
    write_stack,
)
from inverse.fitting import FitError, FitResult, bootstrap, fit, fit_measurements, usable, weighted_reflectance
from inverse.planning import Effect, Plan, PlannedFit, everything, plan
from inverse.profiles import belly_row, cross_section, peak_position
from inverse.scene import (
    Ambient,
    Arrival,
    Disc,
    Distant,
    Environment,
    Light,
    Point,
    Rays,
    Scene,
    Sensor,
    SimplerLight,
    StoredLight,
    Surface,
    cuboid,
    cylinder,
    from_depth,
    from_normals,
    orthographic,
    perspective,
    pinhole,
    plane,
    revolution,
    side_by_side,
    sphere,
    vase,
)
from inverse.shapes import Absence, Body, Cuboid, Cylinder, Group, Patches, Plane, Revolution, Solid, Sphere
from inverse.transport import (
    exitance,
    irradiance,
    render,
    solid_angle_of_band,
    solid_angle_of_cone,
    solid_angle_of_patch,
)

__all__ = [
    "Absence",
    "Ambient",
    "Arrival",
    "Body",
    "Cuboid",
    "Cylinder",
    "Disc",
    "Distant",
    "Effect",
    "Environment",
    "FitError",
    "FitResult",
    "Group",
    "Light",
    "Measurements",
    "Patches",
    "Photographs",
    "Plan",
    "Plane",
    "PlannedFit",
    "Point",
    "Rays",
    "Revolution",
    "Scene",
    "Sensor",
    "SimplerLight",
    "Solid",
    "Sphere",
    "StoredLight",
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
    "perspective",
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

_RENAMED = {"photographed": "perspective"}


def __getattr__(name: str) -> object:
    """Names of version 0.1, for one more version."""
    if name not in _RENAMED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(f"inverse.{name} is now inverse.{_RENAMED[name]}", DeprecationWarning, stacklevel=2)
    return globals()[_RENAMED[name]]
