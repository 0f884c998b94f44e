"""What tests of models ask with: float64 numbers, albedos by quadrature, a few directions, seeds."""

import math

import torch

from torchbrdf import fixed
from torchbrdf.testing import laws

COS = [0.05, 0.3, 0.8, 1.0]


def doubles(x):
    return torch.tensor(x, dtype=torch.float64)


def held(x):
    return fixed(doubles(x))


def albedo(brdf, cos, nodes=48):
    """By quadrature through `forward`, channel 0."""
    with torch.no_grad():
        return float(laws.albedo_by_quadrature(brdf, math.acos(cos), nodes)[0])


def few(n=200, max_angle=85.0):
    generator = torch.Generator().manual_seed(5)
    return laws.random_directions(n, dtype=torch.float64, generator=generator, max_angle=math.radians(max_angle))


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)
