"""When a model is evaluated by a compiled kernel, and the switch that decides it."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import torch
from torch import Tensor, nn
from torch.autograd import forward_ad
from torch.utils._python_dispatch import _get_current_dispatch_mode

from torchbrdf._numerics import SUPPORTED_DTYPES
from torchbrdf.brdf import BRDF
from torchbrdf.checks import taken_on_trust
from torchbrdf.kernels.forms import form_for
from torchbrdf.kernels.machine import is_installed
from torchbrdf.kernels.operator import reflectance
from torchbrdf.kernels.pixel import stored

# A kernel takes a fraction of a second to compile: what some hundred calls of this size take without it.
SMALLEST = 4096
_smallest: ContextVar[float] = ContextVar("smallest", default=SMALLEST)


@contextmanager
def native(smallest: float = 1) -> Iterator[None]:
    """Compiled kernels within this context from `smallest` pixels on; `math.inf` for none.

    Without it from 4096 pixels on, if `llvmlite` is installed. A context, since what is measured or debugged with one
    choice is a part of a program and the other choice returns after it, whatever happens; it holds for one thread (and
    asynchronous task) and does not disturb others.

    >>> import math, torchbrdf
    >>> with torchbrdf.native(math.inf):  # the formula alone
    ...     pass
    """
    before = _smallest.set(smallest)
    try:
        yield
    finally:
        _smallest.reset(before)


def by_kernel(model: BRDF, normal: Tensor, light: Tensor, view: Tensor) -> Tensor | None:
    """f_r (..., channel) [1/sr] by a compiled kernel, or None where the formula is to be used.

    The formula is for whatever is not plain numbers on a CPU: traced, compiled or mapped tensors, forward
    differentiation, other devices, dtypes that differ.
    Raises: ValueError where a vector is not of unit length, as `Cosines.of`; not inside `torchbrdf.unchecked()`.
    """
    if torch.compiler.is_compiling() or _is_transformed():
        return None
    material = tuple(stored(model).values())
    arrays = (normal, light, view, *material)
    if not all(map(_is_plain, arrays)) or any(t.dtype != normal.dtype for t in arrays):
        return None
    form = form_for(model) if normal.dtype in SUPPORTED_DTYPES else None
    if form is None or form.pixels(arrays[:3], material) < max(_smallest.get(), 1):
        return None
    if not is_installed() or form.kernel(material, normal.dtype) is None:
        return None
    return reflectance(form.place, arrays, checked=not taken_on_trust())


def _is_plain(tensor: Any) -> bool:
    """Whether it is an array of numbers in the computer's memory, and no subclass that stands for something else."""
    if type(tensor) not in {Tensor, nn.Parameter}:
        return False
    return tensor.device.type == "cpu" and tensor.layout == torch.strided and not tensor.is_conj()


def _is_transformed() -> bool:
    """Whether operations are watched, mapped or differentiated forward: what happens to them is then not only here."""
    return (
        _get_current_dispatch_mode() is not None
        or torch._C._functorch.peek_interpreter_stack() is not None  # pyright: ignore[reportAttributeAccessIssue]
        or forward_ad._current_level >= 0
    )
