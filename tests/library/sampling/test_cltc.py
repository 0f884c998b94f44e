"""The sampler of rough diffuse models: its density by differences, and the roughness that others give it."""

import math

import pytest
import torch
from helpers.jacobians import density_by_differences, inner_numbers
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import Cosines
from torchbrdf.sampling.cltc import cltc_density, cltc_sample, cltc_uniform_share, equivalent_roughness

NORMAL, TANGENT = torch.eye(3, dtype=torch.float64)[[2, 0]]


@pytest.mark.parametrize("roughness", [0.05, 0.4, 1.0])
@pytest.mark.parametrize(("theta", "phi"), [(0.0, 0.0), (0.7, 2.0), (1.4, -0.5)])
def test_density_is_that_of_the_draws(roughness, theta, phi):
    view = doubles([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])
    r = doubles(roughness)
    share = float(cltc_uniform_share(view[2], r))
    assert 0 < share < 0.5

    def density(light):
        return cltc_density(Cosines.of(NORMAL, light, view, tangent=TANGENT, normalize=True), r)

    u = inner_numbers()
    lobe = torch.stack((share + (1 - share) * u[:, 0], u[:, 1]), -1)
    light = cltc_sample(view, r, lobe)
    above = light[:, 2] > 0.01
    assert above.all() or theta > 1
    drawn = density_by_differences(lambda u: cltc_sample(view, r, u), lobe, step=1e-6)
    # what the uniform draws add comes on top: they reach every direction
    expected = drawn + share / (2 * math.pi)
    assert_close(density(light)[above], expected[above], rtol=1e-5, atol=0)
    even = cltc_sample(view, r, torch.stack((share * u[:, 0], u[:, 1]), -1))
    assert_close(even[:, 2], 1 - u[:, 0])  # a uniform hemisphere: its height is uniform


def test_smooth_surface_is_drawn_from_the_cosine():
    light = cltc_sample(doubles([0.6, 0.0, 0.8]), doubles(0.0), inner_numbers())
    cosines = Cosines.of(NORMAL, light, doubles([0.6, 0.0, 0.8]), tangent=TANGENT)
    assert_close(cltc_density(cosines, doubles(0.0)), light[:, 2] / math.pi)


def test_equivalent_roughness_is_b_over_a():
    # (30) of Oren and Nayar at sigma = 0.5: A = 1 - 0.125/0.58, B = 0.1125/0.34
    assert float(equivalent_roughness(doubles(0.5))) == pytest.approx((0.1125 / 0.34) / (1 - 0.125 / 0.58), rel=1e-14)
    sigma = torch.linspace(0, math.pi / 2, 100, dtype=torch.float64)
    r = equivalent_roughness(sigma)
    assert r[0] == 0
    assert (r.diff() > 0).all()
    assert r[-1] < 0.9
