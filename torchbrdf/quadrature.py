"""Quadrature rules as constants: computed once, and constants to torch.compile too."""

from functools import lru_cache

from numpy.polynomial.legendre import leggauss
from torch import Tensor

from torchbrdf._constants import constant


@constant
@lru_cache(maxsize=64)
def gauss_legendre_rule(order: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Gauss-Legendre nodes and weights on (0, 1), `order` numbers each."""
    nodes, weights = leggauss(order)
    return tuple((0.5 * (nodes + 1)).tolist()), tuple((0.5 * weights).tolist())


def gauss_legendre(order: int, like: Tensor) -> tuple[Tensor, Tensor]:
    """Gauss-Legendre nodes and weights on (0, 1), each (order,), in the dtype and on the device of `like`."""
    nodes, weights = gauss_legendre_rule(order)
    return like.new_tensor(nodes), like.new_tensor(weights)
