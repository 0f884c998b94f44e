"""How the parts of the He-Torrance model are drawn."""

import math

import pytest
import torch
from helpers.he_torrance_surfaces import UP, material
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import HeTorrance, fixed
from torchbrdf import testing as laws


def model(sigma0, tau, wavelength, index, **more):
    return HeTorrance(
        **{name: fixed(value) for name, value in material(sigma0, tau, wavelength, index).items()}, **more
    )


@pytest.mark.parametrize(
    ("parameters", "degrees", "variance", "largest"),
    [
        ((0.28, 1.77, 0.5), 0, 0.13, 1.3),
        ((0.28, 1.77, 0.5), 60, 0.35, 1.6),
        ((0.28, 1.77, 0.5), 85, 1.2, 4.0),
        ((0.28, 1.77, 2.0), 60, 0.29, 2.0),
        ((0.02, 1.0, 0.5), 60, 0.04, 2.5),
        ((4.4, 1.0, 0.55), 85, 4.0, 12.0),
    ],
)
def test_sampling_variance(parameters, degrees, variance, largest):
    # variance over squared mean, largest weight over mean
    brdf = model(*parameters, 0.77 + 6.08j)
    with torch.no_grad():
        w = laws.SamplingSetup.of(brdf, math.radians(degrees)).draw(40_000, torch.Generator().manual_seed(0)).weight
    assert w.var() / w.mean() ** 2 < variance
    assert w.max() / w.mean() < largest


def test_mirror_lobe_is_drawn_with_its_reflectance():
    brdf = model(0.02, 1.0, 0.5, 0.77 + 6.08j)
    sample = laws.SamplingSetup.of(brdf, 0.8).draw(2000, torch.Generator().manual_seed(0))
    mirrored = sample.pdf.isinf()
    share = float(mirrored.double().mean())
    assert 0.5 < share < 1
    expected = brdf.specular_reflectivity(doubles(math.cos(0.8)))
    assert_close(
        sample.weight[mirrored].mean() * brdf._shares(doubles([math.cos(0.8)]))[0], expected, rtol=1e-9, atol=0
    )
    assert model(0.02, 1.0, 0.5, 1.5, specular=False).delta_reflectance(brdf.cosines(UP, UP, UP)) is None
