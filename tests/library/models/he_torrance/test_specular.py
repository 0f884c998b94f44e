"""The averaged specular part: the overlap of two cones, and what follows from it."""

import math

import pytest
import torch
from helpers.he_torrance_surfaces import GOLDEN, UP, material
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import Cosines, HeTorrance, fixed
from torchbrdf.models.he_torrance.specular import averaged_specular, cone_overlap


def model(sigma0, tau, wavelength, index, **more):
    return HeTorrance(
        **{name: fixed(value) for name, value in material(sigma0, tau, wavelength, index).items()}, **more
    )


@pytest.mark.parametrize("case", GOLDEN["cap_overlap"])
def test_cone_overlap_reference_values(case):
    solid_angle = 4 * math.pi * math.sin(case["alpha"] / 2) ** 2
    got = cone_overlap(doubles([math.sin(case["gamma"] / 2) ** 2]), solid_angle)
    assert_close(got, doubles([float(case["fraction"])]), rtol=1e-11, atol=0)
    single = cone_overlap(doubles([math.sin(case["gamma"] / 2) ** 2]).float(), solid_angle)
    assert_close(single.double(), got, rtol=1e-3, atol=3e-7)


def test_cone_overlap_by_counting():
    alpha, gamma, n = 0.6, 0.5, 200_000
    generator = torch.Generator().manual_seed(0)
    flat = (1 - math.cos(alpha)) * torch.rand(n, dtype=torch.float64, generator=generator)
    turn = 2 * math.pi * torch.rand(n, dtype=torch.float64, generator=generator)
    along = (flat * (2 - flat)).sqrt() * turn.cos() * math.sin(gamma) + (1 - flat) * math.cos(gamma)
    counted = (along > math.cos(alpha)).double().mean()
    got = cone_overlap(doubles([math.sin(gamma / 2) ** 2]), 4 * math.pi * math.sin(alpha / 2) ** 2)
    assert abs(float(got) - float(counted)) < 5 * math.sqrt(0.25 / n)


def test_slope_of_the_cone_overlap():
    # a cone that moves loses the strip between two arcs: -2 s sqrt(1 - cos^2(arc))
    alpha = 0.0312
    solid_angle = 4 * math.pi * math.sin(alpha / 2) ** 2
    gamma = torch.linspace(0.001, 2 * alpha * (1 - 1e-9), 400, dtype=torch.float64).requires_grad_()
    (slope,) = torch.autograd.grad(cone_overlap((gamma / 2).sin() ** 2, solid_angle).sum(), gamma)
    arc = (gamma.detach() / 2).tan() / math.tan(alpha)
    assert_close(slope, -2 * math.sin(alpha) * (1 - arc**2).sqrt() / solid_angle, rtol=0, atol=1e-6)
    ends = doubles([0.0, math.sin(alpha) ** 2, 0.5]).requires_grad_()
    (slope,) = torch.autograd.grad(cone_overlap(ends, solid_angle).sum(), ends)
    assert slope.isfinite().all()


def test_specular_part_at_the_mirror_direction_and_in_all():
    # rho_s/(cos dw) at its top; all of it together is rho_s, but for the width of the cone
    solid_angle = math.pi / 1024
    brdf = model(0.28, 1.77, 2.0, 2.15 + 20.7j, solid_angle=solid_angle, directional_diffuse=False)
    for theta in (0.2, 0.8, 1.3):
        light, view = (doubles([x * math.sin(theta), 0.0, math.cos(theta)]) for x in (1, -1))
        rho_s = brdf.specular_reflectivity(light[2])
        assert_close(brdf(UP, light, view), rho_s / (math.cos(theta) * solid_angle), rtol=1e-12, atol=0)
        assert_close(brdf.directional_albedo(light[2]), rho_s, rtol=5e-3, atol=0)


def test_derivatives_of_the_specular_part_and_of_the_albedo():
    surface = {name: value.requires_grad_() for name, value in material(0.05, 0.7, 0.5, 0.77 + 6.08j).items()}
    theta = doubles([0.5, 0.9])
    offset = doubles([0.1, 0.3])
    light = torch.stack((theta.sin(), 0 * theta, theta.cos()), -1).requires_grad_()
    view = torch.stack((-(theta + offset).sin(), 0.1 + 0 * theta, (theta + offset).cos()), -1).requires_grad_()
    up = doubles([0.0, 0.0, 1.0])

    def averaged(light, view, *values):
        cosines = Cosines.of(up, light, view, normalize=True)
        return averaged_specular(cosines, solid_angle=0.5, **dict(zip(surface, values, strict=True)))

    assert torch.autograd.gradcheck(averaged, (light, view, *surface.values()), check_forward_ad=True)
    model = HeTorrance(**{name: value.detach() for name, value in surface.items()}, diffuse=doubles([0.02]))
    names = [name for name, _ in model.named_parameters()]

    def albedo(cos, *values):
        named = dict(zip(names, values, strict=True))
        return torch.func.functional_call(Albedo(model), {f"brdf.{name}": v for name, v in named.items()}, (cos,))

    inputs = (doubles([0.3, 0.8]).requires_grad_(), *(p.detach().requires_grad_() for p in model.parameters()))
    assert torch.autograd.gradcheck(albedo, inputs, eps=1e-5, atol=1e-6)


class Albedo(torch.nn.Module):
    def __init__(self, brdf):
        super().__init__()
        self.brdf = brdf

    def forward(self, cos):
        return self.brdf.directional_albedo(cos, nodes=12)
