"""A white rough surface returns everything it receives, whatever the direction. Slow: a hemisphere full of kinks."""

import math

import pytest
import torch

from torchbrdf import RoughSurface, fixed
from torchbrdf.testing import laws

DOUBLE = torch.float64


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sigma", "degrees", "tolerance"),
    [
        (0.3, 0, 1e-6),
        (0.3, 60, 1e-6),
        (0.3, 85, 2e-6),  # the cubature itself: 8e-6 with half the nodes
        (0.9, 60, 3e-4),  # 1.6e-4 measured; likely slopes near 90 degrees, which want more modes than keep digits
    ],
)
def test_isotropic_white_surface_reflects_everything(sigma, degrees, tolerance):
    one, rough = (fixed(torch.tensor(k, dtype=DOUBLE)) for k in (1.0, sigma))
    model = RoughSurface(albedo=one, sigma=rough, nodes=12, order=8, graded=True, bounces="all", modes=12)
    reflected = laws.albedo_by_quadrature(model, math.radians(degrees), 48)
    assert abs(reflected.item() - 1) < tolerance
