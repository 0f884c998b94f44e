"""The effective roughness and the Lambert W function in it."""

import math

import pytest
import torch
from helpers.he_torrance_printed import z0
from helpers.he_torrance_surfaces import GOLDEN, close
from helpers.probes import doubles
from helpers.series_inputs import F64
from torch.testing import assert_close

from torchbrdf.models.he_torrance.roughness import effective_roughness, lambert_w


@pytest.mark.parametrize("case", GOLDEN["z0"])
def test_effective_roughness(case):
    k_sum = doubles([case["K"]]).requires_grad_()
    ratio = effective_roughness(k_sum)
    close(case["sigma0"] * ratio.detach(), case["sigma"], 1e-15)
    (slope,) = torch.autograd.grad(case["sigma0"] * ratio, k_sum)
    close(slope, case["dsigma_dK"], 1e-13)
    # z0 itself from (sigma0/sigma)^2 - 1, where that has digits
    root = z0(case["K"], case["sigma0"])
    close(root, case["z0"], 1e-13)
    if case["K"] > 0.1:
        close(case["sigma0"] * (1 / ratio.detach() ** 2 - 1).sqrt(), root, 1e-12)


def test_lambert_w_and_its_derivatives():
    x = torch.cat((doubles([0.0]), torch.logspace(-12, 30, 300, dtype=torch.float64))).requires_grad_()
    w = lambert_w(x)
    assert_close(w * w.exp(), x, rtol=1e-13, atol=0)
    (first,) = torch.autograd.grad(w.sum(), x, create_graph=True)
    (second,) = torch.autograd.grad(first.sum(), x)
    assert_close(first, 1 / (w.exp() * (1 + w)), rtol=1e-13, atol=0)
    assert_close(second, -(w + 2) / ((w.exp() ** 2) * (1 + w) ** 3), rtol=1e-12, atol=0)
    single = x.detach().clamp(max=1e30).float().requires_grad_()
    w = lambert_w(single)
    assert_close(w.double(), lambert_w(single.double()), rtol=3e-7, atol=0)
    assert_close(torch.autograd.grad(w.sum(), single)[0], (1 / (w.exp() * (1 + w))).detach(), rtol=1e-5, atol=0)
    value, tangent = torch.func.jvp(lambert_w, (x.detach(),), (torch.ones_like(x),))
    assert_close(tangent, first, rtol=1e-13, atol=0)
    assert_close(value, lambert_w(x))


def test_lambert_w(dtype):
    w = torch.logspace(-12, math.log10(60), 200, dtype=F64)
    x = (w * w.exp()).to(dtype)
    eps = torch.finfo(dtype).eps
    # x is rounded, and its relative error divided by 1 + w is that of w.
    assert_close(lambert_w(x), w.to(dtype), rtol=8 * eps, atol=0)
    assert lambert_w(torch.zeros(1, dtype=dtype)) == 0
