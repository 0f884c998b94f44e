"""What torch computes for one pixel, written down as scalar steps: value and derivatives from the formula itself.

A mode of torch's dispatcher sees every operation on tensors, of the formula and of the derivatives that autograd makes
of it. Each number in memory is known by its address as the result of a step, so that views, broadcasting and changes in
place need no rules of their own.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from torchbrdf.kernels.program import COMPARISONS, Program

Rule = Callable[..., int]


class RecordingError(Exception):
    """The formula does something that has no scalar steps, or that depends on numbers it read."""


class Recorder(TorchDispatchMode):
    """Writes a program while it is active.

    Attributes:
        dtype: of all numbers that depend on an input.
        program: what was written.
    """

    def __init__(self, dtype: torch.dtype) -> None:
        super().__init__()
        self.dtype = dtype
        self.program = Program()
        self._results: dict[int, int] = {}  # address of a number in memory -> place of the step that made it
        self._kept: list[Tensor] = []  # so that no address is used twice
        self._inputs = 0

    def input(self, tensor: Tensor) -> Tensor:
        """The tensor, each of whose numbers is an input of the program from now on, in order."""
        count = tensor.numel()
        places = [self.program.append("input", self._inputs + k) for k in range(count)]
        self._inputs += count
        self._write(tensor, np.array(places, dtype=object).reshape(tensor.shape))
        return tensor

    def places_of(self, tensor: Tensor) -> list[int]:
        """Places of the steps whose results the tensor holds."""
        return list(self._read(tensor).ravel())

    def __torch_dispatch__(
        self, func: Any, types: Any, args: Sequence[Any] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        kwargs = kwargs or {}
        given = [t for t in _flat((*args, *kwargs.values())) if isinstance(t, Tensor)]
        self._kept += given
        name = func.overloadpacket.__name__
        before = [self._read(t) for t in given] if func._schema.is_mutable else None
        made = func(*args, **kwargs)
        outputs = [t for t in _flat((made,)) if isinstance(t, Tensor)]
        self._kept += outputs
        if len(outputs) == 0:
            raise RecordingError(f"{name} reads numbers")
        if name in RESHAPED_IN_PLACE:
            pass
        elif before is not None:
            # read again before it was changed
            values = iter(before)
            self._write(args[0], self._evaluate(name.rstrip("_"), args, kwargs, lambda _: next(values)))
        elif any(self._is_view(t, given) for t in outputs):
            pass
        elif name in LIKE or not any(self._is_known(t) for t in given):
            for t in outputs:  # numbers that depend on no input
                self._write(t, self._numbers(t))
        else:
            if outputs[0].dtype != (torch.bool if name in TRUTHFUL else self.dtype):
                raise RecordingError(f"{name} makes {outputs[0].dtype}")
            self._write(outputs[0], self._evaluate(name, args, kwargs, self._read))
        return made

    def _evaluate(
        self, name: str, args: Sequence[Any], kwargs: dict[str, Any], read: Callable[[Tensor], np.ndarray]
    ) -> np.ndarray:
        def argument(x: Any) -> Any:
            if isinstance(x, Tensor):
                return read(x)
            return [argument(y) for y in x] if isinstance(x, (list, tuple)) and any(map(_is_tensor, x)) else x

        arguments = [argument(x) for x in args]
        if name in WHOLE:
            return WHOLE[name](self.program, *arguments, **kwargs)
        if name not in ELEMENTWISE:
            raise RecordingError(f"no scalar steps for {name}")
        rule, constant = ELEMENTWISE[name], self.program.constant
        arguments = [np.array(constant(float(x)), dtype=object) if _is_number(x) else x for x in arguments]
        options = {k: constant(float(v)) for k, v in kwargs.items() if _is_number(v)}
        arrays = np.broadcast_arrays(*(x for x in arguments if x is not None))
        shape = arrays[0].shape
        places = iter(arrays)
        rows = [[None] * arrays[0].size if x is None else list(next(places).ravel()) for x in arguments]
        if name not in {*TRUTHFUL, "where", "masked_fill"}:
            rows = [[x if x is None else _number(self.program, x) for x in row] for row in rows]
        written = [rule(self.program, *row, **options) for row in zip(*rows, strict=True)]
        return np.array(written, dtype=object).reshape(shape)

    def _read(self, tensor: Tensor) -> np.ndarray:
        places = [self._results.get(address) for address in _addresses(tensor)]
        if None in places:
            unknown = self._numbers(tensor).ravel()
            places = [unknown[k] if place is None else place for k, place in enumerate(places)]
        return np.array(places, dtype=object).reshape(tensor.shape)

    def _write(self, tensor: Tensor, places: np.ndarray) -> None:
        places = np.broadcast_to(places, tuple(tensor.shape))
        self._results.update(zip(_addresses(tensor), places.ravel(), strict=True))

    def _numbers(self, tensor: Tensor) -> np.ndarray:
        values = tensor.detach().reshape(-1).tolist()
        return np.array([self.program.constant(float(v)) for v in values], dtype=object).reshape(tensor.shape)

    def _is_known(self, tensor: Tensor) -> bool:
        return any(address in self._results for address in _addresses(tensor))

    @staticmethod
    def _is_view(tensor: Tensor, given: Sequence[Tensor]) -> bool:
        storage = tensor.untyped_storage().data_ptr()
        return any(storage == t.untyped_storage().data_ptr() for t in given)


def _addresses(tensor: Tensor) -> list[int]:
    start, size = tensor.data_ptr(), tensor.element_size()
    steps = [[size * stride * k for k in range(n)] for n, stride in zip(tensor.shape, tensor.stride(), strict=True)]
    return [start + sum(step) for step in itertools.product(*steps)]


def _flat(values: Iterable[Any]) -> Iterable[Any]:
    for value in values:
        if isinstance(value, (list, tuple)):
            yield from _flat(value)
        else:
            yield value


def _is_tensor(x: Any) -> bool:
    return isinstance(x, Tensor)


def _is_number(x: Any) -> bool:
    return isinstance(x, (int, float))


def _maximum(p: Program, a: int, b: int) -> int:
    """Of numbers that are not known to be: NaN where either is NaN."""
    larger = p.append("or", p.append("gt", a, b), p.append("ne", a, a))
    return p.select(larger, a, b)


def _minimum(p: Program, a: int, b: int) -> int:
    smaller = p.append("or", p.append("lt", a, b), p.append("ne", a, a))
    return p.select(smaller, a, b)


def _clamp(p: Program, x: int, low: int | None = None, high: int | None = None, **bounds: int) -> int:
    low, high = bounds.get("min", low), bounds.get("max", high)
    if low is not None:
        x = _kept_above(p, x, low)
    return x if high is None else p.select(p.append("gt", x, high), high, x)


def _kept_above(p: Program, x: int, low: int) -> int:
    return p.select(p.append("lt", x, low), low, x)


def _sign(p: Program, x: int) -> int:
    zero, one = p.constant(0.0), p.constant(1.0)
    below = p.select(p.append("lt", x, zero), p.constant(-1.0), zero)
    return p.select(p.append("gt", x, zero), one, below)


def _power(p: Program, x: int, exponent: int) -> int:
    operation, (power, *_) = p.steps[exponent]
    if operation != "constant" or power != int(power) or not 0 < power < 9:
        raise RecordingError("a power other than a small whole one")
    result = x
    for _ in range(int(power) - 1):
        result = p.multiply(result, x)
    return result


def _sigmoid(p: Program, x: int) -> int:
    return p.reciprocal(p.add(p.constant(1.0), p.append("exp", p.negate(x))))


def _log1p(p: Program, x: int) -> int:
    """log(1 + x) with the digits of a small x, which 1 + x has lost: they are what the rounded sum differs by."""
    rounded = p.add(p.constant(1.0), x)
    lost = p.divide(p.subtract(x, p.subtract(rounded, p.constant(1.0))), rounded)
    return p.add(p.append("log", rounded), p.select(p.append("eq", rounded, x), p.constant(0.0), lost))


def _erfc(p: Program, x: int) -> int:
    size = p.append("abs", x)
    right = p.multiply(p.append("exp", p.negate(p.multiply(size, size))), p.append("erfcx", size))
    return p.select(p.append("lt", x, p.constant(0.0)), p.subtract(p.constant(2.0), right), right)


def _scaled(p: Program, x: int, factor: int | None) -> int:
    return x if factor is None else p.multiply(factor, x)


def _number(p: Program, x: int) -> int:
    return p.select(x, p.constant(1.0), p.constant(0.0)) if p.is_truth(x) else x


def _sum(p: Program, x: np.ndarray, dims: Sequence[int] | None = None, keepdim: bool = False, **_: Any) -> np.ndarray:
    axes = range(x.ndim) if not dims else [d % x.ndim for d in dims]
    for axis in sorted(axes, reverse=True):
        x = np.apply_along_axis(lambda terms: np.array(p.total(terms), dtype=object), axis, x)
        x = np.expand_dims(x, axis) if keepdim else x
    return np.asarray(x, dtype=object)


def _product(p: Program, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    rows = [[p.total(map(p.multiply, row, column)) for column in b.T] for row in a]
    return np.array(rows, dtype=object).reshape(a.shape[0], b.shape[1])


def _affine(p: Program, bias: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    product = _product(p, a, b)
    bias = np.broadcast_to(bias, product.shape)
    added = [p.add(x, y) for x, y in zip(product.ravel(), bias.ravel(), strict=True)]
    return np.array(added, dtype=object).reshape(product.shape)


def _copied(_: Program, target: np.ndarray, source: np.ndarray, *__: Any) -> np.ndarray:
    return np.broadcast_to(source, target.shape)


def _placed(p: Program, part: np.ndarray, size: Sequence[int], dim: int, rows: slice) -> np.ndarray:
    whole = np.full(tuple(size), p.constant(0.0), dtype=object)
    np.moveaxis(whole, dim, 0)[rows] = np.moveaxis(part, dim, 0)
    return whole


def _selected(p: Program, part: np.ndarray, size: Sequence[int], dim: int, index: int) -> np.ndarray:
    first = index % size[dim]
    return _placed(p, np.expand_dims(part, dim), size, dim, slice(first, first + 1))


def _sliced(p: Program, part: np.ndarray, size: Sequence[int], dim: int, *span: int) -> np.ndarray:
    return _placed(p, part, size, dim, slice(*span))


# Operations whose results depend on the shape of what they are given alone.
LIKE = {
    *("ones_like", "zeros_like", "full_like", "empty_like"),
    *("new_zeros", "new_ones", "new_full", "new_empty", "new_empty_strided"),
}
RESHAPED_IN_PLACE = {"squeeze_", "unsqueeze_", "t_", "transpose_"}
# Operations on whole arrays of places.
WHOLE: dict[str, Callable[..., np.ndarray]] = {
    "stack": lambda p, parts, dim=0: np.stack(parts, dim),
    "cat": lambda p, parts, dim=0: np.concatenate(parts, dim),
    "sum": _sum,
    "mm": _product,
    "addmm": _affine,
    "copy": _copied,
    "flip": lambda p, x, dims: np.flip(x, dims),
    "select_backward": _selected,
    "slice_backward": _sliced,
}
LOGIC = {f"{kind}_{name}": name for kind in ("bitwise", "logical") for name in ("and", "or", "not")}
# Operations that make truths.
TRUTHFUL = {*LOGIC, *COMPARISONS}
# Operations on one number of each argument; a bool in memory is a truth value in the program.
ELEMENTWISE: dict[str, Rule] = {
    "add": lambda p, a, b, alpha=None: p.add(a, _scaled(p, b, alpha)),
    "sub": lambda p, a, b, alpha=None: p.subtract(a, _scaled(p, b, alpha)),
    "rsub": lambda p, a, b, alpha=None: p.subtract(b, _scaled(p, a, alpha)),
    "mul": Program.multiply,
    "div": Program.divide,
    "neg": Program.negate,
    "abs": lambda p, x: p.append("abs", x),
    "sqrt": lambda p, x: p.append("sqrt", x),
    "rsqrt": lambda p, x: p.reciprocal(p.append("sqrt", x)),
    "reciprocal": Program.reciprocal,
    "addcmul": lambda p, x, a, b, value=None: p.add(x, p.multiply(_scaled(p, a, value), b)),
    "addcdiv": lambda p, x, a, b, value=None: p.add(x, p.divide(_scaled(p, a, value), b)),
    "lerp": lambda p, a, b, weight: p.add(a, p.multiply(weight, p.subtract(b, a))),
    "pow": _power,
    "exp": lambda p, x: p.append("exp", x),
    "log": lambda p, x: p.append("log", x),
    "log1p": _log1p,
    "erfc": _erfc,
    "sigmoid": _sigmoid,
    "sigmoid_backward": lambda p, g, y: p.multiply(g, p.multiply(y, p.subtract(p.constant(1.0), y))),
    "sign": _sign,
    "sgn": _sign,
    "maximum": _maximum,
    "minimum": _minimum,
    "clamp": _clamp,
    "relu": lambda p, x: _kept_above(p, x, p.constant(0.0)),
    "threshold_backward": lambda p, g, x, t: p.select(p.append("gt", x, t), g, p.constant(0.0)),
    "threshold": lambda p, x, t, value: p.select(p.append("gt", x, t), x, value),
    "where": Program.select,
    "masked_fill": lambda p, x, mask, value: p.select(mask, value, x),
    "clone": lambda p, x: x,
    "_to_copy": lambda p, x: x,
    "fill": lambda p, x, value: value,
    "zero": lambda p, x: p.constant(0.0),
    **{name: (lambda p, a, b, name=name: p.append(name, _number(p, a), _number(p, b))) for name in COMPARISONS},
    **{name: (lambda p, *x, step=step: p.append(step, *x)) for name, step in LOGIC.items()},
}
