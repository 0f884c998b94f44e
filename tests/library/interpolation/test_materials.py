"""Coordinates of a material: ends, inverses, and what sigma = 0 asks of them."""

import math

import torch
from torch.testing import assert_close

from torchbrdf.interpolation.materials import albedo_at, albedo_coordinate, roughness_coordinate, sigma_at

UNIT = torch.linspace(0, 1, 33, dtype=torch.float64)


def test_inverses():
    assert_close(roughness_coordinate(sigma_at(UNIT)), UNIT)
    assert_close(albedo_coordinate(albedo_at(UNIT)), UNIT)


def test_ends():
    ends = torch.tensor([0.0, 1.0], dtype=torch.float64)
    assert_close(sigma_at(ends), ends * math.pi / 2, rtol=1e-12, atol=0)
    assert_close(albedo_at(ends), ends, rtol=0, atol=1e-12)
    assert (sigma_at(UNIT).diff() > 0).all()
    assert (albedo_at(UNIT).diff() > 0).all()


def test_even_in_sigma():
    sigma = torch.zeros((), dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(roughness_coordinate(sigma), sigma)
    assert slope == 0


def test_white_has_a_derivative():
    rho = torch.ones((), dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(albedo_coordinate(rho), rho)
    step = 1e-6
    below = albedo_coordinate(rho.detach() - step)
    assert_close(slope, (1 - below) / step, rtol=1e-4, atol=0)
