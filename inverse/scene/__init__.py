"""What was photographed: surfaces of known geometry, lights, cameras and the sensor."""

from inverse.scene.cameras import perspective, pinhole
from inverse.scene.footprints import Footprints
from inverse.scene.lights import (
    AMBIENT,
    MAP_DETAIL,
    NEAR_LIGHT,
    SOFTNESS,
    Ambient,
    Arrival,
    Disc,
    Distant,
    Environment,
    Light,
    Point,
    SimplerLight,
    StoredLight,
    as_channels,
)
from inverse.scene.maps import from_depth, from_normals
from inverse.scene.scene import Scene
from inverse.scene.sensor import Sensor
from inverse.scene.stored_lights import Rays, from_numbers
from inverse.scene.surface import (
    TO_CAMERA,
    Surface,
    cuboid,
    cylinder,
    orthographic,
    pixel_average,
    plane,
    revolution,
    side_by_side,
    sphere,
    vase,
)

__all__ = [
    "AMBIENT",
    "MAP_DETAIL",
    "NEAR_LIGHT",
    "SOFTNESS",
    "TO_CAMERA",
    "Ambient",
    "Arrival",
    "Disc",
    "Distant",
    "Environment",
    "Footprints",
    "Light",
    "Point",
    "Rays",
    "Scene",
    "Sensor",
    "SimplerLight",
    "StoredLight",
    "Surface",
    "as_channels",
    "cuboid",
    "cylinder",
    "from_depth",
    "from_normals",
    "from_numbers",
    "orthographic",
    "perspective",
    "pinhole",
    "pixel_average",
    "plane",
    "revolution",
    "side_by_side",
    "sphere",
    "vase",
]
