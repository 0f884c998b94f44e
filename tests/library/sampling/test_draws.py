"""Draws in a local frame: their densities by differences, and the turns and mirrors they are made of."""

import math

import pytest
import torch
from helpers.jacobians import density_by_differences, inner_numbers
from helpers.probes import doubles, few, seeded
from torch.testing import assert_close

from torchbrdf import Cosines
from torchbrdf.sampling.draws import (
    along_view,
    choose,
    cosine_hemisphere,
    local_light,
    local_view,
    mirrored,
    power_cosine,
    towards,
    uniform_disc,
    uniform_hemisphere,
)


@pytest.mark.parametrize(
    ("sampler", "density"),
    [
        (uniform_hemisphere, lambda cos: torch.full_like(cos, 1 / (2 * math.pi))),
        (cosine_hemisphere, lambda cos: cos / math.pi),
        (lambda u: power_cosine(u, doubles(7.0)), lambda cos: 8 / (2 * math.pi) * cos**7),
    ],
    ids=["uniform", "cosine", "power"],
)
def test_density_is_what_the_docstring_says(sampler, density):
    u = inner_numbers()
    light = sampler(u)
    assert_close(light.norm(dim=-1), torch.ones(200, dtype=torch.float64))
    assert (light[:, 2] > 0).all()
    assert_close(density_by_differences(sampler, u), density(light[:, 2]), rtol=1e-5, atol=0)


def test_disc_is_filled_evenly():
    x, y = uniform_disc(torch.rand(100_000, 2, dtype=torch.float64, generator=seeded()))
    assert (torch.hypot(x, y) < 1).all()
    # the disc of half the radius holds a quarter, as does a quadrant; 5 standard errors
    error = 5 * math.sqrt(0.25 * 0.75 / 100_000)
    assert abs(float((torch.hypot(x, y) < 0.5).double().mean()) - 0.25) < error
    assert abs(float(((x > 0) & (y < 0)).double().mean()) - 0.25) < error


def test_choice_uses_its_number_up():
    u = (torch.arange(1000, dtype=torch.float64) + 0.5) / 1000
    first, again = choose(u, doubles(0.3))
    assert first.sum() == 300
    for share in (again[first], again[~first]):  # each evenly spread over [0, 1) once more
        count = len(share)
        assert_close(share, (torch.arange(count, dtype=torch.float64) + 0.5) / count)
    assert not choose(u, doubles(0.0))[0].any()
    assert choose(u, doubles(1.0))[0].all()


def test_turns_keep_lengths_and_angles():
    axis, first, second = few()
    axis = torch.cat((axis, -axis, doubles([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])))
    first, second = (torch.cat((v, v, v[:2])) for v in (first, second))
    up = doubles([0.0, 0.0, 1.0]).expand_as(axis)
    assert_close(towards(axis, up), axis)
    turned = [towards(axis, v) for v in (first, second)]
    assert_close((turned[0] * turned[1]).sum(-1), (first * second).sum(-1))
    matrix = torch.stack([towards(axis, v.expand_as(axis)) for v in torch.eye(3, dtype=torch.float64)], -1)
    assert_close(torch.linalg.det(matrix), torch.ones(len(axis), dtype=torch.float64))  # a turn and no mirror


def test_frame_of_the_view_and_back():
    view, vector, _ = few()
    there = along_view(view, view)
    assert (there[:, 0] >= 0).all()
    assert_close(there[:, 1], torch.zeros(200, dtype=torch.float64))
    assert_close(along_view(along_view(vector, view), view, back=True), vector)
    up = doubles([0.0, 0.0, 1.0])
    assert torch.equal(along_view(vector, up.expand_as(vector)), vector)


def test_mirror_is_half_a_turn_about_its_axis():
    vector, axis, _ = few()
    image = mirrored(vector, axis)
    assert_close(mirrored(image, axis), vector)
    assert_close(torch.nn.functional.normalize(vector + image, dim=-1).abs(), axis.abs())


def test_local_directions_are_their_products_with_the_frame():
    normal, light, view = few()
    tangent = torch.nn.functional.normalize(torch.linalg.cross(normal, light), dim=-1)
    frame = torch.stack((tangent, torch.linalg.cross(normal, tangent), normal), -2)
    cosines = Cosines.of(normal, light, view, tangent=tangent)
    assert_close(local_light(cosines), (frame @ light[..., None])[..., 0], rtol=1e-7, atol=1e-14)
    assert_close(local_view(cosines), (frame @ view[..., None])[..., 0], rtol=1e-7, atol=1e-14)
