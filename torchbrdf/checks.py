"""Whether what is given is looked at: directions of unit length, parameters in their domains, shapes that fit.

A look costs little on an image and more than the answer on a single direction. Inner loops whose inputs are known to be
right leave it out with `unchecked()`. It is a context and not an argument, because a call goes through many hands (a
renderer, a sum, a model, a formula) and each would have to pass the argument on.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import torch

_looking = ContextVar("looking", default=True)


@contextmanager
def unchecked() -> Iterator[None]:
    """Takes directions and parameters on trust for as long as the context lasts; changes no value and no derivative.

    For inputs that are known to be right. What a wrong one leads to is then anything: NaN, an error of torch's, a
    plausible number. Holds for the thread (and the asynchronous task) that entered it alone, nests, works as a
    decorator, and is over when the block is left, by an exception too. Constructors and assignments of parameters
    check all the same. Inside a compiled function (`torch.compile`) nothing is looked at anyway.

    >>> from torchbrdf import Lambert, unchecked
    >>> brdf, up = Lambert(albedo=0.5), torch.tensor([0.0, 0.0, 1.0])
    >>> with unchecked():
    ...     value = brdf(up, up, up)
    """
    with _set(False):
        yield


@contextmanager
def checked() -> Iterator[None]:
    """Looks all the same, also inside `unchecked()`: for what is stored and outlives it."""
    with _set(True):
        yield


@contextmanager
def _set(looking: bool) -> Iterator[None]:
    if torch.compiler.is_compiling():  # which cannot trace a context variable, and never looks
        yield
        return
    before = _looking.set(looking)
    try:
        yield
    finally:
        _looking.reset(before)


def taken_on_trust() -> bool:
    """Whether inputs are not to be looked at: inside `unchecked()`, and where tensors carry no numbers (compile)."""
    return torch.compiler.is_compiling() or not _looking.get()
