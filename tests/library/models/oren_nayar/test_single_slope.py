"""Cavities of one slope: their limit of no slope, and real grooves, traced."""

import math

import pytest
from helpers.planes import UP, f64, unit

from torchbrdf import UnidirectionalVCavities, fixed


def test_flat_grooves_are_lambert():
    grooves = UnidirectionalVCavities(albedo=f64(0.6)[0], slope=fixed(f64(0.0)[0]), bounces="all")
    found = grooves(UP, unit(1.0, 0.2), unit(0.5, 2.0), tangent=unit(1.5, 1.0))
    assert found.item() == pytest.approx(0.6 / math.pi, rel=1e-15)
