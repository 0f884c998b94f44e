"""The laws every BRDF obeys, as functions to run on your own model; each raises AssertionError with what it saw."""

from torchbrdf.testing.laws import (
    TOLERANCE,
    Directions,
    Tolerance,
    assert_broadcasts_like_a_loop,
    assert_energy,
    assert_finite,
    assert_float32_matches_float64,
    assert_gradients,
    assert_keeps_dtype,
    assert_nonnegative,
    assert_reciprocal,
    assert_zero_below_horizon,
    hard_directions,
    magnitude,
    random_directions,
    value_and_gradients,
)
from torchbrdf.testing.quadrature import (
    albedo_by_quadrature,
    panels,
)
from torchbrdf.testing.sampling import (
    AZIMUTH,
    SamplingSetup,
    assert_density_integrates,
    assert_samples_follow_pdf,
    assert_weights,
)

__all__ = [
    "AZIMUTH",
    "TOLERANCE",
    "Directions",
    "SamplingSetup",
    "Tolerance",
    "albedo_by_quadrature",
    "assert_broadcasts_like_a_loop",
    "assert_density_integrates",
    "assert_energy",
    "assert_finite",
    "assert_float32_matches_float64",
    "assert_gradients",
    "assert_keeps_dtype",
    "assert_nonnegative",
    "assert_reciprocal",
    "assert_samples_follow_pdf",
    "assert_weights",
    "assert_zero_below_horizon",
    "hard_directions",
    "magnitude",
    "panels",
    "random_directions",
    "value_and_gradients",
]
