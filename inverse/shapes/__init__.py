"""Known shapes as solids that rays meet, cut into patches that light each other. Nothing here knows a light."""

from inverse.shapes.form_factors import Exchange
from inverse.shapes.height_field import HeightField
from inverse.shapes.patches import Patches
from inverse.shapes.rays import dots, lifted
from inverse.shapes.revolution import Revolution
from inverse.shapes.solids import Absence, Body, Cuboid, Cylinder, Group, Plane, Solid, Sphere

__all__ = [
    "Absence",
    "Body",
    "Cuboid",
    "Cylinder",
    "Exchange",
    "Group",
    "HeightField",
    "Patches",
    "Plane",
    "Revolution",
    "Solid",
    "Sphere",
    "dots",
    "lifted",
]
