"""What is simulated and what is not, with the size of each effect, the reason, and the time it saves."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from torch import Tensor

from inverse.fitting import FitResult, fit
from inverse.scene import Scene
from inverse.transport import render
from torchbrdf import BRDF


@dataclass(frozen=True)
class Effect:
    """One effect of a scene or a material.

    Attributes:
        name: what it is.
        size: how much leaving it out alone changes the result, in the plan's unit; None where that was not measured.
        simulate: whether the plan keeps it.
        reason: why, in words.
        time: share of the everything-on time that leaving it out alone saves on the pilot; None where not measured.
    """

    name: str
    size: float | None
    simulate: bool
    reason: str
    time: float | None = None


@dataclass(frozen=True)
class Plan:
    """What a scene calls for. `render` and `fit` follow it.

    Attributes:
        scene: the scene with the effects that are simulated.
        model: the stand-in that is evaluated, with parameters of its own.
        names: of parameters of the stand-in, the name in the given model where it has another there.
        effects: every effect, simulated or not.
        of: "radiance" or "sigma".
        tolerance: what was asked for: a share of the peak radiance, or of the standard error of sigma.
        limit: the same in the unit of the sizes: share of the peak radiance, or radians of sigma.
        error: what the plan leaves out altogether, measured on the pilot, in that unit.
        safety: the error times this is within the limit.
        pilot: number of pixels it was measured on.
    """

    scene: Scene
    model: BRDF
    names: Mapping[str, str]
    effects: tuple[Effect, ...]
    of: str
    tolerance: float
    limit: float
    error: float
    safety: float
    pilot: int

    def render(self) -> Tensor:
        """Radiance images (image, rows, columns, channel), as `inverse.render` makes them, of what is simulated."""
        return render(self.scene, self.model)

    def fit(self, photographs: Tensor, model: BRDF | None = None, **options: Any) -> "PlannedFit":
        """`inverse.fit` of the stand-in, or of another model, to photographs of the planned scene.

        Args:
            photographs: (image, rows, columns, channel), as the scene's sensor records them.
            model: start values; by default the stand-in's own.
            options: further arguments of `inverse.fit`.
        Returns: PlannedFit. The parameters of a sum's parts keep the names they had before parts were left out.
        Raises: what `inverse.fit` raises.
        """
        result = fit(self.scene, photographs, self.model if model is None else model, **options)
        return PlannedFit(**vars(result if model is not None else result.renamed(self.names)), plan=self)

    def simulates(self, name: str) -> bool:
        """Whether an effect is simulated; KeyError for a name the plan does not hold."""
        return {effect.name: effect.simulate for effect in self.effects}[name]

    def skipped(self) -> tuple[str, ...]:
        """Names of the effects left out."""
        return tuple(effect.name for effect in self.effects if not effect.simulate)

    def to_json(self) -> str:
        """The table and its figures, without the scene and the model."""
        figures = {name: getattr(self, name) for name in ("of", "tolerance", "limit", "error", "safety", "pilot")}
        return json.dumps(figures | {"effects": [asdict(effect) for effect in self.effects]}, indent=2, allow_nan=False)

    def __str__(self) -> str:
        of_peak = self.of == "radiance"
        rows = [("effect", "size", "", "time saved", "why")]
        for effect in self.effects:
            size = "" if effect.size is None else _size(effect.size, of_peak)
            time = "" if effect.time is None else f"{effect.time:.0%}"
            rows.append((effect.name, size, "simulate" if effect.simulate else "skip", time, effect.reason))
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        lines = ["  ".join((*(cell.ljust(w) for cell, w in zip(row, widths, strict=False)), row[4])) for row in rows]
        lines.append(
            f"left out altogether: {_size(self.error, of_peak)}, asked for: at most {_size(self.limit, of_peak)} "
            f"(safety factor {self.safety:g}, {self.pilot} pixels tried)"
        )
        return "\n".join(lines)


@dataclass(frozen=True)
class PlannedFit(FitResult):
    """What `Plan.fit` returns: a FitResult, and the plan that says what was simulated and what was not."""

    plan: Plan


def _size(value: float, of_peak: bool) -> str:
    return f"{100 * value:.3g} %" if of_peak else f"{math.degrees(value):.3g} deg"
