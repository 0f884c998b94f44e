"""Recording torch: programs evaluated step by step against torch itself, value and derivatives."""

import pytest
import torch
from helpers.kernels import EVALUATED
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf.kernels.recording import Recorder, RecordingError


def evaluated(program, places, inputs):
    """Results of some steps at given inputs."""
    values = []
    for operation, arguments in program.steps:
        if operation in {"constant", "input"}:
            values.append(doubles(arguments[0] if operation == "constant" else inputs[arguments[0]]))
        else:
            x = [values[int(k)] for k in arguments]
            values.append(EVALUATED[operation](x, x)[0])
    return torch.stack([values[place].double() for place in places])


def recorded(function, *sizes):
    """Program of a function's sum and of its derivatives, and where they are."""
    recorder = Recorder(torch.float64)
    given = [recorder.input(torch.full(size, 0.37, dtype=torch.float64)).requires_grad_() for size in sizes]
    with recorder:
        value = function(*given)
        slopes = torch.autograd.grad(value.sum(), given, allow_unused=True, materialize_grads=True)
    return recorder.program, recorder.places_of(value), [p for s in slopes for p in recorder.places_of(s)]


def squeezed(x):
    y = x.clone()
    return y.unsqueeze(-1).mul_(2.0).squeeze(-1)


FUNCTIONS = {
    "arithmetic": lambda x, y: x[0] * y - x[1] / (1 + y * y) + (2 - x[2]) * 0.5 - (-y),
    "roots": lambda x, y: (x * x + 1).sqrt() * torch.rsqrt(y * y + 2) + 1 / (y * y + 1).reciprocal(),
    "powers": lambda x, y: x**2 - y**3 + x.square() * y,
    "exponentials": lambda x, y: (x * y).exp() + torch.sigmoid(3 * x),
    "logarithms": lambda x, y: (x * x + y * y).log() * torch.log1p(x * x),
    "error functions": lambda x, y: torch.erfc(x) + torch.erfc(-y) * x,
    "bounds": lambda x, y: x.clamp(min=0.1) - x.clamp(-0.2, 0.3) + x.relu() + x.clamp(max=0.25).abs(),
    "extremes": lambda x, y: torch.maximum(x, y) * torch.minimum(x, 2 * y) + torch.maximum(x, x.new_zeros(())),
    "signs": lambda x, y: x * y.sign() + y.abs() * x.detach().sign(),
    "masks": lambda x, y: torch.where(x > y, x * x, y).masked_fill((x < 0) & ~(y < 0), 0.5) * (x > 0.1),
    "thresholds": lambda x, y: torch.nn.functional.threshold(x, 0.1, 0.2) * y,
    "conversions": lambda x, y: x * (y > 0).to(x.dtype) + torch.addcmul(x, x, y, value=-2.0),
    "fused": lambda x, y: torch.addcdiv(x, y, x * x + 1, value=0.5) + torch.lerp(x, y.expand(3), 0.3),
    "sums": lambda x, y: x.sum() * y + torch.stack((x, x * y)).sum(0) + x.unsqueeze(0).sum(0, keepdim=True)[0],
    "views": lambda x, y: torch.stack(x.unbind()[::-1]).reshape(3, 1)[:, 0] * y.expand(3) + x.flip(0)[1:3].sum() * x[0],
    "products": lambda x, y: torch.stack((x, y.expand(3), x * y)) @ x.reshape(3, 1),
    "affine": lambda x, y: torch.addmm(x.reshape(3, 1), torch.ones(3, 3, dtype=x.dtype) * y, x.reshape(3, 1)),
    "in place": lambda x, y: squeezed(x) * y,
    "constants": lambda x, y: torch.full_like(x, 3.0) * x + torch.tensor([1.0, 2.0, 3.0], dtype=x.dtype) * y,
}
POINTS = [(-1.5, 0.2, 0.9, 0.4), (0.31, 0.3, -0.05, -0.7), (2.0, -0.25, 0.12, 0.12)]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_program_computes_what_torch_computes(name):
    function = FUNCTIONS[name]
    program, values, slopes = recorded(function, (3,), ())
    for numbers in POINTS:
        x, y = doubles(list(numbers[:3])).requires_grad_(), doubles(numbers[3]).requires_grad_()
        value = function(x, y)
        expected = torch.autograd.grad(value.sum(), (x, y), allow_unused=True, materialize_grads=True)
        assert_close(evaluated(program, values, numbers), value.detach().reshape(-1), rtol=1e-14, atol=1e-14)
        by_inputs = torch.cat([slope.reshape(-1) for slope in expected])
        assert_close(evaluated(program, slopes, numbers), by_inputs, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("tie", [0.0, 0.5])
def test_ties_take_torchs_side(tie):
    def function(x, y):
        return torch.maximum(x, y) + torch.minimum(x, 2 * y) + x.abs() + x.clamp(min=0.5) + (x - tie).relu()

    program, _, slopes = recorded(function, (), ())
    x, y = doubles(tie).requires_grad_(), doubles(tie).requires_grad_()
    expected = torch.autograd.grad(function(x, y), (x, y))
    assert_close(evaluated(program, slopes, (tie, tie)), torch.stack(expected))


@pytest.mark.parametrize(
    "function",
    [
        lambda x: x * 2 if x.sum() > 0 else x,  # reads a number
        lambda x: x * x.sum().item(),
        lambda x: x.float().double(),  # changes the type
        lambda x: x.sort()[0],
        lambda x: x**0.5,
        torch.lgamma,
    ],
)
def test_refuses_what_it_cannot_write_down(function):
    with pytest.raises(RecordingError):
        recorded(function, (3,))


def test_a_choice_between_truths_is_refused():
    with pytest.raises(RecordingError):
        recorded(lambda x: x * torch.where(x > 1, x > 2, x > 0), (3,))


def test_truths_are_numbers_where_they_are_computed_with():
    program, values, _ = recorded(lambda x: (x > 0) * x + 2.0 * (x > 1).double() - ((x > 0) == (x > 1)) * x, (3,))
    assert evaluated(program, values, (-1.0, 0.5, 2.0)).tolist() == [1.0, 0.5, 2.0]
