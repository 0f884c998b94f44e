"""What every test shares: one row of the catalog at a time, and seeded directions."""

import os
from pathlib import Path

import pytest
import torch
from helpers.catalog import MODELS
from helpers.materials import Model

from torchbrdf.testing import Directions, random_directions

# The workers share the cores; threads of their own would wait for each other.
torch.set_num_threads(1)
# Nothing is written to the user's cache; another run of the same code finds its tables here.
os.environ["TORCHBRDF_CACHE"] = str(Path(__file__).parents[1] / "build" / "tables")


@pytest.fixture(params=MODELS, ids=lambda model: model.name)
def model(request: pytest.FixtureRequest) -> Model:
    return request.param


@pytest.fixture(params=[torch.float32, torch.float64], ids=["float32", "float64"])
def dtype(request: pytest.FixtureRequest) -> torch.dtype:
    return request.param


@pytest.fixture
def directions(dtype: torch.dtype) -> Directions:
    """A thousand random ones up to 85 degrees, the same in every run."""
    return random_directions(1000, dtype=dtype, generator=torch.Generator().manual_seed(0))
