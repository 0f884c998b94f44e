"""The kernels as an operator of torch, `torchbrdf::reflectance`, which falls back to the formula where it must.

Under vmap, on other devices than a CPU, and for derivatives of derivatives it is the formula in torch operations.
"""

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor
from torch.library import Library

from torchbrdf.directions import Cosines
from torchbrdf.kernels.forms import form_at

_ARRAYS = "int form, Tensor normal, Tensor light, Tensor view, Tensor[] material"
_library = Library("torchbrdf", "DEF")
_library.define(f"reflectance({_ARRAYS}, bool checked) -> Tensor", tags=(torch.Tag.pt2_compliant_tag,))
_library.define(
    f"reflectance_slopes({_ARRAYS}, Tensor weight, bool[] wanted) -> Tensor[]", tags=(torch.Tag.pt2_compliant_tag,)
)
_VALUE, _SLOPES = "torchbrdf::reflectance", "torchbrdf::reflectance_slopes"


def _value(form: int, normal: Tensor, light: Tensor, view: Tensor, material: Sequence[Tensor], checked: bool) -> Tensor:
    kernel = form_at(form).kernel(material, normal.dtype)
    if kernel is None:
        return _formula(form, normal, light, view, material, checked)
    value, off = kernel.value([normal, light, view, *material])
    if checked and off:
        Cosines.of(normal, light, view)  # says what is off, and has the last word on whether anything is
    return value


def _formula(
    form: int, normal: Tensor, light: Tensor, view: Tensor, material: Sequence[Tensor], checked: bool
) -> Tensor:
    if checked:
        Cosines.of(normal, light, view)
    return form_at(form).formula(normal, light, view, material)


def _slopes(
    form: int,
    normal: Tensor,
    light: Tensor,
    view: Tensor,
    material: Sequence[Tensor],
    weight: Tensor,
    wanted: Sequence[bool],
) -> list[Tensor]:
    """Derivatives of sum(weight * f_r) by the arrays that are wanted; nothing (0,) for the others."""
    arrays = [normal, light, view, *material]
    kernel = form_at(form).kernel(material, normal.dtype) if normal.device.type == "cpu" else None
    if kernel is not None:
        slopes = kernel.slopes(arrays, weight, wanted)
    else:
        given = [t.detach().requires_grad_(want) for t, want in zip(arrays, wanted, strict=True)]
        asked = iter(_by_formula(form, given, weight, wanted, again=False))
        slopes = [next(asked) if want else None for want in wanted]
    return [normal.new_empty(0) if slope is None else slope for slope in slopes]


def _by_formula(
    form: int, arrays: Sequence[Tensor], weight: Tensor, wanted: Sequence[bool], *, again: bool
) -> Sequence[Tensor]:
    """Derivatives by the wanted arrays through the formula, `again` differentiable."""
    with torch.enable_grad():
        value = form_at(form).formula(*arrays[:3], arrays[3:])
    asked = [t for t, want in zip(arrays, wanted, strict=True) if want]
    return torch.autograd.grad(value, asked, weight, create_graph=again, allow_unused=True, materialize_grads=True)


class _Reflectance(torch.autograd.Function):
    """The operator with its derivatives; `torch.library.register_autograd` would take longer than a small call."""

    @staticmethod
    def forward(ctx: Any, form: int, checked: bool, *arrays: Tensor) -> Tensor:
        ctx.form = form
        ctx.save_for_backward(*arrays)
        with torch._C._AutoDispatchBelowAutograd():
            return torch.ops.torchbrdf.reflectance(form, *arrays[:3], arrays[3:], checked)

    @staticmethod
    def backward(ctx: Any, weight: Tensor) -> tuple[Tensor | None, ...]:
        arrays, wanted = ctx.saved_tensors, list(ctx.needs_input_grad[2:])
        if torch.is_grad_enabled():  # the derivatives will be differentiated in turn
            asked = iter(_by_formula(ctx.form, arrays, weight, wanted, again=True))
            return None, None, *(next(asked) if want else None for want in wanted)
        made = torch.ops.torchbrdf.reflectance_slopes(ctx.form, *arrays[:3], arrays[3:], weight, wanted)
        return None, None, *(slope if want else None for slope, want in zip(made, wanted, strict=True))


def _differentiable(
    form: int, normal: Tensor, light: Tensor, view: Tensor, material: Sequence[Tensor], checked: bool
) -> Any:
    return _Reflectance.apply(form, checked, normal, light, view, *material)


def _unlooked_at(
    form: int, normal: Tensor, light: Tensor, view: Tensor, material: Sequence[Tensor], checked: bool
) -> Tensor:
    return form_at(form).formula(normal, light, view, material)


def _slopes_without_numbers(
    form: int,
    normal: Tensor,
    light: Tensor,
    view: Tensor,
    material: Sequence[Tensor],
    weight: Tensor,
    wanted: Sequence[bool],
) -> list[Tensor]:
    arrays = (normal, light, view, *material)
    return [torch.empty_like(t) if want else normal.new_empty(0) for t, want in zip(arrays, wanted, strict=True)]


_library.impl("reflectance", _value, "CPU")
_library.impl("reflectance", _formula, "CUDA")
_library.impl("reflectance", _unlooked_at, "FuncTorchBatched")
_library.impl("reflectance", _differentiable, "Autograd")
_library.impl("reflectance_slopes", _slopes, "CompositeExplicitAutograd")
torch.library.register_fake(_VALUE, _unlooked_at, lib=_library)
torch.library.register_fake(_SLOPES, _slopes_without_numbers, lib=_library)


def reflectance(
    form: int, normal: Tensor, light: Tensor, view: Tensor, material: Sequence[Tensor], *, checked: bool
) -> Tensor:
    """f_r (..., channel) [1/sr] of a form of models with stored tensors.

    Raises what `Cosines.of` raises where vectors are `checked` and not of unit length.
    """
    return torch.ops.torchbrdf.reflectance(form, normal, light, view, list(material), checked)
