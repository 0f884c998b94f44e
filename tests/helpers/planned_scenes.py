"""Scenes and a material to plan."""

import torch

from inverse import (
    Ambient,
    Disc,
    Distant,
    Group,
    Plane,
    Point,
    Scene,
    Sensor,
    Sphere,
    cylinder,
    orthographic,
    perspective,
    pinhole,
    plane,
    sphere,
    vase,
)
from torchbrdf import GGX, Lambert, OrenNayar, RoughSurface

FRONT, OBLIQUE = Distant.from_angle(0), Distant.from_angle(20)
UP = torch.tensor([0.5, 1.0, 1.0])


def clay(rho=0.7, sigma=0.6):
    return RoughSurface(albedo=rho, sigma=sigma, bounces="all", nodes=8)


SCENES = {
    "sphere": lambda: (Scene(sphere(32, 32, samples=2), [FRONT]), clay()),
    "sphere, lamp nearby, gloss": lambda: (
        Scene(sphere(32, 32, samples=2), [Point(torch.tensor([1.0, 0.5, 3.0]), 9.0)]),
        1.0 * clay(0.5, 0.3) + 0.3 * GGX(alpha=0.4),
    ),
    "vase, two images": lambda: (Scene(vase(32, 32, samples=2), [FRONT, OBLIQUE]), clay()),
    "vase, raised light, ambient": lambda: (
        Scene(vase(32, 32, samples=2), [[Distant(UP), Ambient(0.02)]]),
        OrenNayar(albedo=0.6, sigma=0.4),
    ),
    "cylinder at 60 degrees": lambda: (Scene(cylinder(32, 32, samples=2), [Distant.from_angle(60)]), clay(0.9, 0.3)),
    "plane": lambda: (Scene(plane(16, 16), [Distant.from_angle(30)]), clay(0.9, 0.3)),
    "dark and smooth, through a pinhole": lambda: (
        Scene(perspective(Sphere(0.7), pinhole(32, 32, field_of_view=20), samples=2), [Point(40 * UP, 4000.0)]),
        clay(0.1, 0.05),
    ),
    "ball on a table in the sun": lambda: (
        Scene(
            orthographic(Group((Sphere(0.5), Plane((0.0, 0.9, 0.44), (0.0, -0.6, 0.0)))), 32, 32, samples=2),
            [Disc(UP, 0.02)],
        ),
        Lambert(albedo=0.5),
    ),
}

SENSOR = Sensor(exposure=3.0, read_noise=0.01)
