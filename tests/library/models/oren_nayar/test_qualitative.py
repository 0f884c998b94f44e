"""The qualitative model of Oren and Nayar against the paper's own trigonometry."""

import math

import pytest
from helpers.paper_form import CONFIGURATIONS, SIGMAS, directions_of, qualitative_by_angles
from helpers.probes import doubles, held
from torch.testing import assert_close

from torchbrdf import QualitativeOrenNayar


@pytest.mark.parametrize("constant", [0.33, 0.57])
@pytest.mark.parametrize("sigma", SIGMAS)
def test_qualitative_matches_paper(sigma, constant):
    brdf = QualitativeOrenNayar(albedo=held(0.7), sigma=held(sigma), a_constant=constant)
    expected = doubles([qualitative_by_angles(*c, 0.7, sigma, constant=constant) for c in CONFIGURATIONS])
    assert_close(brdf(*directions_of(CONFIGURATIONS))[:, 0], expected, rtol=1e-12, atol=0)


@pytest.mark.parametrize("constant", [0.0, -0.33, math.nan])
def test_constant_in_a_must_be_positive(constant):
    with pytest.raises(ValueError, match=r"QualitativeOrenNayar.a_constant must be positive \(0.33 or 0.57\)"):
        QualitativeOrenNayar(a_constant=constant)
