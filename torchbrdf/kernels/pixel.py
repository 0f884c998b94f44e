"""A model at one pixel as a program: its value, and the derivatives by its directions and by its material."""

import copy
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import torch
from torch import Tensor, nn

from torchbrdf._numerics import dot, unit_tolerance
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.kernels.program import Program
from torchbrdf.kernels.recording import Recorder, RecordingError
from torchbrdf.parameters import Parametric, declared

# Directions and a raw parameter at which nothing happens to be 0 or 1 while a formula is recorded.
_SOMEWHERE = ((0.36, 0.48, 0.8), (0.6, 0.0, 0.8), (0.0, 0.28, 0.96))
_RAW = 0.3
_OF_ANY_MODULE = frozenset(vars(nn.Module()))


@dataclass(frozen=True)
class Pixel:
    """Inputs of the program, in order: normal, light, view, each parameter as stored, and the weight of each channel.

    Attributes:
        program: the steps.
        value: places of f_r, one a channel.
        unit: place of the truth that all vectors are of unit length.
        slopes: places of the derivatives of sum(weight * f_r) by each number of each vector and parameter.
        channels: of f_r.
    """

    program: Program
    value: list[int]
    unit: int
    slopes: list[list[int]]

    @property
    def channels(self) -> int:
        return len(self.value)


@cache
def _names(owner: type[Parametric]) -> tuple[str, ...]:
    """What tensors of a class may be called, in order."""
    entries = declared(owner.__new__(owner))
    return tuple(f"{kind}_{entry.name}" for entry in entries for kind in ("raw", "fixed"))


def stored(model: Parametric) -> dict[str, Tensor]:
    """The tensors that a module's declared parameters are stored in, by name, in order."""
    tensors = {**model._parameters, **model._buffers}
    return {name: tensor for name in _names(type(model)) if (tensor := tensors.get(name)) is not None}


def with_stored(model: BRDF, tensors: Mapping[str, Tensor]) -> BRDF:
    """The same model on other tensors, which need not be parameters of their own."""
    other = copy.copy(model)
    object.__setattr__(other, "_parameters", {})
    object.__setattr__(other, "_buffers", dict(model._buffers) | dict(tensors))
    return other


def form_of(model: BRDF) -> Hashable | None:
    """All that a model's formula depends on beside its parameters; None where that is not known to be plain numbers."""
    if model._modules or len(stored(model)) != len(model._parameters) + len(model._buffers):
        return None
    settings = {name: value for name, value in vars(model).items() if name not in _OF_ANY_MODULE}
    plain = _frozen(settings)
    return None if plain is None else (type(model), tuple(stored(model)), plain)


def _frozen(value: object) -> Hashable | None:
    if isinstance(value, (bool, int, float, str, type(None))):
        return type(value).__name__, value
    if isinstance(value, (tuple, list)):
        items = tuple(map(_frozen, value))
    elif isinstance(value, dict):
        items = tuple(_frozen(item) for pair in value.items() for item in pair)
    else:
        return None
    return None if None in items else (type(value).__name__, items)


def formula(model: BRDF, tensors: Sequence[Tensor], normal: Tensor, light: Tensor, view: Tensor) -> Tensor:
    """f_r (..., channel) [1/sr] of the model with other stored tensors, in torch operations; nothing is checked."""
    cosines = Cosines.from_products(dot(normal, light), dot(normal, view), dot(light, view))
    one = with_stored(model, dict(zip(stored(model), tensors, strict=True)))
    return one.evaluate(replace(cosines, vectors=(normal, light, view)))


def record(model: BRDF, sizes: Sequence[tuple[int, ...]], dtype: torch.dtype) -> Pixel:
    """The program of a model whose stored parameters have these sizes at a pixel.

    Raises RecordingError where the formula takes operations that have no scalar steps.
    """
    recorder = Recorder(dtype)
    vectors = [torch.tensor(v, dtype=dtype) for v in _SOMEWHERE]
    material = [torch.full(size, _RAW, dtype=dtype) for size in sizes]
    given = [recorder.input(t).requires_grad_() for t in (*vectors, *material)]
    with torch.enable_grad(), recorder:
        value = formula(model, given[3:], *given[:3])
        off = torch.stack([(dot(v, v) - 1).abs() for v in given[:3]]).detach()
        x, y, z = (off <= unit_tolerance(dtype)).unbind()
        unit = x & y & z
    if value.ndim != 1:
        raise RecordingError(f"a value of shape {tuple(value.shape)} at a pixel")
    weight = recorder.input(torch.full_like(value, 0.7, requires_grad=False))
    with recorder:
        slopes = torch.autograd.grad(value, given, weight, allow_unused=True, materialize_grads=True)
    read = recorder.places_of
    return Pixel(recorder.program, read(value), read(unit)[0], [read(slope) for slope in slopes])
