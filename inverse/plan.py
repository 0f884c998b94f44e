"""What is simulated and what is not, with the size of each effect, the reason, and the time it saves."""

import json
import math
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from typing import Any

from torch import Tensor

from inverse.scene import Scene
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
    """What a scene calls for. `render(scene, plan)` and `fit(scene, photographs, plan=plan)` follow it.

    Attributes:
        original: the scene that was planned for.
        scene: the same with the effects that are simulated.
        model: the stand-in that is evaluated, with parameters of its own.
        parts: of a sum, the places its parts had in the given model; () for other models.
        effects: every effect, simulated or not.
        of: "radiance" or "sigma".
        tolerance: what was asked for: a share of the peak radiance, or of the standard error of sigma.
        limit: the same in the unit of the sizes: share of the peak radiance, or radians of sigma.
        error: what the plan leaves out altogether, measured on the pilot, in that unit.
        safety: the error times this is within the limit.
        pilot: number of pixels it was measured on.
    """

    original: Scene
    scene: Scene
    model: BRDF
    parts: tuple[int, ...]
    effects: tuple[Effect, ...]
    of: str
    tolerance: float
    limit: float
    error: float
    safety: float
    pilot: int

    def simulates(self, name: str) -> bool:
        """Whether an effect is simulated; KeyError for a name the plan does not hold."""
        return {effect.name: effect.simulate for effect in self.effects}[name]

    def skipped(self) -> tuple[str, ...]:
        """Names of the effects left out."""
        return tuple(effect.name for effect in self.effects if not effect.simulate)

    def applied_to(self, scene: Scene) -> tuple[Scene, BRDF]:
        """The planned scene, with the sensor of the given one, and the model.

        Raises ValueError for another surface or other lights than were planned for; for a plan of sigma, whose limit
        is the noise's, also for another sensor.
        """
        for name in ("surface", "lights"):
            if not _same(getattr(scene, name), getattr(self.original, name)):
                raise ValueError(f"the plan was made for a scene with other {name}: plan for this scene.")
        if self.of == "sigma" and scene.sensor != self.original.sensor:
            raise ValueError(f"the plan of sigma was made for {self.original.sensor}; found {scene.sensor}.")
        return replace(self.scene, sensor=scene.sensor), self.model

    def original_name(self, name: str) -> str:
        """Of a parameter of the stand-in, its name in the model that was planned for."""
        if not self.parts or not name.startswith("parts."):
            return name
        _, place, rest = name.split(".", 2)
        return f"parts.{self.parts[int(place)]}.{rest}"

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


def _same(one: Any, other: Any) -> bool:
    """Whether surfaces, lights, or tuples of them hold the same values."""
    if one is other:
        return True
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, Tensor) and isinstance(other, Tensor):
        return one.shape == other.shape and bool(((one == other) | (one.isnan() & other.isnan())).all())
    if is_dataclass(one) and type(one) is type(other):
        # a surface's solid follows from what made its points
        names = [field.name for field in fields(one) if field.name != "solid"]
        return all(_same(getattr(one, name), getattr(other, name)) for name in names)
    return not isinstance(one, Tensor) and not isinstance(other, Tensor) and one == other


def _size(value: float, of_peak: bool) -> str:
    return f"{100 * value:.3g} %" if of_peak else f"{math.degrees(value):.3g} deg"
