"""The guarded primitives: values, gradients, accuracy."""

import math

import mpmath
import pytest
import torch
from torch.testing import assert_close

from torchbrdf._numerics import angle_over_sine, dot, holds, safe_divide, safe_sqrt


def value_and_gradient(function, *inputs):
    inputs = [torch.as_tensor(x, dtype=torch.float64).requires_grad_() for x in inputs]
    value = function(*inputs)
    return value.detach(), torch.autograd.grad(value.sum(), inputs)


def test_safe_sqrt():
    value, (gradient,) = value_and_gradient(safe_sqrt, [-1.0, -1e-300, 0.0, 1e-300, 4.0])
    assert_close(value, torch.tensor([0.0, 0.0, 0.0, 1e-150, 2.0], dtype=torch.float64), rtol=1e-15, atol=0)
    assert_close(gradient, torch.tensor([0.0, 0.0, 0.0, 5e149, 0.25], dtype=torch.float64), rtol=1e-15, atol=0)
    assert torch.autograd.gradgradcheck(safe_sqrt, torch.tensor([0.3, 2.0], dtype=torch.float64, requires_grad=True))


def test_safe_divide():
    where = torch.tensor([True, False, False, True])
    value, (top, bottom) = value_and_gradient(
        lambda a, b: safe_divide(a, b, where=where), [1.0, 0.0, 5.0, 3.0], [4.0, 0.0, 0.0, -2.0]
    )
    assert value.tolist() == [0.25, 0.0, 0.0, -1.5]
    assert top.tolist() == [0.25, 0.0, 0.0, -0.5]
    assert bottom.tolist() == [-0.0625, 0.0, 0.0, -0.75]


def test_dot():
    a, b = torch.randn(2, 7, 5, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)).unbind(0)
    assert_close(dot(a, b), torch.einsum("...i,...i", a, b), rtol=0, atol=1e-15)
    assert dot(a[:, :1], b[:1]).shape == (7, 5)


@pytest.mark.parametrize(("dtype", "rtol"), [(torch.float64, 5e-15), (torch.float32, 2e-7)])
def test_angle_over_sine(dtype, rtol):
    # Measured over 24,000 cosines: 4.0e-15 and 1.2e-7, truncation and the rounding of Horner's steps together.
    cosine = torch.cat([torch.linspace(0, 1, 301), 1 - torch.logspace(-7, -2, 40), torch.logspace(-7, -2, 40)]).to(
        dtype
    )
    with mpmath.workdps(40):

        def ratio(c):
            c = mpmath.mpf(c)
            return float(mpmath.acos(c) / mpmath.sqrt(1 - c * c)) if c < 1 else 1.0

        expected = torch.tensor([ratio(c) for c in cosine.tolist()], dtype=torch.float64)
    assert_close(angle_over_sine(cosine).double(), expected, rtol=rtol, atol=0)


def test_angle_over_sine_is_smooth_at_normal_incidence():
    # d/dc [acos(c)/sqrt(1-c^2)] at c = 1 is -1/3, at c = 0 it is -1. A truncated
    # series loses some digits in its derivative.
    _, (slope,) = value_and_gradient(angle_over_sine, [1.0, 0.0])
    assert_close(slope, torch.tensor([-1 / 3, -1.0], dtype=torch.float64), rtol=1e-10, atol=0)


def test_holds_reads_numbers_and_trusts_what_has_none():
    assert holds(torch.tensor([True, True]))
    assert not holds(torch.tensor([True, False]))
    assert holds(torch.ones(0, dtype=torch.bool))

    def inside(x):
        assert holds(x < math.inf)
        assert holds(x < -math.inf)  # no numbers to read
        return x

    torch.vmap(inside)(torch.ones(3))
