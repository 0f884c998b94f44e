"""One slope angle: the azimuth mean of direct light against adaptive quadrature."""

import pytest
from helpers.facet_means import CASES, azimuth_mean, facets, plane_and_slope

from torchbrdf.models.oren_nayar.azimuth import (
    direct_mean,
)


@pytest.mark.filterwarnings("ignore:.*roundoff:scipy.integrate.IntegrationWarning")
@pytest.mark.filterwarnings("ignore:.*roundoff.*")
@pytest.mark.parametrize("case", CASES)
def test_direct_mean_is_the_integral(case):
    plane, slope = plane_and_slope(*case)
    assert direct_mean(plane, **slope).item() == pytest.approx(
        azimuth_mean(facets(*case)[0], *case, rtol=1e-13), rel=1e-12, abs=1e-15
    )
