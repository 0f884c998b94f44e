"""Gauss-Legendre rules on (0, 1): exact for what they must be exact for, and constants wherever they are used."""

import pytest
import torch
from helpers.probes import doubles

from torchbrdf.quadrature import gauss_legendre, gauss_legendre_rule


@pytest.mark.parametrize("order", [1, 2, 5, 16])
def test_exact_up_to_the_degree_of_gauss_and_no_further(order):
    x, weight = gauss_legendre(order, doubles(0.0))
    assert x.shape == weight.shape == (order,)
    assert (x > 0).all()
    assert (x < 1).all()
    for degree in range(2 * order):
        assert float((weight * x**degree).sum()) == pytest.approx(1 / (degree + 1), rel=1e-14)
    if order < 10:  # beyond, the first error is below rounding
        assert float((weight * x ** (2 * order)).sum()) != pytest.approx(1 / (2 * order + 1), rel=1e-12)


def test_dtype_is_that_of_the_tensor_it_stands_beside():
    nodes, weights = gauss_legendre_rule(7)
    x, weight = gauss_legendre(7, torch.zeros((), dtype=torch.float32))
    assert x.dtype == weight.dtype == torch.float32
    assert torch.equal(x, torch.tensor(nodes))
    assert torch.equal(weight, torch.tensor(weights))


def test_rule_is_a_constant_of_a_compiled_graph():
    def integral(a):
        x, weight = gauss_legendre(12, a)
        return (weight * (a * x).exp()).sum()

    torch.compiler.reset()
    a = doubles(1.5)
    got = torch.compile(integral, fullgraph=True, backend="eager")(a)
    torch.testing.assert_close(got, a.expm1() / a, rtol=1e-14, atol=0)
