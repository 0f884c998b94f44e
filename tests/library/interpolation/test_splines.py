"""Splines in a table: polynomials they must hold, derivatives, and both ways of reading."""

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from torchbrdf.interpolation.splines import SplineTable, interpolate, sites, spline_coefficients

F64 = torch.float64
COUNTS = (9, 7, 6)


def cubic(x, y, z):
    """Two columns of cubics in each coordinate."""
    return torch.stack((1 + x**3 * y * z**2 - 2 * y**3, (x - 0.3) ** 2 * (1 - z) ** 3 + x * y**2), -1)


def table_of(function, counts=COUNTS):
    axes = torch.meshgrid(*(torch.from_numpy(sites(n)) for n in counts), indexing="ij")
    return SplineTable.of(torch.from_numpy(spline_coefficients(function(*axes).numpy(), len(counts))))


def random_points(count, seed=0):
    return tuple(torch.rand(3, count, dtype=F64, generator=torch.Generator().manual_seed(seed)))


def test_cubics_are_exact():
    points = random_points(500)
    ends = tuple(torch.tensor(t, dtype=F64) for t in ([0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0]))
    for at in (points, ends):
        assert_close(interpolate(table_of(cubic), at), cubic(*at), rtol=1e-12, atol=1e-12)


def test_values_at_the_sites_are_met():
    values = np.random.default_rng(1).normal(size=(*COUNTS, 3))
    table = SplineTable.of(torch.from_numpy(spline_coefficients(values, 3)))
    axes = torch.meshgrid(*(torch.from_numpy(sites(n)) for n in COUNTS), indexing="ij")
    assert_close(interpolate(table, axes), torch.from_numpy(values), rtol=1e-10, atol=1e-10)


def test_error_falls_with_the_fourth_power_of_the_spacing():
    def error(count):
        table = table_of(lambda x, y, z: torch.sin(5 * x + 2 * y - z)[..., None], (count, count, count))
        x, y, z = points = random_points(2000)
        return (interpolate(table, points)[:, 0] - torch.sin(5 * x + 2 * y - z)).abs().max()

    assert 10 < error(11) / error(19) < 40  # 8 and 16 cells


def test_derivatives():
    points = tuple(u.requires_grad_() for u in random_points(6))
    table = table_of(lambda *u: torch.sin(3 * u[0] + u[1] * u[2])[..., None].expand(*u[0].shape, 2))
    assert torch.autograd.gradcheck(lambda *u: interpolate(table, u), points)
    assert torch.autograd.gradgradcheck(lambda *u: interpolate(table, u), points)


def test_transforms_agree_with_plain_evaluation():
    table = table_of(cubic)
    points = torch.stack(random_points(7), -1)

    def read(point):
        return interpolate(table, point.unbind(-1))

    assert_close(torch.vmap(read)(points), read(points))
    step = torch.ones_like(points)
    by_differences = (read(points + 1e-6 * step) - read(points - 1e-6 * step)) / 2e-6
    assert_close(torch.func.jvp(read, (points,), (step,))[1], by_differences, rtol=1e-7, atol=1e-8)


def test_a_contracted_table_is_a_table():
    matrix = torch.tensor([[1.0, 0.0, 2.0], [0.5, -1.0, 3.0]], dtype=F64)
    table, points = table_of(cubic), random_points(20)
    assert_close(interpolate(table.times(matrix), points), interpolate(table, points) @ matrix)


def test_many_points_and_any_shape():
    table, points = table_of(cubic), random_points(9000)
    shaped = tuple(u.reshape(3, 3000) for u in points)
    assert_close(interpolate(table, shaped).flatten(0, 1), cubic(*points), rtol=1e-12, atol=1e-12)
    assert interpolate(table, tuple(u[:0] for u in points)).shape == (0, 2)


def test_the_wider_dtype_counts():
    table, points = table_of(cubic), random_points(5)
    narrow = tuple(u.float() for u in points)
    assert interpolate(table, narrow).dtype == F64
    assert interpolate(table.to(narrow[0]), narrow).dtype == torch.float32
    assert_close(interpolate(table.to(narrow[0]), narrow), cubic(*points).float(), rtol=1e-5, atol=1e-5)


def test_too_few_sites():
    with pytest.raises(ValueError, match="at least 6 sites; found 5"):
        sites(5)
