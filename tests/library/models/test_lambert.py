"""The perfectly diffuse surface."""

import torch
from helpers.paper_form import PI
from helpers.probes import doubles, held
from torch.testing import assert_close

from torchbrdf import Lambert
from torchbrdf.testing import random_directions


def test_lambert_is_albedo_over_pi():
    directions = random_directions(10, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    assert_close(Lambert(albedo=held([0.5, 1.0]))(*directions), doubles([[0.5 / PI, 1 / PI]]).expand(10, 2))
