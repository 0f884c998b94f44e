"""Families of models that simulate more and more of the same material, and the stand-ins that follow.

Each member lists in its own file the members up to itself: those that the next simpler one lists, and its own
settings. So the imports go from the exact to the simple, and a ladder is written down once.
"""

from collections.abc import Sequence
from typing import NamedTuple

from torchbrdf.brdf import BRDF, Option
from torchbrdf.models.lambert import Lambert
from torchbrdf.parameters import Parametric, kept

RUNG = "rung"


class Member(NamedTuple):
    """One model of a family, the names of the effects it simulates, and what it is called."""

    choice: str
    simulates: tuple[str, ...]
    model: BRDF


def lambert(model: Parametric) -> Member:
    """The bottom of every ladder: the same albedo, smooth."""
    return Member("Lambert", (), Lambert(albedo=kept(model, "albedo")))


def stand_ins(members: Sequence[Member]) -> dict[str, list[Option]]:
    """Members that simulate less than the last one does, which is the model itself: what they leave out of it."""
    *simpler, own = members
    options = [
        Option(choice, tuple(effect for effect in own.simulates if effect not in simulates), model)
        for choice, simulates, model in simpler
        if set(simulates) < set(own.simulates)
    ]
    return {RUNG: options} if options else {}
