"""The strips of a facet that are lit and seen."""

import pytest
from helpers.planes import f64

from torchbrdf.v_cavity import direct_integrand, geometric_attenuation


def test_attenuation_is_the_smaller_fraction():
    """The nesting that is printed in (38) would give 1 for a facet that is 30 % lit and fully visible."""
    keywords = dict(zip(("cos_light", "cos_view", "cos_facet"), f64(0.1, 0.9, 0.6), strict=True))
    lit = 2 * 0.1 * 0.6 / 0.4
    assert geometric_attenuation(*f64(0.4, 0.8), **keywords).item() == pytest.approx(lit)
    assert geometric_attenuation(*f64(-0.4, 0.8), **keywords).item() == 0
    assert direct_integrand(*f64(3.0, 0.5)).item() == pytest.approx(2 * 1.5)
