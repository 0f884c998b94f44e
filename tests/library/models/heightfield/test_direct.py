"""Direct light of heightfields: golden values, a dense grid, and two rays in one."""

import math

import numpy as np
import pytest
import torch
from helpers.heightfields import F64, UNCORRELATED, cosines, f64, golden, held, rms, rotation, smith_masking, vectors
from torch.testing import assert_close

from torchbrdf import MESHED_HEIGHTFIELD, GaussianHeightfield, gaussian_heightfield, sigma_from_rms_slope
from torchbrdf.models.heightfield.direct import Quadrature, direct_light, slope_frame


@pytest.mark.parametrize(
    ("theta_i", "theta_r", "dphi"), [(0.3, 1.1, 0.7), (1.35, 1.2, 2.5), (1.0, 0.2, 3.1), (1.4, 0.9, 1.6)]
)
@pytest.mark.parametrize("slope", [0.3, 0.9])
def test_smith_by_a_dense_grid(theta_i, theta_r, dphi, slope):
    xi = np.linspace(-7, 7, 4001)
    x, y = xi[:, None], xi[None, :]
    lit = np.maximum(1 + slope * math.tan(theta_i) * x, 0)
    seen = np.maximum(1 + slope * math.tan(theta_r) * (x * math.cos(dphi) + y * math.sin(dphi)), 0)
    mass = np.exp(-(x * x + y * y) / 2) / np.sqrt(1 + slope * slope * (x * x + y * y))
    mean = (mass * lit * seen).sum() * (xi[1] - xi[0]) ** 2 / (2 * math.pi)
    expected = mean / math.pi / (1 + smith_masking(theta_i, slope) + smith_masking(theta_r, slope))
    frame = slope_frame(cosines(theta_i, theta_r, dphi), f64(slope))
    got = direct_light(frame, f64(0.0), UNCORRELATED, Quadrature(40, 30, 6.5))
    assert got.item() == pytest.approx(expected, rel=1e-5)


# Figures measured here, for a slope integral whose first axis is split where facets turn away: (largest, rms) error.
@pytest.mark.parametrize(
    ("nodes", "largest", "typical"), [(160, 7e-4, 1.1e-4), (240, 8e-5, 2e-5), (384, 4e-5, 5e-6), (560, 9e-6, 1e-6)]
)
def test_direct_light_is_golden(nodes, largest, typical):
    g = golden()
    sigma = sigma_from_rms_slope(g["s"])
    f = gaussian_heightfield(
        cosines(g["theta_i"], g["theta_r"], g["dphi"]),
        albedo=f64(1.0),
        sigma=sigma,
        occlusion=g["occlusion"],
        bounces=1,
        nodes=nodes,
        constants=MESHED_HEIGHTFIELD,
    )[..., 0]
    error = f / g["f1"] - 1
    assert error.abs().max() < largest
    assert rms(error) < typical


def test_two_rays_in_one_are_masked_once():
    # retro: f is largest there, a cone whose subgradient is 0, and float32 keeps the digits around it
    brdf = GaussianHeightfield(albedo=held(1.0), sigma=held(0.7), bounces=1)
    generator = torch.Generator().manual_seed(7)
    turn = rotation(generator)
    aside = 10.0 ** torch.linspace(-6, -1, 30, dtype=F64)
    normal, light, view = vectors(1.1, 1.1, aside, turn)
    f = brdf(normal, light, view, normalize=True)[:, 0]
    assert (f.diff() < 0).all()
    slopes = (f[1:] - f[0]) / aside[1:]
    assert_close(slopes[10:15], slopes[14].expand(5), rtol=0.1, atol=0)  # linear: a cone
    single = brdf.float()(*(v.float() for v in (normal, light, view)), normalize=True)[:, 0]
    exact = brdf.double()(*(v.float().double() for v in (normal, light, view)), normalize=True)[:, 0]
    assert ((single.double() / exact - 1).abs() < 4e-6).all()
