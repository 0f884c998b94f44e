"""Weighted sums of models, which are models again."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import torch
from torch import Tensor, nn

from torchbrdf.brdf import BRDF, Option, total
from torchbrdf.directions import Cosines
from torchbrdf.effects import EffectOfPart, simulated
from torchbrdf.parameters import WEIGHT, Constrained, fixed, kept, paths
from torchbrdf.sampling import propose_from_parts


class WeightedSum(BRDF):
    """Sum of BRDFs with trainable positive weights (part,). Components are named `Model.part`.

    Parts are called "part 1", "part 2", ... where something may be left out, and keep these names when others are gone.
    A weight and the albedo of its part say the same thing: hold one of them `fixed` before fitting. The
    weights of a sum made by + and * are trainable; `WeightedSum(parts, fixed([...]))` or `sum.weights = fixed(...)`
    holds them.
    Whether the sum reflects more than it receives is the weights' business: nothing bounds their sum.
    Raises ValueError for a weight that is not positive and finite, or counts that differ; TypeError
    for parts that are not BRDFs.
    """

    weights: Constrained = Constrained(WEIGHT)

    def __init__(self, parts: Sequence[BRDF], weights: Sequence[Tensor | float] | Tensor | fixed):
        super().__init__()
        held = isinstance(weights, fixed)
        if isinstance(weights, fixed):
            weights = torch.as_tensor(weights.value)
        if not parts or len(parts) != len(weights):
            raise ValueError(
                f"WeightedSum needs one weight for each of at least one part; found {len(parts)} parts "
                f"and {len(weights)} weights."
            )
        for part in parts:
            if not isinstance(part, BRDF):
                raise TypeError(f"WeightedSum adds BRDFs; found {type(part).__name__}.")
        self.parts = nn.ModuleList(parts)
        self._labels = [f"part {position}" for position in range(1, len(parts) + 1)]
        values = [torch.as_tensor(w, dtype=_dtype_of(parts)).detach() for w in weights]
        self.weights = fixed(torch.stack(values)) if held else torch.stack(values)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        components: dict[str, Tensor] = {}
        for position, (part, weight) in enumerate(zip(self.parts, self.weights, strict=True)):
            for name, value in part.evaluate_components(cosines).items():  # pyright: ignore[reportCallIssue]
                label = f"{type(part).__name__}.{name}"
                components[f"{label}#{position}" if label in components else label] = weight * value
        return components

    @property
    def anisotropic(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return any(part.anisotropic for part in self._brdfs())

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        return total(
            [w * p.directional_albedo(cos_view, nodes=nodes) for p, w in zip(self._brdfs(), self.weights, strict=True)]
        )

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        return propose_from_parts(self._brdfs(), self._shares(), view, u)

    def density(self, cosines: Cosines) -> Tensor:
        return total([p * part.density(cosines) for part, p in zip(self._brdfs(), self._shares(), strict=True)])

    def delta_reflectance(self, cosines: Cosines) -> Tensor | None:
        weighted = [(w, part.delta_reflectance(cosines)) for part, w in zip(self._brdfs(), self.weights, strict=True)]
        mirrors = [w * r for w, r in weighted if r is not None]
        return total(mirrors) if mirrors else None

    def delta_probability(self, cosines: Cosines) -> Tensor:
        return total(
            [p * part.delta_probability(cosines) for part, p in zip(self._brdfs(), self._shares(), strict=True)]
        )

    def stand_ins(self) -> dict[str, list[Option]]:
        """What each part could do without, then, where several are left, each part itself."""
        return dict((*self._simpler(), *self._fewer()))

    def _simpler(self) -> Iterator[tuple[str, list[Option]]]:
        for position, (part, label) in enumerate(zip(self._brdfs(), self._labels, strict=True)):
            for group, options in part.stand_ins().items():
                yield f"{group} of {label}", [self._with(position, label, option) for option in options]

    def _fewer(self) -> Iterator[tuple[str, list[Option]]]:
        parts = self._brdfs()
        for position, (part, label) in enumerate(zip(parts, self._labels, strict=True)):
            if len(parts) == 1:
                return
            left = [place for place in range(len(parts)) if place != position]
            renamed = {
                f"parts.{here}.{path}": f"parts.{place}.{path}"
                for here, place in enumerate(left)
                if here != place
                for path in paths(parts[place])
            }
            skips = (label, *(EffectOfPart(effect, label) for effect in simulated(part)))
            model = self._of([parts[place] for place in left], left)
            yield label, [Option(f"{type(part).__name__} left out", skips, model, renamed)]

    def _with(self, position: int, label: str, option: Option) -> Option:
        """A part replaced by a stand-in of it."""
        parts = [*self._brdfs()]
        parts[position] = option.model
        prefix = f"parts.{position}."
        return replace(
            option,
            skips=tuple(EffectOfPart(effect, label) for effect in option.skips),
            model=self._of(parts, list(range(len(parts)))),
            renamed={prefix + path: prefix + before for path, before in option.renamed.items()},
        )

    def _of(self, parts: list[BRDF], places: list[int]) -> "WeightedSum":
        """A sum with the weights and the labels that this one has at some places."""
        weights = self.weights.detach()[places]
        result = WeightedSum(parts, fixed(weights) if isinstance(kept(self, "weights"), fixed) else weights)
        result._labels = [self._labels[place] for place in places]
        return result

    def _brdfs(self) -> list[BRDF]:
        return list(self.parts)  # pyright: ignore[reportReturnType]

    def _shares(self) -> Tensor:
        return (self.weights / self.weights.sum()).detach()

    def __mul__(self, weight: Tensor | float) -> "WeightedSum":
        return WeightedSum(list(self.parts), self.weights.detach() * weight)  # pyright: ignore[reportArgumentType]

    __rmul__ = __mul__

    def __add__(self, other: BRDF) -> "WeightedSum":
        parts, weights = [*self.parts], [*self.weights.detach()]
        if isinstance(other, WeightedSum):
            return WeightedSum([*parts, *other.parts], [*weights, *other.weights.detach()])  # pyright: ignore
        return WeightedSum([*parts, other], [*weights, 1.0])  # pyright: ignore[reportArgumentType]


def _dtype_of(parts: Sequence[BRDF]) -> torch.dtype:
    stored = [t for part in parts for t in (*part.parameters(), *part.buffers())]
    return stored[0].dtype if stored else torch.get_default_dtype()
