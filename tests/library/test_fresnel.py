"""Fresnel reflectances against complex arithmetic, and averages against quadrature."""

import cmath
import math

import pytest
import torch
from helpers.he_torrance_surfaces import GOLDEN, close
from helpers.probes import doubles
from scipy.integrate import quad
from torch.testing import assert_close

from torchbrdf import (
    Conductor,
    Dielectric,
    Schlick,
    conductor,
    conductor_amplitudes,
    dielectric,
    dielectric_average,
    f0_from_index,
    schlick,
)

COSINES = [1e-6, 0.01, 0.2, 0.5, 0.745, 0.9, 1.0]


def textbook(c, index):
    """Amplitudes of s and p light by Snell's law, complex."""
    s2 = 1 - c * c
    t = cmath.sqrt(1 - s2 / index**2)
    r_s = (c - index * t) / (c + index * t)
    r_p = (index * c - t) / (index * c + t)
    return 0.5 * (abs(r_s) ** 2 + abs(r_p) ** 2)


@pytest.mark.parametrize("eta", [1.0001, 1.33, 1.5, 2.5, 1 / 1.5])
def test_dielectric(eta):
    got = dielectric(doubles(COSINES), eta=doubles(eta))
    # the textbook form itself loses digits at eta near 1
    assert_close(got, doubles([textbook(c, eta) for c in COSINES]), rtol=1e-10 if eta < 1.01 else 1e-13, atol=1e-19)
    assert_close(conductor(doubles(COSINES), eta=doubles(eta), k=doubles(0.0)), got, rtol=1e-10, atol=1e-19)


@pytest.mark.parametrize(("eta", "k"), [(0.2, 3.5), (1.5, 1e-3), (2.9, 3.1), (1.0, 0.5)])
def test_conductor(eta, k):
    got = conductor(doubles(COSINES), eta=doubles(eta), k=doubles(k))
    assert_close(got, doubles([textbook(c, complex(eta, k)) for c in COSINES]), rtol=1e-12, atol=0)


def test_total_reflection_is_total():
    eta = doubles(1 / 1.5).requires_grad_()
    cos = doubles([0.1, 0.5, 0.7]).requires_grad_()
    f = dielectric(cos, eta=eta)
    assert (f == 1).all()
    assert all((g == 0).all() for g in torch.autograd.grad(f.sum(), (cos, eta)))


def test_weak_interfaces_keep_their_digits_in_float32():
    cos, eta = torch.rand(1000, generator=torch.Generator().manual_seed(0)) + 1e-3, torch.tensor(1.0009765625)
    exact = dielectric(cos.double(), eta=eta.double())
    # the p amplitude crosses 0 at Brewster's angle, the s amplitude does not
    assert_close(dielectric(cos, eta=eta).double(), exact, rtol=5e-6, atol=0)


@pytest.mark.parametrize("eta", [1.1, 1.33, 1.5, 2.5, 10.0])
def test_average_of_dielectric(eta):
    expected = 2 * quad(lambda c: c * textbook(c, eta), 0, 1, epsabs=1e-13, limit=200)[0]
    assert_close(dielectric_average(eta=doubles(eta)), doubles(expected), rtol=1e-10, atol=0)
    in_float32 = dielectric_average(eta=torch.tensor(eta))
    assert in_float32.dtype == torch.float32
    assert_close(in_float32.double(), doubles(expected), rtol=1e-5, atol=0)


def test_average_at_the_end_of_its_domain():
    assert float(dielectric_average(eta=doubles(1.0))) == 0
    with pytest.raises(ValueError, match=r"eta must lie in \[1, inf\)"):
        dielectric_average(eta=doubles(0.9))


@pytest.mark.parametrize(
    ("interface", "form"),
    [
        (Schlick(f0=doubles(0.05)), lambda c: 0.05 + 0.95 * (1 - c) ** 5),
        (Dielectric(eta=doubles(1.5)), lambda c: textbook(c, 1.5)),
        (Conductor(eta=doubles(0.2), k=doubles(3.5)), lambda c: textbook(c, complex(0.2, 3.5))),
    ],
)
def test_modules(interface, form):
    assert_close(interface(doubles(COSINES))[:, 0], doubles([form(c) for c in COSINES]), rtol=1e-12, atol=0)
    expected = 2 * quad(lambda c: c * form(c), 0, 1, epsabs=1e-13)[0]
    assert_close(interface.average()[0], doubles(expected), rtol=1e-8, atol=0)


def test_schlick_is_within_what_it_says_of_glass():
    cos = torch.linspace(0.001, 1, 1000, dtype=torch.float64)
    error = schlick(cos, f0=f0_from_index(doubles(1.5))) - dielectric(cos, eta=doubles(1.5))
    assert 0.02 < error.abs().max() < 0.05


def test_gradients():
    cos = doubles([0.05, 0.4, 0.9]).requires_grad_()
    eta, k = doubles(1.4).requires_grad_(), doubles(2.0).requires_grad_()
    for f, inputs in (
        (lambda c, n: dielectric(c, eta=n), (cos, eta)),
        (lambda c, n, kk: conductor(c, eta=n, k=kk), (cos, eta, k)),
        (lambda n: dielectric_average(eta=n), (eta,)),
    ):
        assert torch.autograd.gradcheck(f, inputs)
        assert torch.autograd.gradgradcheck(f, inputs)
    # normal incidence and the dielectric limit, where roots of 0 hide
    edge = doubles([1.0, 1.0]).requires_grad_()
    nothing = doubles(0.0).requires_grad_()
    (slope, of_k) = torch.autograd.grad(conductor(edge, eta=doubles(1.5), k=nothing).sum(), (edge, nothing))
    assert slope.isfinite().all()
    assert math.isfinite(of_k)


@pytest.mark.parametrize("case", GOLDEN["fresnel"])
def test_fresnel(case):
    cos, eta, k = (doubles([x]) for x in (case["cos"], *case["n"]))
    close(conductor(cos, eta=eta, k=k), case["F2"], 1e-12)
    for got, expected in zip(conductor_amplitudes(cos, eta=eta, k=k), (case["rs"], case["rp"]), strict=True):
        assert abs(complex(got) - complex(*map(float, expected))) < 1e-15


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_an_index_of_zero_reflects_all(dtype):
    """Straight on, too, where the ratio of p to s light is 0/0: the limit of small indices."""
    cos = torch.tensor(COSINES, dtype=dtype)
    nothing = torch.zeros((), dtype=dtype)
    assert_close(conductor(cos, eta=nothing, k=nothing), torch.ones_like(cos), rtol=0, atol=2e-7)
    for amplitude in conductor_amplitudes(cos, eta=nothing, k=nothing):
        assert_close(amplitude.abs(), torch.ones_like(cos), rtol=0, atol=2e-7)
    eta = torch.tensor(1e-4, dtype=dtype, requires_grad=True)
    value = conductor(cos, eta=eta, k=nothing)
    assert_close(value.detach(), torch.ones_like(cos), rtol=0, atol=5e-4)
    assert torch.autograd.grad(value.sum(), eta)[0].isfinite()
