"""The low-rank split, on a model that has two images by construction."""

import math

import pytest
import torch
from helpers.coarse_tables import COARSE_ROUGH
from torch.testing import assert_close

from torchbrdf import Cosines, TableGrid
from torchbrdf.interpolation.geometry import geometry_coordinates
from torchbrdf.interpolation.images import image_table
from torchbrdf.interpolation.materials import albedo_coordinate, roughness_coordinate
from torchbrdf.interpolation.splines import interpolate
from torchbrdf.testing import random_directions

GRID = TableGrid(depth=14, apart=12, slant=10, sigmas=8, albedos=6, images=2)


def excess(cos_i, cos_r, in_plane, sigma, rho):
    """f_r/rho less Lambert of two smooth images."""
    s2 = sigma**2
    return s2 * cos_i * cos_r + rho * s2 * in_plane**2 / (1 + s2)


def sample(light, view, dphi, sigma, albedo):
    in_plane = light.sin() * view.sin() * dphi.cos()
    geometry = (t[:, None, None] for t in (light.cos(), view.cos(), in_plane))
    return 1 / math.pi + excess(*geometry, sigma[:, None], albedo)


def read(table, cosines, sigma, rho):
    at = geometry_coordinates(cosines)
    shares = interpolate(table.material, (roughness_coordinate(sigma), albedo_coordinate(rho)))
    return (interpolate(table.geometry, at[:3]) * shares).sum(-1) / at.mean_cosine


@pytest.fixture
def table(tmp_path, monkeypatch):
    monkeypatch.setenv("TORCHBRDF_CACHE", str(tmp_path))
    return image_table("two-images", "", [], sample, GRID)


def test_two_images_are_found(table):
    cosines = Cosines.of(*random_directions(500, dtype=torch.float64, generator=torch.Generator().manual_seed(0)))
    for degrees, rho in ((3.0, 0.2), (25.0, 0.9), (70.0, 0.55)):
        sigma, albedo = torch.tensor(math.radians(degrees), dtype=torch.float64), torch.tensor(rho, dtype=torch.float64)
        expected = excess(cosines.light, cosines.view, cosines.in_plane, sigma, albedo)
        assert_close(read(table, cosines, sigma, albedo), expected, rtol=0, atol=1e-2)  # of 0.002 to 1


def test_without_roughness_nothing_is_left(table):
    cosines = Cosines.of(*random_directions(50, dtype=torch.float64))
    zero = torch.zeros((), dtype=torch.float64)
    assert read(table, cosines, zero, zero + 0.7).abs().max() < 1e-15


def test_the_second_time_it_is_read(table, tmp_path):
    def refuse(*_):
        raise AssertionError("sampled again")

    again = image_table("two-images", "", [], refuse, GRID)
    for a, b in zip(table, again, strict=True):
        assert torch.equal(a.rows, b.rows)
    assert len(list(tmp_path.iterdir())) == 1


def test_building_leaves_the_number_of_threads_alone(table):
    assert torch.get_num_threads() == 1  # as conftest set it


@pytest.mark.parametrize("change", [{"depth": 5}, {"albedos": 3}, {"images": 0}, {"images": 26}])
def test_grids_that_are_no_grids(change):
    COARSE_ROUGH.check("Model")
    with pytest.raises(ValueError, match="Model: grid needs at least 6 sites along each axis and 1 to 25 images"):
        COARSE_ROUGH._replace(**change).check("Model")
