"""Many roughnesses at once against the slow reference, one at a time."""

import math

import torch

from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.many_roughnesses import SlopeRule, rough_reflectances
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles

F64 = torch.float64
ANGLES = torch.tensor([[10.0, 62.0, 80.0, 84.0], [5.0, 60.0, 30.0, 83.0], [70.0, 4.0, 175.0, 110.0]], dtype=F64)
SIGMA = torch.deg2rad(torch.tensor([0.0, 3.0, 20.0, 55.0], dtype=F64))
ALBEDO = torch.tensor([0.0, 0.3, 0.9], dtype=F64)


def test_against_the_slow_reference():
    angles = torch.deg2rad(ANGLES)
    got = rough_reflectances(*angles, SIGMA, ALBEDO, rule=SlopeRule()) * math.pi
    plane = slope_plane_from_angles(*(a[:, None] for a in angles))
    fewer = {"panel_order": 8, "order": 16, "higher_slopes": 48, "modes": 12, "chunk": 64}
    for k, rho in enumerate(ALBEDO):
        parts = converged(plane, SIGMA.expand(len(angles[0]), -1), albedo=rho, **fewer)
        higher = parts.higher / rho if rho > 0 else 0 * parts.higher
        error = (got[..., k] - math.pi * (parts.direct + rho * parts.two_bounce + higher)).abs()
        assert error[:, 0].max() < 1e-4  # a Gaussian of 0.05 deg in its place
        assert error.max() < 3e-4, (float(rho), error)
