"""Mirrors and matte bodies under interfaces: their albedos by integrals."""

import math

import pytest
import torch
from helpers.probes import COS, albedo, doubles, few, held, seeded
from scipy.integrate import quad
from torch.testing import assert_close

from torchbrdf import Coupled, Dampened, Dielectric, Mirror, Schlick
from torchbrdf import testing as laws


@pytest.mark.parametrize("interface", [Schlick(f0=held(0.05)), Schlick(f0=held(0.2)), Dielectric(eta=held(1.5))])
def test_coupled_white_body_reflects_everything(interface):
    brdf = Coupled(albedo=held(1.0), fresnel=interface)
    for c in COS:
        mirror = float(interface(doubles(c)))
        assert albedo(brdf, c) + mirror == pytest.approx(1.0, abs=1e-6)
        assert float(brdf.directional_albedo(doubles(c))) == pytest.approx(1.0, abs=1e-14)


def test_coupled_under_a_full_mirror_is_dark():
    assert (Coupled(albedo=held(1.0), fresnel=Schlick(f0=held(1.0)))(*few()) == 0).all()


def test_mirror_and_dampened():
    assert (Mirror()(*few()) == 0).all()
    assert_close(Mirror(fresnel=Schlick(f0=held(0.3))).directional_albedo(doubles([1.0])), doubles([[0.3]]))
    brdf = Dampened(albedo=held(0.8), fresnel=Dielectric(eta=held(1.5)))
    mean = quad(lambda c: 2 * c * float(brdf.fresnel(doubles(c))), 0, 1)[0]
    for c in COS:  # of uniform light, into one direction
        assert albedo(brdf, c) == pytest.approx(0.8 * (1 - mean), rel=1e-5)


@pytest.mark.parametrize("cos_light", COS)
def test_dampened_returns_what_its_interface_lets_through(cos_light):
    # "For each incident theta", (25.1): light from one direction, summed over all views; above 1 with F of the view.
    brdf = Dampened(albedo=held(1.0), fresnel=Dielectric(eta=held(1.5)))
    light = doubles([math.sqrt(1 - cos_light**2), 0.0, cos_light])

    def leaving(cos_view):
        view = doubles([0.0, math.sqrt(1 - cos_view**2), cos_view])
        return 2 * math.pi * cos_view * float(brdf(doubles([0.0, 0.0, 1.0]), light, view, normalize=True))

    matte = quad(leaving, 0, 1)[0]
    assert matte + float(brdf.fresnel(doubles(cos_light))) == pytest.approx(1.0, abs=1e-9)


def test_mirror_returns_the_reflected_view():
    normal, _, view = laws.random_directions(100, dtype=torch.float64, generator=seeded())
    light, pdf, weight = Mirror(fresnel=Schlick(f0=held(0.3))).sample(normal, view, torch.rand(100, 2).double())
    torch.testing.assert_close(light, 2 * (normal * view).sum(-1, keepdim=True) * normal - view)
    assert pdf.isinf().all()
    cos = (normal * view).sum(-1)
    torch.testing.assert_close(weight[:, 0], 0.3 + 0.7 * (1 - cos) ** 5)
