"""Cavities of one slope: means of their facets, and their limit of no slope. Traced ones: test_real_grooves."""

import math

import pytest
from helpers.facet_means import CASES, azimuth_mean, facets
from helpers.planes import UP, f64, unit

from torchbrdf import ClosedFormVCavities, SingleSlopeVCavities, UnidirectionalVCavities, fixed


def test_flat_grooves_are_lambert():
    grooves = UnidirectionalVCavities(albedo=f64(0.6)[0], slope=fixed(f64(0.0)[0]), bounces="all")
    found = grooves(UP, unit(1.0, 0.2), unit(0.5, 2.0), tangent=unit(1.5, 1.0))
    assert found.item() == pytest.approx(0.6 / math.pi, rel=1e-15)


@pytest.mark.filterwarnings("ignore:.*roundoff.*")
@pytest.mark.parametrize("case", CASES[::3])
def test_components_are_means_over_the_azimuth_of_facets(case):
    theta_i, theta_r, delta, slope = case
    rho = 0.6
    material = {"albedo": fixed(f64(rho)[0]), "slope": fixed(f64(slope)[0])}
    parts = SingleSlopeVCavities(**material).components(UP, unit(theta_i, 0.3), unit(theta_r, 0.3 + delta))
    direct, two = (azimuth_mean(f, *case, rtol=1e-11) for f in facets(*case))
    assert parts["direct"].item() == pytest.approx(rho * direct, rel=1e-9, abs=1e-13)
    assert parts["two_bounce"].item() == pytest.approx(rho**2 * two, rel=1e-6, abs=1e-9)


@pytest.mark.filterwarnings("ignore:.*roundoff.*")
@pytest.mark.parametrize("delta", [0.0, 0.5 * math.pi, math.pi])
def test_closed_form_is_exact_in_and_across_the_plane(delta):
    case = (0.9, 0.6, delta, 0.8)
    surface = ClosedFormVCavities(albedo=fixed(f64(0.6)[0]), slope=fixed(f64(0.8)[0]))
    direct, _ = facets(*case)
    got = surface.components(UP, unit(0.9, 1.0), unit(0.6, 1.0 + delta))["direct"].item()
    assert got == pytest.approx(0.6 * azimuth_mean(direct, *case, rtol=1e-12), rel=1e-10)
