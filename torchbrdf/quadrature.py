"""Quadrature rules as constants: computed once, and constants to torch.compile too."""

from functools import lru_cache

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor


@lru_cache(maxsize=64)
def gauss_legendre_rule(order: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Gauss-Legendre nodes and weights on (0, 1), `order` numbers each."""
    nodes, weights = leggauss(order)
    return tuple((0.5 * (nodes + 1)).tolist()), tuple((0.5 * weights).tolist())


@torch.compiler.assume_constant_result
def _constant_rule(order: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return gauss_legendre_rule(order)


def gauss_legendre(order: int, like: Tensor) -> tuple[Tensor, Tensor]:
    """Gauss-Legendre nodes and weights on (0, 1), each (order,), in the dtype and on the device of `like`."""
    nodes, weights = _constant_rule(order)
    return like.new_tensor(nodes), like.new_tensor(weights)
