"""What a scene takes, and what it gives those who shade it."""

import pytest
import torch

from inverse import Ambient, Disc, Distant, Sensor, vase
from inverse.scene.scene import Scene
from inverse.scene.surface import sphere


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scene(sphere(8, 8), []), r"Scene\.lights must hold .*found none"),
    ],
)
def test_a_scene_has_an_image(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_light_alone_stands_for_a_set_of_one():
    one, other = Distant.from_angle(0), Ambient(0.1)
    scene = Scene(sphere(8, 8), [one, [one, other]])
    assert scene.lights == ((one,), (one, other))
    assert scene.images == 2
    assert scene.sensor == Sensor()
    with pytest.raises(TypeError, match="found a single light"):
        Scene(sphere(8, 8), one)  # pyright: ignore
    with pytest.raises(ValueError, match="one light for each; found none"):
        Scene(sphere(8, 8), [one, []])


@pytest.mark.parametrize("shadows", [True, False])
@pytest.mark.parametrize("between_parts", [True, False])
def test_points_know_the_solid_for_what_the_scene_asks(shadows, between_parts):
    surface = vase(12, 10, samples=2)
    points = Scene(surface, [Ambient(0.1)], shadows=shadows, between_parts=between_parts).footprints()
    assert points.solid is (surface.solid if shadows else None)
    assert points.partner is (surface.solid if between_parts else None)
    assert len(points.points) == int(surface.mask.sum())
    merged = Scene(surface, [Ambient(0.1)], fully_sampled=torch.zeros(12, 10, dtype=torch.bool)).footprints()
    full = surface.coverage() == 1
    assert len(merged.points) == int(surface.mask.sum()) - 3 * int(full.sum())


def test_beams_are_of_the_lights_whose_shadows_have_an_edge():
    sun = Disc(torch.tensor([0.0, 0.6, 0.8]), 0.01)
    scene = Scene(sphere(8, 8), [[Distant.from_angle(0), Ambient(0.1)], sun])
    directions = [beam.parallel for beam in scene.beams()]
    assert len(directions) == 2
    torch.testing.assert_close(directions[0], torch.tensor([0.0, 0.0, 1.0]), check_dtype=False)
    torch.testing.assert_close(directions[1], torch.tensor([0.0, 0.6, 0.8]), check_dtype=False)
