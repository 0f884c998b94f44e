"""The kernels as an operator of torch, `torchbrdf::reflectance`, which falls back to the formula where it must.

Under vmap, on other devices than a CPU, and for derivatives of derivatives it is the formula in torch operations.
Its arrays are normal, light and view (..., 3), then the stored parameters of a model of the form.
"""

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor
from torch.library import Library
from torch.utils._python_dispatch import _disable_current_modes

from torchbrdf.directions import Cosines
from torchbrdf.kernels.forms import form_at
from torchbrdf.kernels.kernel import Kernel

_library = Library("torchbrdf", "DEF")
_ours = (torch.Tag.pt2_compliant_tag,)
_library.define("reflectance(int form, Tensor[] arrays, bool checked) -> Tensor", tags=_ours)
_library.define("reflectance_slopes(int form, Tensor[] arrays, Tensor weight, bool[] wanted) -> Tensor[]", tags=_ours)


def reflectance(form: int, arrays: Sequence[Tensor], *, checked: bool) -> Tensor:
    """f_r (..., channel) [1/sr] of a form of models.

    Raises what `Cosines.of` raises where vectors are `checked` and not of unit length.
    """
    return torch.ops.torchbrdf.reflectance(form, list(arrays), checked)


def _formula(form: int, arrays: Sequence[Tensor], checked: bool = False) -> Tensor:
    normal, light, view, *material = arrays
    if checked:
        Cosines.of(normal, light, view)
    return form_at(form).formula(normal, light, view, material)


def _kernel(form: int, arrays: Sequence[Tensor]) -> Kernel | None:
    first, _, _, *material = arrays
    return form_at(form).kernel(material, first.dtype) if first.device.type == "cpu" else None


def _value(form: int, arrays: Sequence[Tensor], checked: bool) -> Tensor:
    kernel = _kernel(form, arrays)
    if kernel is None:
        return _formula(form, arrays, checked)
    value, off = kernel.value(arrays)
    if checked and off:
        normal, light, view, *_ = arrays
        Cosines.of(normal, light, view)  # says what is off, and has the last word on whether anything is
    return value


def _slopes(form: int, arrays: Sequence[Tensor], weight: Tensor, wanted: Sequence[bool]) -> list[Tensor]:
    """Derivatives of sum(weight * f_r) by the arrays that are wanted; nothing (0,) for the others."""
    kernel = _kernel(form, arrays)
    if kernel is None:
        given = [t.detach().requires_grad_(want) for t, want in zip(arrays, wanted, strict=True)]
        slopes = _by_formula(form, given, weight, wanted)
    else:
        slopes = kernel.slopes(arrays, weight, wanted)
    return [weight.new_empty(0) if slope is None else slope for slope in slopes]


def _by_formula(form: int, arrays: Sequence[Tensor], weight: Tensor, wanted: Sequence[bool]) -> Sequence[Tensor | None]:
    """Derivatives by the wanted arrays through the formula; differentiable in turn where gradients are recorded."""
    again = torch.is_grad_enabled()
    with torch.enable_grad():
        value = _formula(form, arrays)
    asked = [t for t, want in zip(arrays, wanted, strict=True) if want]
    slopes = iter(
        torch.autograd.grad(value, asked, weight, create_graph=again, allow_unused=True, materialize_grads=True)
    )
    return [next(slopes) if want else None for want in wanted]


class _Reflectance(torch.autograd.Function):
    """The operator with its derivatives; `torch.library.register_autograd` would take longer than a small call."""

    @staticmethod
    def forward(ctx: Any, form: int, checked: bool, *arrays: Tensor) -> Tensor:
        ctx.form = form
        ctx.save_for_backward(*arrays)
        with torch._C._AutoDispatchBelowAutograd():
            return torch.ops.torchbrdf.reflectance(form, arrays, checked)

    @staticmethod
    def backward(ctx: Any, *weights: Tensor) -> tuple[Tensor | None, ...]:
        arrays, wanted = ctx.saved_tensors, list(ctx.needs_input_grad[2:])
        if torch.is_grad_enabled():  # the derivatives will be differentiated in turn
            return None, None, *_by_formula(ctx.form, arrays, weights[0], wanted)
        made = torch.ops.torchbrdf.reflectance_slopes(ctx.form, arrays, weights[0], wanted)
        return None, None, *(slope if want else None for slope, want in zip(made, wanted, strict=True))


def _differentiable(form: int, arrays: Sequence[Tensor], checked: bool) -> Any:
    return _Reflectance.apply(form, checked, *arrays)


def _unlooked_at(form: int, arrays: Sequence[Tensor], checked: bool) -> Tensor:
    return _formula(form, arrays)


def _shape_of_value(form: int, arrays: Sequence[Tensor], checked: bool) -> Tensor:
    first, _, _, *material = arrays
    with _disable_current_modes():  # numbers are needed to record, and shapes alone are known here
        kernel = form_at(form).kernel(material, first.dtype)
    if kernel is None:
        return _formula(form, arrays)
    return first.new_empty((*kernel.lead_of(arrays), kernel.pixel.channels))


def _shapes_of_slopes(form: int, arrays: Sequence[Tensor], weight: Tensor, wanted: Sequence[bool]) -> list[Tensor]:
    return [torch.empty_like(t) if want else weight.new_empty(0) for t, want in zip(arrays, wanted, strict=True)]


_library.impl("reflectance", _value, "CPU")
_library.impl("reflectance", _formula, "CUDA")
_library.impl("reflectance", _differentiable, "Autograd")
_library.impl("reflectance", _unlooked_at, "FuncTorchBatched")
_library.impl("reflectance_slopes", _slopes, "CompositeExplicitAutograd")
torch.library.register_fake("torchbrdf::reflectance", _shape_of_value, lib=_library)
torch.library.register_fake("torchbrdf::reflectance_slopes", _shapes_of_slopes, lib=_library)
