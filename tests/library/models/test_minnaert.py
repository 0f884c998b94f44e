"""Minnaert's albedo in closed form."""

import pytest
from helpers.probes import COS, albedo, few, held
from torch.testing import assert_close

from torchbrdf import Lambert, Minnaert


@pytest.mark.parametrize("k", [0.5, 1.0, 1.7])
def test_minnaert_albedo(k):
    brdf = Minnaert(albedo=held(0.6), k=held(k))
    for c in COS:
        assert albedo(brdf, c, 96) == pytest.approx(0.6 * c ** (k - 1), rel=1e-4)
    if k == 1:
        assert_close(brdf(*few()), Lambert(albedo=held(0.6))(*few()))
