"""Directions in float64, as vectors and as points of the slope plane."""

import math

import numpy as np
import torch

from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles

F64 = torch.float64


def f64(*values):
    return [torch.tensor(v, dtype=F64) for v in values]


def random_plane(count, seed=0, top=85.0):
    rng = np.random.default_rng(seed)
    theta = torch.tensor(rng.uniform(0, math.radians(top), (2, count)))
    return slope_plane_from_angles(theta[0], theta[1], torch.tensor(rng.uniform(0, math.pi, count)))


def unit(theta, phi):
    return torch.tensor([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)], dtype=F64)


UP = unit(0.0, 0.0)
