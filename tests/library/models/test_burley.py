"""Burley's gain of energy, and that its renormalised form has none."""

import pytest
from helpers.probes import albedo, doubles, few, held
from torch.testing import assert_close

from torchbrdf import Burley, Cosines, burley


def test_burley_gains_and_frostbite_does_not():
    material = {"albedo": held(1.0), "roughness": held(1.0)}
    assert albedo(Burley(**material), 0.05) == pytest.approx(1.46, abs=0.01)
    frostbite = [albedo(Burley(**material, renormalised=True), c) for c in (0.05, 0.3, 0.6, 1.0)]
    assert 0.68 < min(frostbite) < max(frostbite) < 0.98
    # within two degrees of grazing it does, a little
    assert albedo(Burley(**material, renormalised=True), 0.001) == pytest.approx(1.030, abs=1e-3)
    cosines = Cosines.of(*few())
    assert_close(burley(cosines, albedo=doubles(1.0), roughness=doubles(1.0)), Burley(**material)(*few()))
