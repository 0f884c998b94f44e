"""Masking and shadowing in heightfields: projected area, Smith's limit, two rays."""

import math

import numpy as np
import pytest
import torch
from helpers.heightfields import F64, f64, smith_masking
from torch.testing import assert_close

from torchbrdf import (
    MESHED_HEIGHTFIELD,
    SMOOTH_HEIGHTFIELD,
)
from torchbrdf.models.heightfield.visibility import facet_masking, independence, joint_masking, ray

# s_1 and s_2: sin^2 of 22.5 and 67.5 degrees
CRAIG = (math.sin(math.pi / 8) ** 2, math.cos(math.pi / 8) ** 2)


def erfcx(x):
    return math.exp(x * x) * math.erfc(x) if x < 5 else torch.special.erfcx(f64(x)).item()


def gauss(low, high, panels=200):
    """Nodes and weights of 16-point panels on [low, high]."""
    x, w = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(low, high, panels + 1)
    width = np.diff(edges)[:, None]
    return f64((edges[:-1, None] + width * (1 + x) / 2).ravel()), f64((width / 2 * w).ravel())


@pytest.mark.parametrize("constants", [MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD])
@pytest.mark.parametrize("occlusion", [0.0, 0.4, 1.0, 1.2, 1.6, 1.8])
def test_projected_area_is_exact_in_each_direction(occlusion, constants):
    # the facets that are seen fill the area the ray sees: E[X+/(1 + L)] = 1
    for t in (0.03, 0.1, 0.4, 1.0, 3.0, 10.0, 60.0):
        along = ray(f64(t), f64(occlusion), constants)
        xi, weight = gauss(max(-1 / t, -10.0), 10.0)
        towards = 1 + t * xi
        density = torch.exp(-xi * xi / 2) / math.sqrt(2 * math.pi)
        seen = towards / (1 + facet_masking(towards / t, along))
        assert (seen * density * weight).sum().item() == pytest.approx(1, abs=1e-9)


def test_masking_is_never_negative():
    t = torch.cat((torch.zeros(1), 10 ** torch.linspace(-3, 6, 400))).to(F64)
    for constants in (MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD):
        for occlusion in (0.0, 0.5, 1.0, 1.2, 1.6, 1.8):
            along = ray(t, f64(occlusion), constants)
            assert (along.masking >= 0).all()
            assert (along.occlusion <= occlusion + 1e-12).all()
            assert (facet_masking(torch.linspace(0, 9, 401).to(F64), along) >= 0).all()


def test_occlusion_is_free_up_to_one_smooth_scale():
    # what levels it off beyond leaves Lambda of the plain form where that is positive
    for constants in (MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD):
        for nu in (0.1, 0.7, 1.5, 2.5):
            t, g = 1 / nu, 4 / 3 * nu - constants.level + constants.grazing / nu
            mills = [math.sqrt(math.pi / 2) * erfcx(q / math.sqrt(2)) for q in (nu, *(g / k - nu for k in CRAIG))]
            near = sum(1 - (g / k - nu) * m for k, m in zip(CRAIG, mills[1:], strict=True))
            plain = math.exp(-nu * nu / 2) / math.sqrt(2 * math.pi) * (t - mills[0] - t / 4 * near)
            assert ray(f64(t), f64(1.0), constants).masking.item() == pytest.approx(plain, rel=2e-6)


@pytest.mark.parametrize("theta", [0.3, 1.0, 1.45])
def test_without_occlusion_the_masking_is_smiths(theta):
    for slope in (0.2, 0.9):
        got = ray(f64(slope * math.tan(theta)), f64(0.0), SMOOTH_HEIGHTFIELD).masking
        assert got.item() == pytest.approx(smith_masking(theta, slope), rel=1e-9, abs=1e-15)


def test_two_rays_in_one_mask_once_and_apart_like_smith():
    first, second = f64([0.3, 2.0, 0.0]), f64([0.5, 0.1, 0.0])
    assert_close(joint_masking(first, second, f64(1.0)), first + second, rtol=1e-14, atol=1e-15)
    assert_close(joint_masking(first, second, f64(0.0)), torch.maximum(first, second), rtol=1e-14, atol=1e-15)
    matrix = torch.tensor([[0.3, 0.6 * math.sqrt(0.15)], [0.6 * math.sqrt(0.15), 0.5]], dtype=F64)
    largest = torch.linalg.eigvalsh(matrix)[-1]
    assert_close(joint_masking(f64(0.3), f64(0.5), f64(0.6)), largest, rtol=1e-14, atol=0)
    steep, flat = (ray(f64(t), f64(1.0), SMOOTH_HEIGHTFIELD) for t in (3.0, 0.5))
    assert independence(steep, flat, f64(0.0), SMOOTH_HEIGHTFIELD) == 0
    apart = [independence(steep, flat, f64(h), SMOOTH_HEIGHTFIELD).item() for h in (0.1, 0.5, 1.0)]
    assert apart == sorted(apart)
    assert apart[-1] < 1
