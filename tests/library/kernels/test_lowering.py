"""Loops in LLVM's text, compiled and run on arrays: arithmetic, the exponential, streams."""

import math

import pytest
import torch
from helpers.kernels import with_compiler
from torch.testing import assert_close

from torchbrdf.kernels.lowering import ARITHMETIC, Stream, lower
from torchbrdf.kernels.machine import compiled
from torchbrdf.kernels.program import Program

pytestmark = with_compiler
REALS = [torch.float32, torch.float64]


def run(program, inputs, outputs, arrays, *, pixels, truth=None):
    dtype = arrays[0].dtype
    results = [torch.full((pixels, len(places)), torch.nan, dtype=dtype) for places in outputs]
    loop = compiled(lower(program, inputs, outputs, dtype, truth=truth), len(inputs) + len(outputs))
    lapses = loop(*(t.data_ptr() for t in (*arrays, *results)), pixels)
    return results, lapses


@pytest.mark.parametrize("dtype", REALS)
def test_every_operation(dtype):
    p = Program()
    x, y = p.append("input", 0), p.append("input", 1)
    less, not_less = p.append("lt", x, y), p.append("not", p.append("lt", x, y))
    made = {
        "add": p.add(x, y),
        "subtract": p.subtract(x, y),
        "multiply": p.multiply(x, y),
        "reciprocal": p.reciprocal(y),
        "negate": p.negate(x),
        "abs": p.append("abs", x),
        "sqrt": p.append("sqrt", p.append("abs", x)),
        "exp": p.append("exp", x),
        "log": p.append("log", p.append("abs", x)),
        "erfcx": p.append("erfcx", p.append("abs", x)),
        "select": p.select(less, x, y),
        "not": p.select(not_less, x, y),
        "and": p.select(p.append("and", less, p.append("gt", x, p.constant(0.0))), x, y),
        "or": p.select(p.append("or", less, p.append("eq", x, x)), x, y),
        **{name: p.select(p.append(name, x, y), x, p.constant(7.0)) for name in ("lt", "le", "gt", "ge", "eq", "ne")},
    }
    assert made.keys() == ARITHMETIC
    g = torch.Generator().manual_seed(0)
    pairs = torch.randn(100, 2, generator=g, dtype=dtype)
    pairs[:10, 1] = pairs[:10, 0]
    (got,), _ = run(p, [Stream(2)], [list(made.values())], [pairs], pixels=100)
    a, b = pairs.unbind(-1)
    seven = torch.full_like(a, 7.0)
    expected = [a + b, a - b, a * b, 1 / b, -a, a.abs(), a.abs().sqrt(), a.exp(), a.abs().log()]
    expected += [torch.special.erfcx(a.abs())]
    expected += [torch.minimum(a, b), torch.where(a < b, b, a), torch.where((a < b) & (a > 0), a, b), a]
    expected += [torch.where(k(a, b), a, seven) for k in (torch.lt, torch.le, torch.gt, torch.ge, torch.eq, torch.ne)]
    eps = torch.finfo(dtype).eps
    assert_close(got, torch.stack(expected, -1), rtol=24 * eps, atol=eps)


def test_constants_keep_their_last_digit():
    p = Program()
    x = p.append("input", 0)
    values = [1 / 3, -math.pi, 1e-30, 0.1, -0.0, math.inf]
    places = [p.select(p.append("gt", x, p.constant(0.0)), p.constant(v), x) for v in values]
    for dtype in REALS:
        (got,), _ = run(p, [Stream(1)], [places], [torch.ones(3, dtype=dtype)], pixels=3)
        assert torch.equal(got, torch.tensor(values, dtype=dtype).expand(3, -1))


def test_streams_repeat_or_advance_and_lapses_are_counted():
    p = Program()
    x = [p.append("input", k) for k in range(5)]  # two a pixel, then three for all
    total, large = p.total(x), p.append("lt", x[0], p.constant(10.0))
    pixels = 37
    pairs, three = torch.arange(2.0 * pixels).reshape(pixels, 2), torch.tensor([100.0, 200.0, 300.0])
    outputs = [[total], [x[4], x[0]]]
    results, lapses = run(p, [Stream(2), Stream(3, True)], outputs, [pairs, three], pixels=pixels, truth=large)
    assert torch.equal(results[0][:, 0], pairs.sum(-1) + 600)
    assert torch.equal(results[1], torch.stack((torch.full((pixels,), 300.0), pairs[:, 0]), -1))
    assert lapses == (pairs[:, 0] >= 10).sum()


def test_not_a_number_stays_one():
    p = Program()
    x = p.append("input", 0)
    places = [p.add(x, p.constant(1.0)), p.append("sqrt", x), p.append("exp", x), p.multiply(p.constant(0.0), x)]
    (got,), _ = run(p, [Stream(1)], [places], [torch.full((20,), torch.nan)], pixels=20)
    assert got.isnan().all()
