"""Points of an image and their shares of the pixels."""

from dataclasses import replace

import pytest
import torch

from inverse import Distant, Scene, render, sphere, vase
from inverse.scene.footprints import Footprints
from torchbrdf import OrenNayar

D = torch.float64


def number(value):
    return torch.tensor(value, dtype=D)


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_shares_of_a_pixel_are_its_coverage(samples):
    surface = vase(20, 16, samples=samples, dtype=D)
    for detail in (None, torch.zeros(20, 16, dtype=torch.bool), torch.rand(20, 16) < 0.5):
        where = Footprints.of(surface, detail)
        found = where.to_image(torch.ones(len(where.points), 1, dtype=D))[..., 0]
        torch.testing.assert_close(found, surface.coverage())
        torch.testing.assert_close(where.normals.norm(dim=-1), torch.ones(len(where.points), dtype=D))


def test_one_point_a_pixel_errs_with_the_square_of_the_pixel():
    model, light = OrenNayar(albedo=number(0.7), sigma=number(0.5)), Distant.from_angle(20)
    errors = []
    for size in (32, 64, 128):
        surface = sphere(size, size, samples=2, dtype=D)
        scene = Scene(surface, [light])
        merged = replace(scene, fully_sampled=torch.zeros(size, size, dtype=torch.bool))
        inner = surface.normals[..., 2].unflatten(0, (size, 2)).unflatten(2, (size, 2)).amin((1, 3)) > 0.6
        difference = (render(scene, model) - render(merged, model))[0, ..., 0].abs()
        # in the mean: on the few pixels that a kink of the model crosses the error falls more slowly
        errors.append(difference[inner & (surface.coverage() == 1)].mean().item())
        assert len(merged.footprints().points) < 0.4 * len(scene.footprints().points)
    assert errors[0] / errors[1] > 3
    assert errors[1] / errors[2] > 3


def test_supersampled_rim_is_partly_covered():
    """A disk of radiance 1: each pixel is its covered share."""
    surface = sphere(12, 12, radius=0.9, samples=4, dtype=D)
    values = torch.ones(int(surface.mask.sum()), 1, dtype=D)
    torch.testing.assert_close(Footprints.of(surface).to_image(values)[..., 0], surface.coverage())
