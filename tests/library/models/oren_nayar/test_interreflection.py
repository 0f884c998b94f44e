"""The exchange between the facets in its collapsed form against crossed strings."""

import math

import numpy as np
import pytest
import torch
from helpers.paper_form import crossed_strings
from helpers.planes import f64

from torchbrdf.models.oren_nayar.interreflection import two_bounce_integrand

RNG = np.random.default_rng(5)


def test_collapsed_integrand_equals_strips():
    """X' Y IF / (pi S^2) in the collapsed form against crossed strings, and in float32 on a shallow slope."""
    for light, view, slope in zip(
        RNG.uniform(-3, 9, 300), RNG.uniform(-3, 9, 300), RNG.uniform(0.1, 1.5, 300), strict=True
    ):
        x, y = max(0, 1 + light), max(0, 1 + view)
        hidden = [min(1.0, max(0.0, 1 - 2 / z)) if z > 0 else 1.0 for z in (x, y)]
        factor = crossed_strings(*hidden, slope)
        found = two_bounce_integrand(*f64(light, view), cos_slope=f64(math.cos(slope))[0]).item()
        assert found == pytest.approx(x * y * factor / (math.pi * math.sin(slope) ** 2), rel=1e-11, abs=1e-13)
    single, cosine = torch.tensor([1.5, 4.0]), torch.tensor(0.01).cos()
    slope = math.acos(cosine.item())  # 1 - cos has lost most of its digits in the rounding of the cosine already
    expected = 2.5 * 5 * crossed_strings(1 - 2 / 2.5, 1 - 2 / 5, slope) / (math.pi * math.sin(slope) ** 2)
    assert two_bounce_integrand(*single, cos_slope=cosine).item() == pytest.approx(expected, rel=1e-5)
