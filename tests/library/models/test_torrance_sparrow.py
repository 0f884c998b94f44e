"""Torrance and Sparrow: energy, normalisation, with and without a body."""

import math

import pytest
import torch
from helpers.probes import COS, albedo, doubles, few, held
from scipy.integrate import quad
from torch.testing import assert_close

from torchbrdf import Cosines, OrenNayar, TorranceSparrow, torrance_sparrow, trainable


@pytest.mark.parametrize("sigma", [0.3, 1.0])
def test_torrance_sparrow_conserves(sigma):
    brdf = TorranceSparrow(sigma=held(sigma))
    assert max(albedo(brdf, c, 128) for c in (0.02, *COS)) <= 1 + 1e-4


def test_torrance_sparrow_without_its_constant():
    brdf, plain = (TorranceSparrow(sigma=held(0.4), normalised=n) for n in (True, False))
    ratio = plain(*few()) / brdf(*few())
    norm = 2 * math.pi * quad(lambda t: math.exp(-t * t / 0.32) * math.sin(t), 0, math.pi / 2, epsabs=1e-14)[0]
    assert_close(ratio, torch.full_like(ratio, 4 * norm), rtol=1e-10, atol=0)


def test_torrance_sparrow_function():
    cosines = Cosines.of(*few())
    assert_close(torrance_sparrow(cosines, sigma=doubles(0.4)), TorranceSparrow(sigma=held(0.4))(*few()))
    with pytest.raises(ValueError, match=r"torrance_sparrow: sigma must lie in"):
        torrance_sparrow(cosines, sigma=doubles(2.0))


@pytest.mark.parametrize(("degrees", "rho", "k_s"), [(20, 0.8, 0.019), (42, 0.75, 0.085), (26, 0.7, 0.043)])
def test_body_and_surface(degrees, rho, k_s):
    # samples D, E, F of Oren & Nayar: k_b body + k_s surface, (32)
    sigma = held(math.radians(degrees))
    body, surface = OrenNayar(albedo=held(rho), sigma=sigma), TorranceSparrow(sigma=sigma, normalised=False)
    mixture = (1.0 * body + k_s * surface).double()
    assert_close(mixture(*few()), body(*few()) + k_s * surface(*few()), rtol=1e-6, atol=0)
    assert set(mixture.components(*few())) == {
        "OrenNayar.direct",
        "OrenNayar.interreflection",
        "TorranceSparrow.specular",
    }
    assert list(trainable(mixture)) == ["weights"]
