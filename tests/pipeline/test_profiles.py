"""Cross-sections through the belly, against the geometry they cut."""

import numpy as np
import pytest
import torch

from inverse import Distant, Scene, belly_row, cross_section, peak_position, render, sphere, vase
from inverse.scene.surface import vase_profile
from torchbrdf import Lambert

DOUBLE = torch.float64


def test_belly_is_where_the_profile_is_widest():
    heights = np.linspace(-0.9, 0.9, 10001)
    widest = heights[vase_profile()(heights).argmax()]
    row = belly_row(vase(512, 512))
    assert 1 - 2 * (row + 0.5) / 512 == pytest.approx(widest, abs=0.02)  # flat there: within five rows


def test_section_of_a_lambertian_sphere_is_the_cosine():
    surface = sphere(201, 201, radius=0.8, dtype=DOUBLE)
    image = render(Scene(surface, [Distant.from_angle(20)]), Lambert(albedo=torch.tensor(0.6, dtype=DOUBLE)))[0]
    position, brightness = cross_section(image, surface)
    x = position * (brightness.size / 2) * 2 / 201 / 0.8  # half the pixels across, in radii
    normal = np.stack((x, np.sqrt(1 - x * x)))
    light = np.array([np.sin(np.radians(20)), np.cos(np.radians(20))])
    expected = 0.6 / np.pi * np.maximum(0, light @ normal)
    np.testing.assert_allclose(brightness, expected, atol=1e-9)
    assert peak_position(position, brightness) == pytest.approx(np.sin(np.radians(20)), abs=0.02)


def test_peak_of_a_noisy_parabola():
    position = np.linspace(-1, 1, 301)
    noise = np.random.default_rng(0).normal(0, 0.01, 301)
    assert peak_position(position, 1 - (position - 0.3) ** 2 + noise) == pytest.approx(0.3, abs=0.1)
