"""Functions in LLVM's text against long doubles and against torch, over the whole range of their arguments."""

import math

import numpy as np
import pytest
import torch
from helpers.kernels import with_compiler
from torch.testing import assert_close

from torchbrdf.kernels.elementary import REALS
from torchbrdf.kernels.lowering import Stream, lower
from torchbrdf.kernels.machine import compiled
from torchbrdf.kernels.program import Program

pytestmark = with_compiler
OFTEN = [math.inf, -math.inf, math.nan, 0.0, -0.0, 1.0, -1.0]


def computed(operation, x):
    p = Program()
    place = p.append(operation, p.append("input", 0))
    result = torch.empty_like(x)
    compiled(lower(p, [Stream(1)], [[place]], x.dtype), 2)(x.data_ptr(), result.data_ptr(), len(x))
    return result


def in_long_doubles(function, x):
    with np.errstate(all="ignore"):
        return torch.from_numpy(function(x.numpy().astype(np.longdouble)).astype(x.numpy().dtype))


@pytest.mark.parametrize("dtype", REALS)
def test_exponential(dtype):
    end = 104.5 if dtype == torch.float32 else 747.0
    edges = torch.tensor([*OFTEN, 88.7, -87.4, 0.34657, -0.34658, 1e-9], dtype=dtype)
    x = torch.cat((edges, torch.linspace(-end, end, 4001, dtype=dtype)))
    info = torch.finfo(dtype)
    spacing = 4 * info.tiny * info.eps  # of the numbers below the normal ones
    expected = in_long_doubles(np.exp, x)
    assert_close(computed("exp", x), expected, rtol=3 * info.eps, atol=spacing, equal_nan=True)


@pytest.mark.parametrize("dtype", REALS)
def test_logarithm(dtype):
    info = torch.finfo(dtype)
    edges = torch.tensor([*OFTEN, info.tiny, info.tiny / 8, info.max, 0.70710, 0.70711, 1.41421, 1.41422], dtype=dtype)
    near_one = 1 + torch.linspace(-1, 1, 2001, dtype=dtype) ** 5
    low, high = math.log10(info.tiny) + 1, math.log10(info.max) - 1
    x = torch.cat((edges, near_one, torch.logspace(low, high, 2001, dtype=dtype)))
    assert_close(computed("log", x), in_long_doubles(np.log, x), rtol=4 * info.eps, atol=0, equal_nan=True)


@pytest.mark.parametrize("dtype", REALS)
def test_scaled_complementary_error_function(dtype):
    x = torch.cat((torch.linspace(0, 30, 3001, dtype=dtype), torch.logspace(-9, 9, 301, dtype=dtype)))
    expected = torch.special.erfcx(x.double()).to(dtype)
    assert_close(computed("erfcx", x), expected, rtol=24 * torch.finfo(dtype).eps, atol=0)
