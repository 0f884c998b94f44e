"""The laws of sampling notice samplers that break them."""

import math

import pytest
import torch
from helpers.probes import seeded

from torchbrdf import BRDF
from torchbrdf import testing as laws


class Skewed(BRDF):
    """Draws from the cosine but says it is uniform."""

    def evaluate_components(self, cosines):
        return {"all": torch.ones_like(cosines.light)[..., None]}

    def density(self, cosines):
        return torch.full_like(cosines.light, 0.5 / math.pi)


class Leaky(Skewed):
    def density(self, cosines):
        return 0.9 * cosines.light / math.pi


def test_laws_notice():
    with pytest.raises(AssertionError, match="chi-square"):
        laws.assert_samples_follow_pdf(Skewed(), 1.0, generator=seeded())
    with pytest.raises(AssertionError, match=r"integrates to 0\.9 and misses 0"):
        laws.assert_density_integrates(Leaky(), 1.0, generator=seeded())
