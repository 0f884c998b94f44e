"""The expansion of the D series for large g: its coefficients in exact fractions."""

import math
from fractions import Fraction

import pytest
import torch
from helpers.recorded import recorded
from helpers.series_inputs import F64
from torch.testing import assert_close

from torchbrdf.models.he_torrance.expansion import coefficients

DATA = recorded("he_torrance_series.json")


def test_coefficients_of_the_expansion():
    found = coefficients(len(DATA["expansion"]))
    for k, row in enumerate(DATA["expansion"], 1):
        exact = torch.tensor([float(Fraction(c)) for c in reversed(row)], dtype=F64)
        # Integration leaves rounding of the largest coefficients in the constant; 70^-6 of it matters.
        assert_close(torch.from_numpy(found[k].coef), exact, rtol=0, atol=1e-14 * exact.abs().max().item())
        assert found[k](1.0) == pytest.approx(math.factorial(k), rel=1e-8)
