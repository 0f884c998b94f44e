"""The operator of torch: value, derivatives of every order, vmap, fake tensors, what is off."""

import pytest
import torch
from helpers.kernels import frames, made, with_compiler
from torch.testing import assert_close

from torchbrdf import native
from torchbrdf.kernels.forms import form_for
from torchbrdf.kernels.operator import reflectance

pytestmark = with_compiler
OPERATOR = torch.ops.torchbrdf.reflectance.default


def given(name="functional", pixels=7):
    model = made(name, pixels)
    form = form_for(model)
    assert form is not None
    arrays = [t.detach().requires_grad_() for t in (*frames(pixels), *model.parameters())]
    return form, arrays


def evaluate(form, *arrays, checked=True):
    return reflectance(form.place, arrays, checked=checked)


def by_formula(form, *arrays):
    return form.formula(*arrays[:3], arrays[3:])


def test_first_and_second_derivatives():
    form, arrays = given()
    # unchecked: finite differences leave the sphere
    assert torch.autograd.gradcheck(lambda *x: evaluate(form, *x, checked=False), arrays)
    first = torch.autograd.grad(evaluate(form, *arrays).square().sum(), arrays, create_graph=True)
    second = torch.autograd.grad(sum(slope.square().sum() for slope in first), arrays)
    expected = torch.autograd.grad(by_formula(form, *arrays).square().sum(), arrays, create_graph=True)
    twice = torch.autograd.grad(sum(slope.square().sum() for slope in expected), arrays)
    for got, wanted in zip((*first, *second), (*expected, *twice), strict=True):
        assert_close(got, wanted, rtol=1e-9, atol=1e-9)


def test_torch_finds_nothing_wrong_with_it():
    form, arrays = given("fujii")
    arguments = (form.place, arrays, True)
    checks = ("test_schema", "test_autograd_registration", "test_faketensor")
    assert set(torch.library.opcheck(OPERATOR, arguments, test_utils=checks).values()) == {"SUCCESS"}


def test_mapped_it_is_the_formula():
    form, arrays = given()
    arrays = [t.detach() for t in arrays]
    normal, light, view, albedo, sigma = arrays

    def one(x, s):
        return evaluate(form, normal, x, view, albedo, s)

    got = torch.vmap(one, (0, None))(torch.stack((light, view)), sigma)
    expected = torch.stack([by_formula(form, normal, x, view, albedo, sigma) for x in (light, view)])
    assert_close(got, expected, rtol=1e-12, atol=1e-14)


def test_without_numbers_it_has_the_shape():
    form, arrays = given()
    real = [t.detach() for t in arrays]
    with torch._subclasses.FakeTensorMode() as mode:
        fakes = [mode.from_tensor(t) for t in real]
        assert evaluate(form, *fakes).shape == (7, 3)


def test_vectors_are_looked_at_if_asked_for():
    form, arrays = given()
    arrays = [t.detach() for t in arrays]
    arrays[1] = 1.1 * arrays[1]
    with pytest.raises(ValueError, match="light must hold finite unit vectors; 7 of 7"):
        evaluate(form, *arrays)
    assert_close(evaluate(form, *arrays, checked=False), by_formula(form, *arrays), rtol=1e-11, atol=1e-13)


def test_a_second_use_of_one_value_and_part_of_the_inputs():
    model = made("eon", 30)
    vectors = frames(30)
    wanted = []
    for smallest in (1, float("inf")):
        model.zero_grad()
        with native(smallest):
            value = model(*vectors)
            (value * value.detach()).sum().backward(retain_graph=True)
            value.sum().backward()
        wanted.append([p.grad.clone() for p in model.parameters()])
    for mine, expected in zip(*wanted, strict=True):
        assert_close(mine, expected, rtol=1e-10, atol=1e-12)
