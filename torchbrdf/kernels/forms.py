"""What is known of each kind of model in this process: its formula, and the kernels made of it."""

import math
import threading
from collections.abc import Hashable, Sequence

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.kernels.kernel import Kernel, common_shape
from torchbrdf.kernels.pixel import form_of, formula, record, stored, with_stored
from torchbrdf.parameters import declared

_VECTOR = (3,)
_PIXELS = 5  # at which a formula is tried
_ALIKE = 1e-3  # relative; pixels that depend on each other differ by more, rounding by less


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
        self._kernels: dict[tuple[tuple[tuple[int, ...], ...], torch.dtype], Kernel | None] = {}  # by sizes
        self._lock = threading.Lock()

    def formula(self, normal: Tensor, light: Tensor, view: Tensor, material: Sequence[Tensor]) -> Tensor:
        """f_r (..., channel) [1/sr] in torch operations."""
        return formula(self.model, material, normal, light, view)

    def pixels(self, vectors: Sequence[Tensor], material: Sequence[Tensor]) -> int:
        """How many pixels vectors and stored tensors have together; 0 where their shapes do not fit."""
        if any(v.ndim == 0 or v.shape[-1] != 3 for v in vectors):
            return 0
        leads = [v.shape[:-1] for v in vectors]
        leads += [t.shape[:k] for t, k in zip(material, self._leads(material), strict=True)]
        try:
            return math.prod(common_shape(leads))
        except RuntimeError:
            return 0

    def kernel(self, material: Sequence[Tensor], dtype: torch.dtype) -> Kernel | None:
        """The kernel for stored tensors of these shapes; None where the formula has no scalar steps."""
        sizes = tuple(tuple(t.shape[k:]) for t, k in zip(material, self._leads(material), strict=True))
        with self._lock:
            if (sizes, dtype) not in self._kernels:
                self._kernels[sizes, dtype] = self._recorded(sizes, dtype)
        return self._kernels[sizes, dtype]

    def _leads(self, material: Sequence[Tensor]) -> list[int]:
        """Number of axes of pixels of each stored tensor."""
        return [max(t.ndim - trailing, 0) for t, trailing in zip(material, self._trailing, strict=True)]

    def _recorded(self, sizes: tuple[tuple[int, ...], ...], dtype: torch.dtype) -> Kernel | None:
        try:
            if not self._keeps_pixels_apart(sizes, dtype):
                return None
            return Kernel(record(self.model, sizes, dtype), (*(_VECTOR,) * 3, *sizes), dtype)
        except Exception:  # whatever a formula cannot do at one pixel, it may do at many
            return None

    def _keeps_pixels_apart(self, sizes: tuple[tuple[int, ...], ...], dtype: torch.dtype) -> bool:
        """Whether a few pixels at once are what they are one by one: no largest value is divided by, for example."""
        draw = torch.Generator().manual_seed(0)
        vectors = torch.randn(3, _PIXELS, 3, generator=draw, dtype=torch.float64).abs()
        vectors = torch.nn.functional.normalize(vectors, dim=-1).to(dtype)
        material = [torch.rand(size, generator=draw, dtype=torch.float64).to(dtype) for size in sizes]
        with torch.no_grad():
            together = self.formula(vectors[0], vectors[1], vectors[2], material)
            apart = [self.formula(n, s, v, material) for n, s, v in zip(*vectors, strict=True)]
        return torch.allclose(together, torch.stack(apart), rtol=_ALIKE, atol=_ALIKE, equal_nan=True)


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
