"""Lommel-Seeliger, Lambert spheres and Hapke by other forms and by integrals. Golden values are in laws/test_golden."""

import math

import pytest
import torch
from helpers.probes import COS, albedo, doubles, few, held
from numpy.polynomial.legendre import leggauss
from scipy.integrate import quad
from torch.testing import assert_close

from torchbrdf import (
    Cosines,
    Hapke,
    LambertSphere,
    LommelSeeliger,
    fixed,
    lambert_sphere_fast,
)
from torchbrdf.models.planetary import lambert_sphere_phase


def test_lommel_seeliger_albedo():
    brdf = LommelSeeliger(albedo=held(0.7))
    for c in COS:
        assert albedo(brdf, c) == pytest.approx(float(brdf.directional_albedo(doubles(c))), rel=1e-8)


def test_lambert_sphere_phase():
    angle = torch.linspace(0, math.pi, 200, dtype=torch.float64)
    cosines = Cosines.from_products(torch.ones_like(angle), torch.ones_like(angle), -angle.cos())
    expected = 2 * (angle.sin() - angle * angle.cos()) / (3 * math.pi**2)
    assert_close(lambert_sphere_phase(cosines), expected, rtol=1e-12, atol=1e-15)
    mean = quad(
        lambda t: 2 * math.pi * math.sin(t) * 2 * (math.sin(t) - t * math.cos(t)) / (3 * math.pi**2), 0, math.pi
    )
    assert mean[0] == pytest.approx(1.0)
    # forward scattering is all cancellation in the printed form; psi^3/3 is what is left
    small = doubles(1e-3)
    near = Cosines.from_products(doubles(1.0), doubles(1.0), -small.cos())
    assert_close(lambert_sphere_phase(near), 2 / (3 * math.pi**2) * small**3 / 3, rtol=1e-6, atol=0)
    assert albedo(LambertSphere(albedo=held(1.0)), 0.5) < 1


@pytest.mark.parametrize(("rho", "expected"), [(0.5, 0.506), (0.8, 0.829), (1.0, 1.082)])
def test_lambert_sphere_fast_white_sky(rho, expected):
    # uniform cosines by quadrature; the fit gains energy at 1, as the sheet says
    x, w = (torch.from_numpy(a) for a in leggauss(48))
    mu, wm = (1 + x) / 2, w / 2
    phi, wp = math.pi * (1 + x) / 2, math.pi * w / 2
    i, r, p = torch.meshgrid(mu, mu, phi, indexing="ij")
    phase = i * r + ((1 - i * i) * (1 - r * r)).sqrt() * p.cos()
    f = lambert_sphere_fast(Cosines.from_products(i, r, phase), albedo=doubles(rho))[..., 0]
    total = 4 * (f * i * r * wm[:, None, None] * wm[:, None] * wp).sum()
    assert float(total) == pytest.approx(expected, abs=2e-3)


def test_hapke():
    smooth = Hapke(albedo=held(1.0), asymmetry=held(0.0), surge=held(0.0), surge_width=held(0.05))
    assert 0.96 < min(albedo(smooth, c) for c in COS) < max(albedo(smooth, c) for c in (0.02, *COS)) < 1.045
    # the surge at retro is B_0, and half of it at tan(g/2) = h
    surge = Hapke(albedo=held(1e-6), asymmetry=held(0.0), surge=held(0.8), surge_width=held(0.1))
    plain = Hapke(albedo=held(1e-6), asymmetry=held(0.0), surge=held(0.0), surge_width=held(0.1))
    normal = doubles([0.0, 0.0, 1.0])
    g = 2 * math.atan(0.1)
    tilted = doubles([math.sin(g), 0.0, math.cos(g)])
    for view, expected in ((normal, 1.8), (tilted, 1.4)):
        ratio = surge.components(normal, normal, view)["single"] / plain.components(normal, normal, view)["single"]
        assert float(ratio) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_surge_at_retro_reflection_is_all_of_it(dtype):
    # B = B_0 at g = 0 whatever h: twice the light of a surface without a surge, but for the multiple scattering
    normal, light, _ = few(100, 89.99)
    plain, surging = (Hapke(surge=fixed(s), surge_width=fixed(1e-4)).to(dtype) for s in (0.0, 1.0))
    single = [brdf.components(*(v.to(dtype) for v in (normal, light, light)))["single"] for brdf in (plain, surging)]
    assert_close(single[1], 2 * single[0], rtol=1e-6, atol=0)
