"""The arithmetic of one pixel as a straight line of scalar steps, each written once."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

COMPARISONS = ("lt", "le", "gt", "ge", "eq", "ne")
TRUTHS = frozenset((*COMPARISONS, "and", "or", "not"))


class Step(NamedTuple):
    """One operation on the results of earlier steps, which are known by their places.

    Attributes:
        operation: of `lowering.ARITHMETIC` or "constant", "input".
        arguments: places of steps; of a constant its value, of an input its number.
    """

    operation: str
    arguments: tuple[int, ...] | tuple[float]


@dataclass
class Program:
    """Steps of one pixel. A step that is there already is not written again."""

    steps: list[Step] = field(default_factory=list)
    places: dict[Step, int] = field(default_factory=dict)

    def append(self, operation: str, *arguments: int) -> int:
        return self._place(Step(operation, arguments))

    def constant(self, value: float) -> int:
        # the text tells 0 from -0 and equals itself for NaN, which numbers do not
        step = Step("constant", (value,))
        key = Step(f"constant {value!r}", ())
        if key not in self.places:
            self.places[key] = len(self.steps)
            self.steps.append(step)
        return self.places[key]

    def add(self, a: int, b: int) -> int:
        """a + b; a sum with 0 is the other term (derivatives are full of them)."""
        if self.is_constant(a, 0.0):
            return b
        return a if self.is_constant(b, 0.0) else self._folded("add", lambda x, y: x + y, a, b)

    def subtract(self, a: int, b: int) -> int:
        return a if self.is_constant(b, 0.0) else self.append("subtract", a, b)

    def multiply(self, a: int, b: int) -> int:
        if self.is_constant(a, 1.0):
            return b
        return a if self.is_constant(b, 1.0) else self._folded("multiply", lambda x, y: x * y, a, b)

    def divide(self, a: int, b: int) -> int:
        """a times 1/b: one division serves all that is divided by b, of which a derivative has three for each quotient.

        One rounding more than a quotient has. 1/b overflows for |b| below the smallest normal number, which no guard
        of `_numerics` lets below a fraction.
        """
        return self.multiply(a, self.reciprocal(b))

    def reciprocal(self, a: int) -> int:
        step = self.steps[a]
        if step.operation == "constant" and step.arguments[0]:
            return self.constant(1 / step.arguments[0])
        return self.append("reciprocal", a)

    def negate(self, a: int) -> int:
        return self.append("negate", a)

    def select(self, condition: int, a: int, b: int) -> int:
        return a if a == b else self.append("select", condition, a, b)

    def total(self, terms: Iterable[int]) -> int:
        first, *others = terms
        for term in others:
            first = self.add(first, term)
        return first

    def is_truth(self, place: int) -> bool:
        """Whether a step's result is a truth value, no number."""
        return self.steps[place].operation in TRUTHS

    def is_constant(self, place: int, value: float) -> bool:
        step = self.steps[place]
        return step.operation == "constant" and step.arguments[0] == value

    def needed_for(self, results: Iterable[int]) -> list[int]:
        """Places of the steps that the results depend on, in order."""
        needed: set[int] = set()
        waiting = list(results)
        while waiting:
            place = waiting.pop()
            if place in needed:
                continue
            needed.add(place)
            step = self.steps[place]
            if step.operation not in {"constant", "input"}:
                waiting.extend(int(k) for k in step.arguments)
        return sorted(needed)

    def _folded(self, operation: str, apply: Callable[[float, float], float], a: int, b: int) -> int:
        first, second = self.steps[a], self.steps[b]
        if first.operation == second.operation == "constant":
            return self.constant(apply(first.arguments[0], second.arguments[0]))
        return self.append(operation, a, b)

    def _place(self, step: Step) -> int:
        if step not in self.places:
            self.places[step] = len(self.steps)
            self.steps.append(step)
        return self.places[step]
