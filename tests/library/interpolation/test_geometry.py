"""Coordinates of light and view against the plane they are drawn in."""

import math

import pytest
import torch
from torch.testing import assert_close

from torchbrdf import Cosines
from torchbrdf.interpolation.geometry import MOST_GRAZING, angles_at, geometry_coordinates
from torchbrdf.testing import random_directions

F64 = torch.float64


def cosines_of(theta, other, dphi):
    theta, other, dphi = torch.broadcast_tensors(*(torch.as_tensor(a, dtype=F64) for a in (theta, other, dphi)))
    light = torch.stack((theta.sin(), 0 * theta, theta.cos()), -1)
    view = torch.stack((other.sin() * dphi.cos(), other.sin() * dphi.sin(), other.cos()), -1)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=F64).expand_as(light)
    return Cosines.of(up, light, view, normalize=True)


def by_complex_numbers(theta, other, dphi):
    """x up to its scale, v and z from two points of the complex plane."""
    alpha, beta = max(theta, other), min(theta, other)
    far, near = math.atanh(math.sin(alpha)), math.atanh(math.sin(beta))
    turned = 2 * math.atan((1 + 0.3 * near**4 / far**2) * math.tan(dphi / 2))
    p, q = complex(far), near * complex(math.cos(turned), math.sin(turned))
    first, second = abs(p - q), abs(p + q)
    slant = ((p - q) * (p + q).conjugate()).real / (first * second)  # the cosine between both
    return far / (1.5 + far), first / (first + second), slant


@pytest.mark.parametrize("angles", [(0.4, 1.2, 0.3), (1.5, 1.49, 3.0), (0.02, 0.3, 1.6), (1.3, 1.2999, 1e-4)])
def test_against_points_of_a_plane(angles):
    at = geometry_coordinates(cosines_of(*angles))
    whole = math.acosh(1 / MOST_GRAZING)
    x, v, z = by_complex_numbers(*angles)
    expected = torch.tensor([x * (1.5 + whole) / whole, v, z], dtype=F64)
    assert_close(torch.stack(at[:3]), expected, rtol=1e-9, atol=1e-9)
    assert_close(at.mean_cosine, torch.tensor((math.cos(angles[0]) + math.cos(angles[1])) / 2, dtype=F64))


def test_a_box_holds_all_directions_and_each_of_its_points_is_one():
    draw = torch.rand(3, 5000, dtype=F64, generator=torch.Generator().manual_seed(0))
    theta, other, dphi = angles_at(*draw)
    assert ((other <= theta) & (dphi >= 0) & (dphi <= math.pi) & (theta.cos() >= MOST_GRAZING - 1e-12)).all()
    at = geometry_coordinates(cosines_of(theta, other, dphi))
    inside = (other > 1e-3) & (draw[0] > 0.02)  # next to the normal directions do not tell azimuths apart
    assert_close(torch.stack(at[:3])[:, inside], draw[:, inside], rtol=0, atol=1e-6)
    for dtype in (torch.float32, F64):
        at = geometry_coordinates(Cosines.of(*random_directions(5000, dtype=dtype, max_angle=1.5707)))
        for part in at[:3]:
            assert ((part > -1e-5) & (part < 1 + 1e-5)).all()


def test_cones_are_faces():
    theta = torch.tensor([0.1, 0.7, 1.4, 1.55], dtype=F64)
    assert (geometry_coordinates(cosines_of(theta, theta, 0.0)).apart < 1e-7).all()
    assert (geometry_coordinates(cosines_of(theta, theta, math.pi)).apart > 1 - 1e-7).all()


def test_exchanging_light_and_view_changes_no_bit():
    normal, light, view = random_directions(2000, dtype=F64, generator=torch.Generator().manual_seed(1))
    forth, back = (geometry_coordinates(Cosines.of(normal, *pair)) for pair in ((light, view), (view, light)))
    for a, b in zip(forth, back, strict=True):
        assert torch.equal(a, b)


def test_products_serve_as_well_as_vectors():
    c = Cosines.of(*random_directions(500, dtype=F64, generator=torch.Generator().manual_seed(2)))
    products = geometry_coordinates(Cosines.from_products(c.light, c.view, c.phase))
    for a, b in zip(products, geometry_coordinates(c), strict=True):
        assert_close(a, b, rtol=0, atol=1e-5)


def test_below_the_horizon_all_is_finite():
    up = torch.tensor([0.0, 0.0, 1.0], dtype=F64)
    for part in geometry_coordinates(Cosines.of(up, -up, up)):
        assert part.isfinite()
