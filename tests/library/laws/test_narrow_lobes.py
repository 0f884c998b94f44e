"""Narrow lobes keep their digits in float32."""

import copy
import math

import pytest
import torch
from helpers.probes import few

from torchbrdf import Hapke, MaxCosinePhong, ModifiedPhong, fixed


def around(centre, radius, dtype=torch.float32):
    """400 unit vectors within `radius` [rad] of each of the given ones, at all distances down to a hundredth of it."""
    generator = torch.Generator().manual_seed(9)
    across = torch.randn(len(centre), 3, dtype=torch.float64, generator=generator)
    across = torch.nn.functional.normalize(across - (across * centre).sum(-1, keepdim=True) * centre, dim=-1)
    distance = radius * 10 ** (-2 * torch.rand(len(centre), 1, dtype=torch.float64, generator=generator))
    return torch.nn.functional.normalize(centre + distance * across, dim=-1).to(dtype)


@pytest.mark.parametrize("cos_light", [1.0, 0.5, 0.02, math.cos(math.radians(89.99))])
@pytest.mark.parametrize(
    ("brdf", "radius", "mirrored", "rtol"),
    [
        (Hapke(surge=fixed(0.8), surge_width=fixed(1e-4)), 1e-3, False, 2e-3),
        (Hapke(asymmetry=fixed(-0.999), surge=fixed(0.0)), 1e-2, False, 2e-4),
        (ModifiedPhong(diffuse=fixed(0.0), specular=fixed(0.3), exponent=fixed(1e5)), 1e-2, True, 2e-4),
        (MaxCosinePhong(diffuse=fixed(0.0), specular=fixed(0.3), exponent=fixed(1e5)), 1e-2, True, 2e-4),
    ],
    ids=["surge of 1e-4", "backward peak", "modified Phong", "maximum of cosines"],
)
def test_float32_digits_of_narrow_lobes(brdf, radius, mirrored, rtol, cos_light):
    # Of the angle to the lobe's axis a few roundings of a unit vector are unknown, 1e-7 of up to 1e-3 or 1e-2 rad, and
    # the lobe changes by its own size within a hundredth of that. A dot product knows the angle to 3e-4 rad.
    normal = torch.nn.functional.normalize(few(400).normal, dim=-1)
    tangent = torch.nn.functional.normalize(
        few(400).view - (few(400).view * normal).sum(-1, keepdim=True) * normal, dim=-1
    )
    light = cos_light * normal + math.sqrt(1 - cos_light**2) * tangent
    axis = 2 * cos_light * normal - light if mirrored else light
    directions = (normal.float(), light.float(), around(axis, radius))
    exact = copy.deepcopy(brdf).double()(*(torch.nn.functional.normalize(v.double(), dim=-1) for v in directions))
    got = copy.deepcopy(brdf).float()(*directions)
    lit = (exact > 0) & (got > 0)  # at 89.99 deg many of the views lie below the horizon
    error = ((got - exact) / exact)[lit].abs().max()
    assert lit.any()
    assert error < rtol + 2 * torch.finfo(torch.float32).eps / cos_light  # a cosine is known to a rounding of 1
