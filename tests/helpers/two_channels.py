"""A material of two channels, for the tests of stand-ins."""

import torch

D = torch.float64


def number(value):
    return torch.tensor(value, dtype=D)


def material(kind, **more):
    return kind(albedo=torch.tensor([0.7, 0.4], dtype=D), sigma=number(0.5), **more)
