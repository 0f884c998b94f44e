"""What patches send each other, against closed forms."""

import math

import pytest
import torch

from inverse import Sphere, vase
from inverse.shapes.form_factors import PairExchange, RingExchange, form_factors
from inverse.shapes.patches import Patches

D = torch.float64


def cavity(count, radius=0.7):
    """The inside of a sphere: every patch sees every other, with the share area/(4 pi R^2)."""
    points, normals, areas = Sphere(radius, (0.1, 0.2, -0.3)).patches(count)
    return PairExchange(None, Patches(points, -normals, areas))


@pytest.mark.parametrize("count", [300, 3000])
def test_spherical_cavity(count):
    """T_b = mean of E for every b, so that the sum at albedo rho is E + rho mean(E)/(1 - rho)."""
    room, within = cavity(count), 8 / count  # what a patch and its neighbours send each other is not resolved
    height = room.patches.normals[:, 1:]
    direct = torch.cat(((height > 0.3).to(D), (1 + height).square()), -1)
    mean, rho, total, arrived = direct.mean(0), 0.6, direct, direct
    for b in range(1, 30):
        arrived = room.carry(arrived)
        torch.testing.assert_close(arrived, mean.expand(arrived.shape), atol=0, rtol=within * b)
        total = total + rho**b * arrived
    expected = direct + rho * mean / (1 - rho)
    torch.testing.assert_close(total, expected, atol=0, rtol=within / (1 - rho))
    torch.testing.assert_close(room.share, torch.ones(count, dtype=D), atol=within, rtol=0)
    # at a point of the wall that is no patch's middle
    inward = torch.tensor([[0.6, 0.0, 0.8]], dtype=D)
    point = torch.tensor([[0.1, 0.2, -0.3]], dtype=D) - 0.7 * inward
    torch.testing.assert_close(room.arriving(direct, point, inward), mean[None], atol=0, rtol=within)


def plate(count, y, facing):
    side = (torch.arange(count, dtype=D) + 0.5) / count - 0.5
    x, z = (k.flatten() for k in torch.meshgrid(side, side, indexing="ij"))
    normal = torch.tensor([0.0, facing, 0.0], dtype=D)
    return Patches(torch.stack((x, 0 * x + y, z), -1), normal.expand(count**2, 3), 0 * x + 1 / count**2)


@pytest.mark.parametrize("apart", [0.2, 0.5, 1.0, 3.0])
def test_two_facing_squares(apart):
    """Form factor of equal parallel squares, e.g. Howell's catalogue C-11."""
    x = 1 / apart
    expected = (2 / (math.pi * x * x)) * (
        0.5 * math.log((1 + x * x) ** 2 / (1 + 2 * x * x))
        + 2 * x * math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x))
        - 2 * x * math.atan(x)
    )
    below, above = plate(24, 0.0, 1.0), plate(24, apart, -1.0)
    factors = form_factors(below.points, below.normals, above, None)
    assert factors.sum(-1).mean().item() == pytest.approx(expected, rel=0.01)


def test_a_disc_straight_ahead_takes_no_more_than_the_sky():
    """A disc of radius R at height h takes R^2/(R^2 + h^2), and small patches aside cos cos' A/(pi r^2)."""
    up = torch.tensor([[0.0, 1.0, 0.0]], dtype=D)
    for height in (1e-6, 0.1, 1.0, 10.0):
        disc = Patches(height * up, -up, torch.tensor([math.pi * 0.3**2], dtype=D))
        expected = 0.09 / (0.09 + height**2)
        assert form_factors(0 * up, up, disc, None).item() == pytest.approx(expected, rel=1e-12)
    aside = Patches(torch.tensor([[3.0, 4.0, 0.0]], dtype=D), torch.tensor([[-1.0, 0, 0]], dtype=D), up[0, 1:2] * 1e-6)
    assert form_factors(0 * up, up, aside, None).item() == pytest.approx(0.8 * 0.6e-6 / (25 * math.pi), rel=1e-6)


def test_rings_carry_as_every_pair_does():
    solid = vase(8, 8).solid
    rings = RingExchange(solid, solid.wall(20), 20, solid.on_end)
    pairs = PairExchange(solid, rings.patches)
    exitance = torch.rand(2, 400, 3, generator=torch.Generator().manual_seed(0), dtype=D)
    torch.testing.assert_close(rings.carry(exitance), pairs.carry(exitance))
    torch.testing.assert_close(rings.share, pairs.share)
    assert rings.share.max() > 0.05
