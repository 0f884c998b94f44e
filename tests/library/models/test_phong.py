"""The normalisations of Phong lobes."""

import pytest
from helpers.probes import COS, albedo, held

from torchbrdf import MaxCosinePhong, ModifiedPhong


@pytest.mark.parametrize("exponent", [1.0, 20.0, 200.0])
def test_phong_normalisations(exponent):
    material = {"diffuse": held(0.0), "specular": held(0.6), "exponent": held(exponent)}
    modified, cosine = ModifiedPhong(**material), MaxCosinePhong(**material)
    assert albedo(modified, 1.0) == pytest.approx(0.6, rel=1e-6)
    for c in COS:
        assert albedo(cosine, c, 96) <= 0.6 + 1e-6
    if exponent == 200:
        assert albedo(modified, 0.3, 96) == pytest.approx(0.6 * 0.3, rel=0.05)  # dark at grazing, as k_s cos
