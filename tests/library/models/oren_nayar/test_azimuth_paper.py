"""The closed forms of the paper against the exact means, where they are exact."""

import math

import numpy as np
import pytest
import torch
from helpers.facet_means import plane_and_slope

from torchbrdf.models.oren_nayar.azimuth import direct_mean, two_bounce_mean_approximate
from torchbrdf.models.oren_nayar.azimuth_paper import direct_mean_paper, two_bounce_mean_paper

RNG = np.random.default_rng(5)


@pytest.mark.parametrize("delta", [0.0, 0.5 * math.pi, math.pi])
def test_paper_forms_are_exact_in_and_across_the_plane(delta):
    for theta_i, theta_r, slope_angle in RNG.uniform(0.02, 1.5, (200, 3)):
        plane, slope = plane_and_slope(theta_i, theta_r, delta, slope_angle)
        torch.testing.assert_close(
            direct_mean_paper(plane, **slope), direct_mean(plane, **slope), rtol=1e-12, atol=1e-13
        )
        torch.testing.assert_close(
            two_bounce_mean_paper(plane, **slope), two_bounce_mean_approximate(plane, **slope), rtol=1e-12, atol=1e-13
        )
