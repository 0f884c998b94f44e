"""Loop loops of one model over arrays of pixels: value, and derivatives as far as they are asked for."""

import math
import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import torch
from torch import Tensor

from torchbrdf.kernels.lowering import Stream, lower
from torchbrdf.kernels.machine import Loop, compiled
from torchbrdf.kernels.pixel import Pixel

# Pixels below which a thread more takes longer to wake than it saves.
_PIXELS_A_THREAD = 32768
# Shares are multiples of what instructions work on at once, so that results are the same for any number of threads.
_WHOLE = 64


class Kernel:
    """Loops of one program. Each is compiled when its kind of arrays is first met.

    Args:
        pixel: the program.
        sizes: shape at a pixel of each array: three vectors, then the stored parameters.
        dtype: of all arrays.
    """

    def __init__(self, pixel: Pixel, sizes: Sequence[tuple[int, ...]], dtype: torch.dtype):
        self.pixel = pixel
        self.sizes = tuple(sizes)
        self.dtype = dtype
        self._loops: dict[tuple[tuple[bool, ...], tuple[bool, ...]], Loop] = {}
        self._lock = threading.Lock()

    def value(self, arrays: Sequence[Tensor]) -> tuple[Tensor, int]:
        """f_r (..., channel), and the number of pixels with a vector that is not of unit length."""
        lead = self.lead_of(arrays)
        rows, repeated = self._rows(arrays, lead)
        result = torch.empty((*lead, self.pixel.channels), dtype=self.dtype)
        return result, self._run(self.loop(repeated, ()), rows, repeated, [result], math.prod(lead))

    def slopes(self, arrays: Sequence[Tensor], weight: Tensor, wanted: Sequence[bool]) -> list[Tensor | None]:
        """Derivatives of sum(weight * f_r) by those arrays that are wanted, each of the shape of its array."""
        lead = self.lead_of(arrays)
        rows, repeated = self._rows(arrays, lead)
        rows.append(weight.contiguous())
        results = [
            torch.empty((*lead, *size), dtype=self.dtype) if want else None
            for size, want in zip(self.sizes, wanted, strict=True)
        ]
        made = [result for result in results if result is not None]
        self._run(self.loop(repeated, tuple(wanted)), rows, (*repeated, False), made, math.prod(lead))
        return [
            None if result is None else result.sum_to_size(array.shape)
            for result, array in zip(results, arrays, strict=True)
        ]

    def lead_of(self, arrays: Sequence[Tensor]) -> tuple[int, ...]:
        """Shape of the pixels."""
        shapes = [array.shape[: array.ndim - len(size)] for array, size in zip(arrays, self.sizes, strict=True)]
        return common_shape(shapes)

    def loop(self, repeated: tuple[bool, ...], wanted: tuple[bool, ...]) -> Loop:
        """The loop over arrays of which some are the same for all pixels; no array wanted is the value."""
        with self._lock:
            if (repeated, wanted) not in self._loops:
                self._loops[repeated, wanted] = self._compile(repeated, wanted)
        return self._loops[repeated, wanted]

    def _compile(self, repeated: tuple[bool, ...], wanted: tuple[bool, ...]) -> Loop:
        p = self.pixel
        inputs = [Stream(math.prod(size), same) for size, same in zip(self.sizes, repeated, strict=True)]
        if not wanted:
            return compiled(lower(p.program, inputs, [p.value], self.dtype, truth=p.unit), len(inputs) + 1)
        outputs = [slope for slope, want in zip(p.slopes, wanted, strict=True) if want]
        inputs.append(Stream(p.channels))
        return compiled(lower(p.program, inputs, outputs, self.dtype), len(inputs) + len(outputs))

    def _rows(self, arrays: Sequence[Tensor], lead: tuple[int, ...]) -> tuple[list[Tensor], tuple[bool, ...]]:
        """The arrays in one piece each, and which of them are the same for all pixels."""
        repeated = tuple(array.numel() == math.prod(size) for array, size in zip(arrays, self.sizes, strict=True))
        rows = [
            (array if same else array.expand(*lead, *size)).contiguous()
            for array, same, size in zip(arrays, repeated, self.sizes, strict=True)
        ]
        return rows, repeated

    def _run(
        self, loop: Loop, rows: Sequence[Tensor], repeated: Sequence[bool], results: Sequence[Tensor], pixels: int
    ) -> int:
        if pixels == 0:
            return 0
        bytes_a_pixel = [0 if same else row.nbytes // pixels for row, same in zip(rows, repeated, strict=True)]
        bytes_a_pixel += [result.nbytes // pixels for result in results]
        starts = [array.data_ptr() for array in (*rows, *results)]
        threads = min(torch.get_num_threads(), -(-pixels // _PIXELS_A_THREAD))
        if threads == 1:
            return loop(*starts, pixels)
        share = -(-pixels // (threads * _WHOLE)) * _WHOLE

        def part(first: int) -> int:
            addresses = (start + first * step for start, step in zip(starts, bytes_a_pixel, strict=True))
            return loop(*addresses, min(share, pixels - first))

        own, *others = range(0, pixels, share)
        waiting = [_threads(os.getpid()).submit(part, first) for first in others]
        return part(own) + sum(future.result() for future in waiting)


def common_shape(shapes: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """What shapes broadcast to; raises RuntimeError where they do not. Mostly they are one, which is soon seen."""
    first = tuple(shapes[0])
    return first if all(tuple(shape) == first for shape in shapes) else tuple(torch.broadcast_shapes(*shapes))


@cache
def _threads(process: int) -> ThreadPoolExecutor:
    """Threads of a process of their own: those of a parent do not survive a fork. None of them waits for another."""
    return ThreadPoolExecutor(os.cpu_count(), thread_name_prefix=f"torchbrdf-{process}")
