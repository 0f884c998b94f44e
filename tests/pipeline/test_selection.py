"""Which samples count: `usable` keeps to its angles."""

import numpy as np
import pytest
import torch

from inverse import Ambient, Distant, Scene, sphere, usable


def test_usable_by_angles():
    surface = sphere(41, 41, dtype=torch.float64)
    angles = (-35.0, 0.0, 50.0)
    scene = Scene(surface, [Distant.from_angle(a) for a in angles])
    kept = usable(scene, limb=60, highlight=12, shadow=75)
    nx, _, nz = (k.numpy() for k in surface.normals.unbind(-1))
    for image, angle in zip(kept, np.radians(angles), strict=True):
        seen = np.degrees(np.arccos(nz))
        lit = np.degrees(np.arccos(np.clip(nx * np.sin(angle) + nz * np.cos(angle), -1, 1)))
        # half vector of horizontal light and view: at half the angle
        half = np.degrees(np.arccos(np.clip(nx * np.sin(angle / 2) + nz * np.cos(angle / 2), -1, 1)))
        expected = surface.mask.numpy() & (seen <= 60) & (lit <= 75) & (half > 12)
        np.testing.assert_array_equal(image.numpy(), expected)


def test_usable_takes_every_light_and_sample():
    left, right = Distant.from_angle(-50), Distant.from_angle(50)
    both = usable(Scene(sphere(21, 21), [[left, right, Ambient(0.1)]]))[0]
    each = usable(Scene(sphere(21, 21), [left, right]))
    assert torch.equal(both, each.all(0))
    fine = usable(Scene(sphere(21, 21, samples=4), [left]))
    assert fine.shape == (1, 21, 21)
    assert not (fine[0] & ~each[0] & (sphere(21, 21, samples=4).coverage() < 1)).any()


def test_usable_refuses():
    scene = Scene(sphere(21, 21), [Distant.from_angle(0)])
    with pytest.raises(ValueError, match=r"limits must lie in \[0, 90\] degrees; found limb 95"):
        usable(scene, limb=95)
    with pytest.raises(ValueError, match=r"no pixel is left with limb 30.*highlight 40"):
        usable(scene, limb=30, highlight=40)
