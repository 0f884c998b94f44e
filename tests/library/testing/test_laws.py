"""Each law of `torchbrdf.testing.laws` notices a model that breaks it, and its directions are what they are called."""

import math

import pytest
import torch

from torchbrdf import BRDF
from torchbrdf import testing as laws

TOLERANCE = laws.TOLERANCE


def few(n, dtype=torch.float64):
    return laws.random_directions(n, dtype=dtype, generator=torch.Generator().manual_seed(1))


class Broken(BRDF):
    """Lambert, spoiled by a function of the cosines."""

    def __init__(self, spoil):
        super().__init__()
        self.spoil = spoil
        self.strength = torch.nn.Parameter(torch.tensor(0.3, dtype=torch.float64))

    def evaluate(self, cosines):
        return self.spoil(cosines, self.strength)[..., None]

    def evaluate_components(self, cosines):
        return {"all": self.evaluate(cosines)}


class WrongGradient(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x):
        return x.clone()

    @staticmethod
    def backward(ctx, grad):  # type: ignore[override]
        return 2 * grad


def lit(cosines, value):
    return torch.where(cosines.above_horizon, value, torch.zeros_like(value))


@pytest.mark.parametrize(
    ("law", "spoil", "message"),
    [
        (laws.assert_reciprocal, lambda c, s: s * c.light, "not reciprocal"),
        (laws.assert_nonnegative, lambda c, s: s * (c.phase - 2), "below 0"),
        (laws.assert_nonnegative, lambda c, s: s * c.phase * math.nan, "below 0"),
        (laws.assert_zero_below_horizon, lambda c, s: s + 0 * c.light, "value is not 0"),
        (laws.assert_zero_below_horizon, lambda c, s: (s - s.detach()) + 0 * c.light, "gradient to strength is not 0"),
        (laws.assert_finite, lambda c, s: s * (c.light - c.light).sqrt(), "gradient to normal is not finite"),
        (laws.assert_finite, lambda c, s: s / (c.light - c.light), "value is not finite"),
        (laws.assert_keeps_dtype, lambda c, s: (s * c.light).float(), "value is torch.float32"),
        (laws.assert_broadcasts_like_a_loop, lambda c, s: s * c.light / c.light.numel(), "differs from a loop"),
        (laws.assert_gradients, lambda c, s: WrongGradient.apply(s) * c.light, "derivative is wrong"),
    ],
)
def test_law_notices(law, spoil, message):
    with pytest.raises(AssertionError, match=message):
        law(Broken(spoil), *few(3))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda c, s: lit(c, s / 0.3 * 1.01 / math.pi + 0 * c.light), "reflects 1.01"),
        (lambda c, s: lit(c, s * (c.light > 0.3).to(s)), "not converged"),
    ],
)
def test_energy_law_notices(spoil, message):
    with pytest.raises(AssertionError, match=message):
        laws.assert_energy(Broken(spoil))


def test_float32_law_notices():
    with pytest.raises(AssertionError, match="float32 differs"):
        laws.assert_float32_matches_float64(Broken(lambda c, s: s * (1 - c.phase**2).abs().sqrt().acos()), *few(1000))


def test_hard_directions_are_what_they_are_called():
    for name, (normal, light, view) in laws.hard_directions(torch.float64).items():
        for v in (normal, light, view):
            assert abs(v.norm() - 1) < TOLERANCE[torch.float64].rounding, name
    hard = laws.hard_directions(torch.float64)
    assert torch.equal(hard["retro"].light, hard["retro"].view)
    assert hard["both at 90 deg"].light[2] == hard["both at 90 deg"].view[2] == 0
    assert hard["dphi = 90"].light[1] == hard["dphi = 90"].view[0] == 0
    assert hard["light below"].light[2] < 0 < hard["light below"].view[2]


def test_random_directions_stay_within_the_angle():
    normal, light, view = few(2000)
    for v in (light, view):
        cosine = (normal * v).sum(-1)
        assert math.cos(math.radians(85)) - 1e-12 < cosine.min() < math.cos(math.radians(80))
