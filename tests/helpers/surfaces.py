"""What a surface shows, and directions to lights."""

import math

import torch

D = torch.float64


def towards(azimuth: float, elevation: float) -> torch.Tensor:
    """Unit vector to a light: degrees to the right of the camera and above the horizon."""
    a, e = math.radians(azimuth), math.radians(elevation)
    return torch.tensor([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)], dtype=D)


def masked(surface):
    return surface.points[surface.mask], surface.normals[surface.mask]
