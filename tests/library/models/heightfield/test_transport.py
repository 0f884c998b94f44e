"""Bounces between the facets of heightfields: golden values, energy, reciprocity."""

import math

import pytest
from helpers.heightfields import UNCORRELATED, f64, golden, golden_fields
from torch.testing import assert_close

from torchbrdf import SMOOTH_HEIGHTFIELD, rms_slope_from_sigma
from torchbrdf.models.heightfield.direct import QUADRATURES, Quadrature
from torchbrdf.models.heightfield.transport import bounce_modes, direct_albedo, polar_nodes, smith_modes


@pytest.mark.parametrize("slope", [0.1, 0.67, 1.2])
def test_unbalanced_bounces_keep_all_light(slope):
    # Smith's surface of white facets, f_1 by the slope integral and the others by invariance
    nodes = polar_nodes(20, f64(slope))
    modes = smith_modes(f64(slope), nodes, 150)[:, 0].sum(0)
    once = direct_albedo(f64(slope), f64(0.0), UNCORRELATED, Quadrature(20, 14, 5.5), nodes)
    total = once + (modes * (nodes.solid_angle * nodes.cos)).sum(-1)
    assert (total - 1).abs().max() < 1e-4


@pytest.mark.parametrize(("sigma", "orders", "bar"), [(10, 14, 2e-5), (40, 14, 2e-5), (60, 24, 1e-3)])
def test_balanced_bounces_return_all_light(sigma, orders, bar):
    slope = rms_slope_from_sigma(f64(math.radians(sigma)))
    nodes = polar_nodes(14, slope)
    for occlusion in (0.0, 1.0, 1.6):
        settings = (slope, f64(occlusion), SMOOTH_HEIGHTFIELD, QUADRATURES[240])
        modes = bounce_modes(*settings, polar=14, orders=orders)[:, 0].sum(0)
        total = direct_albedo(*settings, nodes) + (modes * (nodes.solid_angle * nodes.cos)).sum(-1)
        assert (total - 1).abs().max() < bar


def test_bounces_are_reciprocal():
    modes = bounce_modes(f64(0.5), f64(1.0), SMOOTH_HEIGHTFIELD, QUADRATURES[160], polar=6, orders=4)
    assert_close(modes, modes.mT, rtol=1e-12, atol=1e-15)


def test_bounces_are_golden():
    # the same nodes and bounces; both sides balance against a quadrature of direct light, the golden one less exact
    g, found = golden(), golden_fields(240, polar_nodes=24)
    visible = g["s"] > 0.05  # below, f3 and f4 are some 1e-8 of f
    for order, name in ((1, "f2"), (2, "f3"), (3, "f4")):
        assert (found[visible, order] / g[name][visible] - 1).abs().max() < 6e-4
    assert (found[:, 1:].sum(-1) / g["sum_above_1_white"] - 1).abs().max() < 6e-4
