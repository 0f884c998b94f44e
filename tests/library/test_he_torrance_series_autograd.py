"""The D series under autograd, torch.func and torch.compile, in any shape."""

import pytest
import torch
from series_inputs import F64, at, scattered, with_slopes
from torch.testing import assert_close

from torchbrdf.models.he_torrance import series
from torchbrdf.models.he_torrance.series import series_over_g


def test_derivatives_of_the_logarithm():
    # Of order 1 everywhere, unlike the series itself; gradcheck also compares reverse, forward and batched modes.
    g, t = (x.requires_grad_() for x in at([0.2, 5.0, 30.0, 50.0, 100.0, 300.0], [3.0, 0.2, 1.0, 0.01, 0.5, 0.2]))

    def logarithm(g, t):
        return series_over_g(g, t).log()

    torch.autograd.gradcheck(logarithm, (g, t), check_forward_ad=True, check_batched_grad=True, atol=1e-7, rtol=1e-6)
    torch.autograd.gradgradcheck(logarithm, (g, t), check_fwd_over_rev=True, atol=1e-7, rtol=1e-6)


def test_forward_mode_is_reverse_mode(dtype):
    g, t = at([0.2, 5.0, 50.0, 300.0], [3.0, 0.2, 0.01, 0.2], dtype)
    _, by_g, by_t = with_slopes(g, t)
    _, tangent = torch.func.jvp(series_over_g, (g, t), (torch.full_like(g, 2.0), torch.full_like(t, -3.0)))
    assert tangent.dtype == dtype
    assert_close(tangent, 2 * by_g - 3 * by_t, rtol=1e-6, atol=0)
    _, alone = torch.func.jvp(lambda g: series_over_g(g, t), (g,), (torch.ones_like(g),))
    assert_close(alone, by_g, rtol=0, atol=0)


def test_vmap_is_a_batch(dtype):
    g, t = at([0.2, 5.0, 50.0, 300.0], [3.0, 0.2, 0.01, 0.2], dtype)
    table = series_over_g(g[:, None], t)
    nested = torch.vmap(torch.vmap(series_over_g, in_dims=(None, 0)), in_dims=(0, None))(g, t)
    assert_close(nested, table, rtol=0, atol=0)
    assert_close(torch.vmap(torch.func.grad(series_over_g))(g, t), with_slopes(g, t)[1], rtol=0, atol=0)


def test_third_derivative_is_refused():
    x = torch.tensor(0.3, dtype=F64, requires_grad=True)
    value = series_over_g(x, torch.tensor(1.0, dtype=F64))
    for _ in range(2):
        (value,) = torch.autograd.grad(value, x, create_graph=True)
    with pytest.raises(NotImplementedError, match="has 2 derivatives"):
        torch.autograd.grad(value, x)


def test_compiles_into_one_graph(dtype):
    g, t = at([0.2, 5.0, 50.0, 300.0], [3.0, 0.2, 0.01, 0.2], dtype)
    torch.compiler.reset()
    compiled = torch.compile(lambda g, t: 2 * series_over_g(g, t), fullgraph=True, backend="aot_eager")
    g, t = g.requires_grad_(), t.requires_grad_()
    got, expected = compiled(g, t), 2 * series_over_g(g, t)
    assert_close(got, expected, rtol=0, atol=0)
    for a, b in zip(torch.autograd.grad(got.sum(), (g, t)), torch.autograd.grad(expected.sum(), (g, t)), strict=True):
        assert_close(a, b, rtol=0, atol=0)


def test_operator_keeps_its_promises(dtype):
    g, t = at([0.2, 50.0], [3.0, 0.2], dtype)
    torch.library.opcheck(series._captured, (g, t, [0, 0, 1, 0]), test_utils=("test_schema", "test_faketensor"))


def test_shapes_and_pieces(monkeypatch):
    g, t = scattered(1000, F64)
    whole = series_over_g(g.reshape(8, 125).T, t.reshape(8, 125).T)
    monkeypatch.setattr(series, "_AT_A_TIME", 64)
    assert_close(series_over_g(g, t).reshape(8, 125).T, whole, rtol=1e-14, atol=0)
    assert series_over_g(g[0], t[0]).shape == ()
    assert series_over_g(g[:0], t[:0]).shape == (0,)
    assert series_over_g(g[:5, None], t[:3]).shape == (5, 3)


def test_dtype_is_checked():
    one = torch.ones(1)
    with pytest.raises(TypeError, match="float16"):
        series_over_g(one.half(), one.half())
    with pytest.raises(TypeError, match=r"float32 and torch\.float64"):
        series_over_g(one, one.double())
