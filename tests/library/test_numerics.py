"""The guarded primitives: values, gradients, accuracy."""

import math

import mpmath
import pytest
import torch
from torch.testing import assert_close

from torchbrdf._numerics import (
    FEW,
    PIECE,
    angle_over_sine,
    components,
    cross_of,
    dot,
    holds,
    in_pieces,
    number,
    polynomial,
    quotients,
    root,
    safe_divide,
    safe_sqrt,
    sine,
)


def value_and_gradient(function, *inputs):
    inputs = [torch.as_tensor(x, dtype=torch.float64).requires_grad_() for x in inputs]
    value = function(*inputs)
    return value.detach(), torch.autograd.grad(value.sum(), inputs)


def test_safe_sqrt():
    value, (gradient,) = value_and_gradient(safe_sqrt, [-1.0, -1e-300, 0.0, 1e-300, 4.0])
    assert_close(value, torch.tensor([0.0, 0.0, 0.0, 1e-150, 2.0], dtype=torch.float64), rtol=1e-15, atol=0)
    assert_close(gradient, torch.tensor([0.0, 0.0, 0.0, 5e149, 0.25], dtype=torch.float64), rtol=1e-15, atol=0)
    assert torch.autograd.gradgradcheck(safe_sqrt, torch.tensor([0.3, 2.0], dtype=torch.float64, requires_grad=True))


def test_root_is_safe_sqrt_but_for_denormal_numbers(dtype):
    x = torch.tensor([-1.0, 0.0, 1e-30, 0.3, 2.0], dtype=dtype, requires_grad=True)
    by_root, by_sqrt = (torch.autograd.grad(f(x).sum(), x)[0] for f in (root, safe_sqrt))
    assert torch.equal(root(x), safe_sqrt(x))
    assert torch.equal(by_root, by_sqrt)
    assert torch.equal(root(torch.tensor(torch.finfo(dtype).tiny / 2, dtype=dtype)), torch.zeros((), dtype=dtype))
    assert torch.autograd.gradgradcheck(root, torch.tensor([0.3, 2.0], dtype=torch.float64, requires_grad=True))
    assert root(torch.tensor(math.nan, dtype=dtype)).isnan()


def test_sine_keeps_its_digits_and_is_flat_at_normal_incidence(dtype):
    c = torch.tensor([1 + torch.finfo(dtype).eps, 1.0, 1 - 1e-6, 0.6, 0.0], dtype=dtype, requires_grad=True)
    exact = [0.0, 0.0, *((1 - float(k)) * (1 + float(k)) for k in c[2:].tolist())]
    assert_close(sine(c).double(), torch.tensor(exact, dtype=torch.float64).sqrt(), rtol=4e-7, atol=0)
    (slope,) = torch.autograd.grad(sine(c).sum(), c)
    assert slope[:2].tolist() == [0, 0]
    assert_close(slope[3].item(), -0.75, rtol=1e-6, atol=0)


def test_cross_is_zero_of_a_vector_and_itself():
    a, b = torch.randn(2, 50, 3, generator=torch.Generator().manual_seed(0)).unbind()
    assert all((part == 0).all() for part in cross_of(components(a), components(a)))
    assert_close(torch.stack(cross_of(components(a), components(b)), -1), torch.linalg.cross(a, b))


@pytest.mark.parametrize("shape", [(), (5,), (FEW + 1,)])
def test_quotients_and_polynomials_of_few_and_of_many(shape):
    x = torch.rand(shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) + 0.1
    for (a, b, c), got in zip(rows := ((1.0, 2.0, 3.0), (0.5, 0.0, 0.1)), quotients(x, rows), strict=True):
        assert_close(got, (a * x + b) / (x + c), rtol=1e-15, atol=0)
    assert_close(polynomial((2.0, -3.0, 0.5), x), 2 * x**2 - 3 * x + 0.5, rtol=0, atol=1e-15)


def test_numbers_made_in_inference_mode_enter_derivatives():
    x = torch.tensor(0.3, requires_grad=True)
    with torch.inference_mode():
        number(0.7310, x)
    (number(0.7310, x) * x).backward()
    assert x.grad == number(0.7310, x)


def test_pieces_are_the_whole():
    """Of more pixels than two pieces, an image that no piece divides; alone in what is shared by all pixels."""
    g = torch.Generator().manual_seed(0)
    image, one = torch.randn(3, PIECE - 7, 3, generator=g), torch.randn(3, generator=g)
    sizes = []

    def products(a, b):
        sizes.append(a.shape[:-1].numel())
        return dot(a, b), dot(b, b)

    mixed, alone = in_pieces(products, image, one, own=1)
    assert max(sizes) == PIECE
    assert torch.equal(mixed, dot(image, one))
    assert torch.equal(alone, dot(one, one))
    sizes.clear()
    in_pieces(products, image.clone().requires_grad_(), one, own=1)
    assert sizes == [3 * (PIECE - 7)]  # as a whole: the graph keeps each step anyway


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
