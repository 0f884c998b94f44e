"""The converged integral: golden values, and what is left beyond its modes."""

import torch
from helpers.planes import f64, random_plane
from helpers.recorded import recorded

from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles

GOLDEN = recorded("oren_nayar.json")["values"]
F64 = torch.float64


def test_converged_matches_every_golden_value():
    columns = {
        key: torch.tensor([row[key] for row in GOLDEN], dtype=F64)
        for key in ("theta_i", "theta_r", "dphi", "sigma", "d", "i")
    }
    found = converged(
        slope_plane_from_angles(columns["theta_i"], columns["theta_r"], columns["dphi"]), columns["sigma"]
    )
    torch.testing.assert_close(found.direct, columns["d"], rtol=1e-10, atol=0)
    torch.testing.assert_close(found.two_bounce, columns["i"], rtol=1e-8, atol=0)


def test_converged_with_all_bounces_has_converged_in_modes():
    """What is left beyond 16 modes, on few slopes: a few 1e-5 of the whole at the roughest and whitest."""
    plane, albedo = random_plane(12), f64(1.0)[0]
    for sigma, bar in ((f64(0.3)[0], 1e-7), (f64(1.0)[0], 5e-5)):
        settings = {"albedo": albedo, "higher_slopes": 16, "higher_order": 8, "order": 8, "panel_order": 4}
        coarse, fine = (converged(plane, sigma, modes=count, **settings) for count in (16, 20))
        assert ((coarse.higher - fine.higher) / sum(fine)).abs().max() < bar
