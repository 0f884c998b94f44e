"""The strips of a facet that are lit and seen."""

import pytest
from helpers.planes import f64

from torchbrdf.v_cavity import direct_integrand, mirror_attenuation


def test_attenuation_is_the_smaller_fraction():
    """The nesting that is printed in (38) would give 1 for a facet that is 30 % lit and fully visible."""
    facet, lower, normal = f64(0.4, 0.1, 0.6)
    assert mirror_attenuation(facet, cos_alpha=lower, cos_facet=normal).item() == pytest.approx(2 * 0.1 * 0.6 / 0.4)
    assert mirror_attenuation(facet, cos_alpha=f64(0.4)[0], cos_facet=normal).item() == 1
    assert direct_integrand(*f64(3.0, 0.5)).item() == pytest.approx(2 * 1.5)
