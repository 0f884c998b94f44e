"""The sample on which effects are measured stands for the whole image: what its pixels stand for is counted again."""

import pytest
import torch

from inverse import Distant, Scene, sphere, vase
from inverse.planning.pilot import stratified_sample
from inverse.transport.shadows import Shadows

D = torch.float64
RAISED = Distant(torch.tensor([0.3, 1.6, 0.6], dtype=D))
# More than the strata of these scenes, of which each then has a pixel.
ENOUGH = 400


def test_counts_of_the_sample_are_those_of_the_image():
    """In light and in shadow, to the right and to the left, whole and cut by the rim: each as often as it is there."""
    surface = vase(60, 60, dtype=D)
    scene = Scene(surface, [RAISED])
    points, normals = surface.points[surface.mask], surface.normals[surface.mask]
    clear = Shadows(surface.solid, points, normals).clear(RAISED.direction)
    steep = torch.rad2deg(torch.acos(normals[:, 2])) >= 45
    kinds = {"right": normals[:, 0] > 0, "up": normals[:, 1] > 0, "in shadow": ~clear, "steep": steep}
    _, pixels, stands_for = stratified_sample(scene, ENOUGH, 0, extremes=False)
    assert int(pixels.sum()) == ENOUGH == len(stands_for)
    assert stands_for.sum().item() == pytest.approx(int(surface.mask.sum()))
    for name, kind in kinds.items():
        counted = stands_for[kind[pixels[surface.mask]]].sum().item()
        assert 0 < counted == pytest.approx(int(kind.sum())), name


def test_pixels_cut_by_the_rim_are_counted_too():
    scene = Scene(sphere(40, 40, samples=2, dtype=D), [Distant.from_angle(20)])
    coverage = scene.surface.coverage()
    _, pixels, stands_for = stratified_sample(scene, ENOUGH, 0, extremes=False)
    cut = coverage[pixels] < 1
    assert stands_for[cut].sum().item() == pytest.approx(int(((coverage > 0) & (coverage < 1)).sum()))


def test_the_scene_of_the_sample_shows_its_pixels_and_no_others():
    scene = Scene(sphere(40, 40, samples=2, dtype=D), [Distant.from_angle(20)])
    small, pixels, _ = stratified_sample(scene, 100, 0, extremes=False)
    assert torch.equal(small.surface.coverage(), scene.surface.coverage() * pixels)
    assert torch.equal(small.surface.normals, scene.surface.normals)


def test_a_sample_of_everything_is_the_image():
    scene = Scene(sphere(20, 20, dtype=D), [Distant.from_angle(20)])
    for extremes in (False, True):
        _, pixels, stands_for = stratified_sample(scene, 10**6, 0, extremes=extremes)
        assert torch.equal(pixels, scene.surface.mask)
        assert torch.equal(stands_for, torch.ones_like(stands_for))


def test_extremes_hold_the_most_curved_pixel():
    surface = vase(40, 40, samples=2, dtype=D)
    scene, spread = Scene(surface, [RAISED]), surface.spread_of_normals()
    shown = surface.coverage() > 0
    most = spread[shown].max()
    for seed in range(3):
        _, pixels, _ = stratified_sample(scene, 150, seed, extremes=True)
        assert spread[pixels].max() == most


def test_samples_repeat_with_the_seed_and_differ_without():
    scene = Scene(sphere(40, 40, dtype=D), [Distant.from_angle(20)])
    first, again, other = (stratified_sample(scene, 60, seed, extremes=False)[1] for seed in (1, 1, 2))
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
