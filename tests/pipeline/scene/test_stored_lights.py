"""Lights in numbers: what is made anew gives every point of a scene the light that was stored."""

import pytest
import torch

from inverse import Ambient, Disc, Distant, Environment, Point, Rays, StoredLight, irradiance, sphere
from inverse.scene.stored_lights import from_numbers

D = torch.float64
SIDE = torch.tensor([0.6, 0.0, 0.8], dtype=D)
UP = torch.tensor([0.0, 0.0, 1.0], dtype=D)
COLOUR = torch.tensor([1.0, 0.5, 0.25], dtype=D)
SKY = Environment(torch.rand(4, 8, 3, dtype=D, generator=torch.Generator().manual_seed(2)))


@pytest.mark.parametrize(
    ("light", "kinds"),
    [
        (Distant(SIDE, 2.0), [Distant]),
        (Distant(SIDE, COLOUR), [Distant]),
        (Point(torch.tensor([1.0, 2.0, 3.0], dtype=D), COLOUR), [Point]),
        (Disc(SIDE, 0.4, COLOUR), [Rays]),
        (SKY, [Rays]),
        (Ambient(0.3), [Ambient]),
        (Rays(torch.stack((UP, SIDE)), torch.stack((COLOUR, 2 * COLOUR))), [Rays]),
    ],
    ids=lambda k: type(k).__name__,
)
def test_numbers_give_the_same_light(light, kinds):
    surface = sphere(12, 12, dtype=D)
    anew = from_numbers(light.stored(surface.points[surface.mask]))
    assert [type(k) for k in anew] == kinds
    torch.testing.assert_close(irradiance(surface, anew), irradiance(surface, (light,)), rtol=1e-14, atol=1e-15)


def test_rays_on_a_sphere_are_a_sum_of_cosines():
    surface = sphere(12, 12, dtype=D)
    normals = surface.normals[surface.mask]
    both = Rays(torch.stack((UP, SIDE)), torch.stack((COLOUR, 2 * COLOUR)))
    wanted = (normals @ UP).clamp(min=0)[:, None] * COLOUR + (normals @ SIDE).clamp(min=0)[:, None] * 2 * COLOUR
    torch.testing.assert_close(irradiance(surface, (both,)), wanted, rtol=1e-14, atol=0)


def test_a_sum_is_stored_in_one():
    lamp = torch.tensor([[0.0, 0.0, 4.0], [1.0, 1.0, 4.0]], dtype=D)
    numbers = StoredLight(UP[None], COLOUR[None], lamp, torch.tensor([[2.0], [3.0]], dtype=D), COLOUR)
    assert [type(k) for k in from_numbers(numbers)] == [Distant, Point, Point, Ambient]


def test_a_bundle_from_one_side_has_its_shadow_from_the_middle():
    strengths = torch.tensor([[1.0], [1.0]], dtype=D)
    (beam,) = Rays(torch.stack((UP, SIDE)), strengths).beams()
    torch.testing.assert_close(beam.direction, (UP + SIDE) / (UP + SIDE).norm())
    torch.testing.assert_close(beam.irradiance, torch.tensor([2.0], dtype=D))
    assert Rays(torch.stack((UP, -UP)), strengths).beams() == ()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Rays(UP, COLOUR[None]), r"directions \(ray, 3\) and irradiances \(ray, channel\)"),
        (lambda: Rays(UP[None], COLOUR[None].repeat(2, 1)), r"found \(1, 3\) and \(2, 3\)"),
        (lambda: Rays(2 * UP[None], COLOUR[None]), r"Rays\.directions must be unit vectors; found lengths 2"),
        (lambda: Rays(UP[None], -COLOUR[None]), r"Rays\.irradiances must be finite and not negative"),
        (lambda: from_numbers(StoredLight(directions=UP[None])), "irradiances with its directions"),
        (lambda: from_numbers(StoredLight(intensities=COLOUR[None])), "intensities with its positions"),
        (lambda: from_numbers(StoredLight(positions=UP, intensities=COLOUR[None])), r"positions \(lamp, 3\)"),
        (lambda: from_numbers(StoredLight()), "found none of them"),
    ],
)
def test_numbers_that_are_no_light(make, message):
    with pytest.raises(ValueError, match=message):
        make()
