"""Small networks of smooth functions, in which fitted models keep what has no closed form."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor

from torchbrdf._constants import constant

# Bytes of one field worked on at a time: a dozen of them stay in a core's cache.
BYTES_AT_A_TIME = 131072


class Network(NamedTuple):
    """o = W3 [h(W2 [h(W1 x; b1)]; b2)] + b3 with h(u; b) = a(u + b) - a(b), a(u) = u/sqrt(1 + u^2).

    At x = 0 nothing is left but b3, to the last digit.
    """

    first: Tensor  # (hidden, features)
    first_bias: Tensor  # (hidden, 1)
    second: Tensor
    second_bias: Tensor
    last: Tensor  # (outputs, hidden)
    last_bias: Tensor  # (outputs, 1)

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> "Network":
        """From lists of rows by name."""
        return cls(*(torch.tensor(stored[name], dtype=torch.float64) for name in cls._fields))

    def outputs(self, features: Tensor) -> Tensor:
        """o (outputs, n) of features (features, n), in their precision."""
        w1, b1, w2, b2, w3, b3 = (t.to(features) for t in self)
        hidden = bounded(_affine(b1, w1, features)) - bounded(b1)
        hidden = bounded(_affine(b2, w2, hidden)) - bounded(b2)
        return _affine(b3, w3, hidden)


def bounded(u: Tensor) -> Tensor:
    """a(u) = u/sqrt(1 + u^2), in (-1, 1)."""
    return u * torch.rsqrt(1 + u * u)


def _affine(bias: Tensor, matrix: Tensor, columns: Tensor) -> Tensor:
    """bias + matrix @ columns, with all digits whatever users allow their matrix products to lose."""
    if not _products_are_shortened(columns.device.type):
        return torch.addmm(bias, matrix, columns)
    total = bias
    for weights, row in zip(matrix.unbind(1), columns.unbind(0), strict=True):
        total = total + weights[:, None] * row
    return total


@constant
def _products_are_shortened(device: str) -> bool:
    """Whether a matrix product may be made in half precision or in TF32."""
    return torch.get_float32_matmul_precision() != "highest" or torch.is_autocast_enabled(device)


def pixel_by_pixel(compute: Callable[..., Sequence[Tensor]], *given: Tensor) -> list[Tensor]:
    """What `compute` makes of numbers of one pixel: all broadcast to (...), a piece that fits the cache at a time."""
    shape = torch.broadcast_shapes(*(t.shape for t in given))
    # Spread over the pixels first: the derivative by a single sigma is then one sum over the image.
    rows = [t.expand(shape).reshape(-1) for t in given]
    step = BYTES_AT_A_TIME // rows[0].element_size()
    if torch.compiler.is_compiling() or shape.numel() <= step:
        results = compute(*rows)
    else:
        pieces = zip(*(row.split(step) for row in rows), strict=True)
        results = [torch.cat(parts) for parts in zip(*(compute(*piece) for piece in pieces), strict=True)]
    return [result.reshape(shape) for result in results]
