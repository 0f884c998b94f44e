"""Which samples count: `usable` keeps to its angles, and cut-off noise does not shift a fit."""

import math

import numpy as np
import pytest
import torch
from scipy.stats import binom

from inverse import Ambient, Distant, Scene, Sensor, fit, render, sphere, usable
from torchbrdf import Lambert, OrenNayar


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


# --- clipping ---------------------------------------------------------------------------------------------

# 60 fits of a Lambertian sphere whose dark side is cut off at black. At two standard errors 95.45 % are expected;
# fewer than 51 of 60 come by chance in 5 of 10 000 cases for each of the rows below.
SEEDS, FEWEST = 60, 51
CLIPPED = Scene(
    sphere(16, 16, dtype=torch.float64),
    [Distant.from_angle(angle) for angle in (-60, 10, 75)],
    Sensor(exposure=2.0, read_noise=0.01),
)
TRUTH = {"albedo": 0.7, "exposure": 1.0, "ambient": 0.0, "sigma": 0.6}
NUISANCES = [(), ("free_exposure",), ("free_ambient",), ("free_exposure", "free_ambient")]


def covered(scene, truth, start, nuisances, seeds):
    """Of each parameter's first entry, in how many fits the interval of two standard errors holds the truth."""
    clean = render(scene, truth).detach()
    counts = {}
    for seed in range(seeds):
        noisy = scene.sensor.expose(clean, torch.Generator().manual_seed(seed))
        result = fit(scene, noisy, start, **dict.fromkeys(nuisances, True))
        assert result.status == "converged"
        for name, value in result.parameters.items():
            hit = (value - TRUTH[name]).abs() < 2 * result.standard_error[name]
            counts[name] = counts.get(name, 0) + int(hit.flatten()[0])
    return counts


@pytest.mark.parametrize("nuisances", NUISANCES, ids=" ".join)
def test_intervals_cover_where_noise_is_cut_off(nuisances):
    assert binom.cdf(FEWEST - 1, SEEDS, math.erf(math.sqrt(2))) < 5e-4
    albedo = torch.tensor([0.7, 0.65], dtype=torch.float64)
    counts = covered(CLIPPED, Lambert(albedo=albedo[0]), Lambert(albedo=albedo[1]), nuisances, SEEDS)
    assert min(counts.values()) >= FEWEST, counts


@pytest.mark.slow
@pytest.mark.parametrize("nuisances", NUISANCES, ids=" ".join)
def test_intervals_of_a_rough_material_cover(nuisances):
    """400 fits: a rate between 92 and 98 %, which chance misses in 3 of 1000 cases a row."""
    albedo, sigma = torch.tensor([0.7, 0.6], dtype=torch.float64)
    model = OrenNayar(albedo=albedo, sigma=sigma)
    counts = covered(CLIPPED, model, model, nuisances, 400)
    assert all(368 <= count <= 392 for count in counts.values()), counts


def test_no_sample_is_left_out_where_nothing_is_cut_off():
    noise = 0.01 * torch.randn(3, 16, 16, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    model = Lambert(albedo=torch.tensor(0.5, dtype=torch.float64))
    photographs = render(CLIPPED, model).detach() * 2 + noise
    below_black, cut_off = (fit(CLIPPED, k, model) for k in (photographs, photographs.clamp(min=0)))
    assert below_black.clipped == 0
    assert cut_off.clipped > 0
    assert below_black.samples == cut_off.samples + cut_off.clipped
