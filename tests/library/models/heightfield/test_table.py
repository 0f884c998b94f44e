"""Tables of bounces: what they resolve, how long they are kept, and that they hide no derivative."""

import torch
from helpers.heightfields import F64, f64, golden, golden_fields
from torch.testing import assert_close

from torchbrdf import Cosines, GaussianHeightfield, gaussian_heightfield
from torchbrdf.models.heightfield.table import kept_table
from torchbrdf.testing import random_directions


def test_default_table_resolves_the_bounces():
    g, found = golden(), golden_fields(240)
    error = found[:, 1:].sum(-1) - g["sum_above_1_white"]
    assert (error / g["sum_above_1_white"]).abs().max() < 2e-2
    assert (error / (g["f1"] + g["sum_above_1_white"])).abs().max() < 1e-3


def test_tables_are_kept_while_the_parameters_stay():
    directions = random_directions(5, dtype=F64, generator=torch.Generator().manual_seed(8))
    brdf = GaussianHeightfield(albedo=0.5, sigma=0.4321, nodes=160).double()
    kept_table.cache_clear()
    with torch.no_grad():
        first = brdf(*directions)
        brdf(*directions)
        assert kept_table.cache_info()[:2] == (1, 1)  # hits, misses
        brdf.albedo = f64(0.9)
        brdf(*directions)
        assert kept_table.cache_info()[:2] == (2, 1)
        brdf.sigma = f64(0.5)
        assert (brdf(*directions) != first).all()
    assert kept_table.cache_info()[:2] == (2, 2)
    brdf(*directions).sum().backward()  # a table with derivatives is made anew
    brdf(*directions).sum().backward()
    assert kept_table.cache_info()[:2] == (2, 2)


def test_no_derivative_is_lost_to_a_kept_table():
    # by the roughness, of a derivative by the light: the inner transform does not see that the outer one asks
    normal, light, view = random_directions(3, dtype=F64, generator=torch.Generator().manual_seed(9))
    material = {"albedo": f64(0.9), "occlusion": f64(1.0), "nodes": 160, "polar_nodes": 5, "table_orders": 3}

    def by_light(sigma):
        def f(v):
            c = Cosines.of(normal, v, view, normalize=True)
            return gaussian_heightfield(c, sigma=sigma, **material).sum()

        return torch.func.jvp(f, (light,), (torch.ones_like(light),))[1]

    h, sigma = 1e-5, f64(0.6)
    expected = (by_light(sigma + h) - by_light(sigma - h)) / (2 * h)
    assert_close(torch.func.jvp(by_light, (sigma,), (f64(1.0),))[1], expected, rtol=1e-6, atol=1e-9)
    assert_close(torch.func.grad(by_light)(sigma), expected, rtol=1e-6, atol=1e-9)
