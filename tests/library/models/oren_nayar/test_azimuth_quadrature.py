"""The azimuth mean of the two-bounce light against adaptive quadrature."""

import pytest
from helpers.facet_means import CASES, azimuth_mean, facets, plane_and_slope

from torchbrdf.models.oren_nayar.azimuth import saturated_correlation, saturated_lobes
from torchbrdf.models.oren_nayar.azimuth_quadrature import two_bounce_mean
from torchbrdf.models.oren_nayar.slope_plane import SlopePlane


@pytest.mark.filterwarnings("ignore:.*roundoff.*")
@pytest.mark.parametrize("case", CASES)
def test_two_bounce_mean_is_the_integral(case):
    plane, slope = plane_and_slope(*case)
    plane, slope = SlopePlane(*(field[None] for field in plane)), {name: side[None] for name, side in slope.items()}
    lobes = saturated_lobes(plane, **slope)
    expected = azimuth_mean(facets(*case)[1], *case, rtol=1e-11)
    correlation = saturated_correlation(plane, lobes)
    assert two_bounce_mean(plane, lobes, correlation, order=24, graded=True).item() == pytest.approx(
        expected, rel=1e-9, abs=1e-15
    )
    assert two_bounce_mean(plane, lobes, correlation, order=5).item() == pytest.approx(expected, rel=6e-3, abs=4e-4)
