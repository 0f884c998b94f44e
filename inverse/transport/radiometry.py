"""Solid angles, irradiance and exitance: what the lights bring to a surface and what it sends back.

Source: Fleet & Hertzmann 2006, "Computer Graphics Lecture Notes", University of Toronto CSC418/CSCD18/CSC2504.
"""

import math
from dataclasses import replace

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor

from inverse.scene import Footprints, Light, Surface
from inverse.transport.direct import direct_irradiance
from inverse.transport.rendering import radiance_of
from torchbrdf import BRDF, any_tangent


def solid_angle_of_cone(half_angle: float) -> float:
    """2 pi (1 - cos(half_angle)) [sr] of a cone [rad], without losing the digits of a narrow one."""
    return 4 * math.pi * math.sin(half_angle / 2) ** 2


def solid_angle_of_band(polar: tuple[float, float], azimuth: tuple[float, float]) -> float:
    """Of the directions between two polar angles and two azimuths [rad]: (phi1 - phi0)(cos theta0 - cos theta1) [sr].

    Source: Fleet & Hertzmann 2006, eq. (13).
    """
    middle, half = (polar[0] + polar[1]) / 2, (polar[1] - polar[0]) / 2
    return (azimuth[1] - azimuth[0]) * 2 * math.sin(middle) * math.sin(half)


def solid_angle_of_patch(area: float, cosine: float, distance: float) -> float:
    """Of a small patch seen from afar: dA cos(theta)/r^2 [sr]; lengths in one unit.

    Source: Fleet & Hertzmann 2006, eq. (14).
    """
    return area * cosine / distance**2


def irradiance(surface: Surface, lights: tuple[Light, ...]) -> Tensor:
    """Irradiance (point, channel) that lights give the masked points of a surface; pi L under ambient light.

    Source: Fleet & Hertzmann 2006, eqs. (24), (26).
    """
    footprints = Footprints.of(surface)
    return direct_irradiance(lights, footprints.points, footprints.normals, footprints.solid)


def exitance(model: BRDF, surface: Surface, lights: tuple[Light, ...], *, nodes: int = 16) -> Tensor:
    """Light (point, channel) that the masked points send into all directions: int L (n.d) dw.

    Source: Fleet & Hertzmann 2006, eq. (22).
    Quadrature of the radiance over the views: `nodes` Gauss-Legendre cosines times 2 `nodes` azimuths. A lobe narrower
    than the nodes are apart is missed; a mirror lobe is left out.
    """
    footprints = Footprints.of(surface)
    normals = footprints.normals
    across = any_tangent(normals)
    turned = torch.linalg.cross(normals, across)
    total = normals.new_zeros(len(normals), 1)
    for x, weight in zip(*leggauss(nodes), strict=True):
        cos = (1 + x) / 2
        sin = math.sqrt((1 - cos) * (1 + cos))
        for step in range(2 * nodes):
            azimuth = math.pi * (step + 0.5) / nodes
            view = cos * normals + sin * (math.cos(azimuth) * across + math.sin(azimuth) * turned)
            seen = radiance_of(replace(footprints, view=view), lights)(model)
            total = total + seen * (cos * weight / 2 * math.pi / nodes)
    return total
