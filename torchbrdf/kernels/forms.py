"""What is known of each kind of model in this process: its formula, and the kernels made of it."""

import threading
from collections.abc import Hashable, Sequence

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.kernels.kernel import Kernel
from torchbrdf.kernels.pixel import form_of, formula, record, stored, with_stored
from torchbrdf.parameters import declared

_VECTOR = (3,)


class Form:
    """A model without its material: all models of one form differ in stored tensors alone.

    Args:
        model: any of them.
        place: in the list of all forms, by which operators know it.
    """

    def __init__(self, model: BRDF, place: int):
        self.place = place
        self.model = with_stored(model, {name: torch.empty(0) for name in stored(model)})
        trailing = {entry.name: entry.domain.trailing for entry in declared(model)}
        self._trailing = [trailing[name.partition("_")[2]] for name in stored(model)]
        self._kernels: dict[tuple[tuple[tuple[int, ...], ...], torch.dtype], Kernel | None] = {}
        self._lock = threading.Lock()

    def formula(self, normal: Tensor, light: Tensor, view: Tensor, material: Sequence[Tensor]) -> Tensor:
        """f_r (..., channel) [1/sr] in torch operations."""
        return formula(self.model, material, normal, light, view)

    def kernel(self, material: Sequence[Tensor], dtype: torch.dtype) -> Kernel | None:
        """The kernel for stored tensors of these shapes; None where the formula has no scalar steps."""
        own = zip(material, self._trailing, strict=True)
        sizes = (*(_VECTOR,) * 3, *(tuple(t.shape[max(t.ndim - trailing, 0) :]) for t, trailing in own))
        with self._lock:
            if (sizes, dtype) not in self._kernels:
                self._kernels[sizes, dtype] = self._recorded(sizes, dtype)
        return self._kernels[sizes, dtype]

    def _recorded(self, sizes: tuple[tuple[int, ...], ...], dtype: torch.dtype) -> Kernel | None:
        try:
            pixel = record(self.model, sizes[3:], dtype)
        except Exception:  # whatever a formula cannot do at one pixel, it may do at many
            return None
        return Kernel(pixel, sizes, dtype)


_places: dict[Hashable, int] = {}
_forms: list[Form] = []
_lock = threading.Lock()


def form_for(model: BRDF) -> Form | None:
    """The form of a model; None for one that depends on more than numbers it declares."""
    key = form_of(model)
    if key is None:
        return None
    with _lock:
        if key not in _places:
            _places[key] = len(_forms)
            _forms.append(Form(model, len(_forms)))
    return _forms[_places[key]]


def form_at(place: int) -> Form:
    """The form of a place."""
    return _forms[place]
