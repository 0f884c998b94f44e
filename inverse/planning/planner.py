"""Which effects a scene calls for, measured on a sample of its own pixels."""

import math
import time
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import torch
from torch import Tensor

from inverse.planning.bias import RadianceDifference, SigmaBias
from inverse.planning.options import FOOTPRINT, everything, scene_options
from inverse.planning.pilot import stratified_sample
from inverse.planning.plans import Effect, Plan
from inverse.planning.sampling_detail import sampling_options
from inverse.scene import Scene
from inverse.transport import render
from torchbrdf import BRDF, EFFECTS, is_per_texel, simulated, trainable


def plan(
    scene: Scene,
    model: BRDF,
    tolerance: float,
    *,
    of: str = "radiance",
    safety: float = 2.0,
    pixels: int = 400,
    seed: int = 0,
) -> Plan:
    """What to simulate of a scene and a material so that the result changes by less than a tolerance.

    What geometry rules out costs nothing. Everything else is tried on a stratified sample of the scene's pixels: each
    effect left out alone, which gives its size, and then together, from the largest saving to the smallest and for the
    material from the cheapest rung upward, as long as all that is left out, times `safety`, stays within the tolerance.

    Args:
        scene: geometry, lights and camera; which effects it has switched on does not matter.
        model: the material at about the values it will have. Parameters per texel are refused.
        tolerance: of="radiance": of any pixel, as a share of the peak radiance. of="sigma": of the sigma that a fit
            finds, as a share of its standard error.
        safety: factor between what the sample shows and what is promised.
        pixels: size of the sample.
        seed: of the sample.
    Returns: Plan, whose `render` and `fit` follow it.
    Raises: ValueError outside these domains, for a scene without light, and of="sigma" without noise or sigma.
    """
    _check(tolerance, of, safety, pixels, model)
    full = everything(scene)
    sample, chosen, stands_for = stratified_sample(full, pixels, seed, extremes=of == "radiance")
    watch = _Watch(sample, model, chosen)
    reference = watch.values(sample, model)
    if of == "radiance":
        measure = RadianceDifference(reference, tolerance)
    else:
        measure = SigmaBias(reference, tolerance, scene=sample, model=model, pixels=chosen, stands_for=stands_for)
    budget = measure.limit / safety

    entries = list(scene_options(full))
    absent = {entry.effect: entry.absent for entry in entries if entry.absent is not None}
    present = [entry for entry in entries if entry.absent is None]
    alone = {k.effect: watch.alone(measure, k.choice, k.apply(sample), model) for k in present}
    for option in (k for group in model.stand_ins().values() for k in group):
        tried = watch.alone(measure, option.choice, sample, option.model, option.renamed)
        alone |= {name: tried for name in option.skips if name not in alone or tried.size < alone[name].size}

    def error(scene: Scene, model: BRDF, names: Mapping[str, str]) -> float:
        return measure.size(watch.values(scene, model), scene, model, names)

    stand_in, names, done = _cheapest_material(model, lambda k, renamed: error(sample, k, renamed) <= budget)
    left = full
    for entry in sorted(present, key=lambda k: -alone[k.effect].saved):
        ways = sampling_options(left, stand_in) if entry.effect == FOOTPRINT else [(entry.choice, entry.apply)]
        for choice, apply in ways:
            if error(apply(sample), stand_in, names) <= budget:
                sample, left = apply(sample), apply(left)
                done[entry.effect] = choice
                break
    verdicts = {name: (False, f"small enough; instead: {choice}") for name, choice in done.items()}
    if FOOTPRINT in done and left.fully_sampled is not None and left.fully_sampled.any():
        verdicts[FOOTPRINT] = (True, f"in part; {done[FOOTPRINT]}")
    ruled_out = {name: Effect(name, 0.0 if k.certain else None, False, k.reason) for name, k in absent.items()}
    tried = {name: _row(name, size, verdicts.get(name), budget) for name, size in alone.items()}
    # what only a stand-in could leave out in its turn was not tried alone
    also = {name: Effect(name, None, *verdict) for name, verdict in verdicts.items() if name not in tried}
    listed = dict.fromkeys((*(entry.effect for entry in entries), *tried, *also))
    rows = [(ruled_out | tried | also)[name] for name in listed]
    return Plan(
        scene=left, model=stand_in, names=names, effects=(*rows, *_others(full, model)),
        of=of, tolerance=tolerance, limit=measure.limit, error=error(sample, stand_in, names),
        safety=safety, pilot=int(chosen.sum()),
    )  # fmt: skip


class _Tried(NamedTuple):
    """What leaving out one effect alone does: its size, the share of time it saves, what is done instead."""

    size: float
    saved: float
    choice: str


class _Watch:
    """Renders the pilot, and knows how long the reference took."""

    def __init__(self, sample: Scene, model: BRDF, pixels: Tensor):
        self.pixels = pixels
        self.values(sample, model)
        self.seconds = self._timed(sample, model)[1]

    def values(self, scene: Scene, model: BRDF) -> Tensor:
        """Radiance (image, pixel, channel)."""
        with torch.no_grad():
            return render(scene, model)[:, self.pixels]

    def alone(
        self,
        measure: RadianceDifference | SigmaBias,
        choice: str,
        scene: Scene,
        model: BRDF,
        names: Mapping[str, str] = MappingProxyType({}),
    ) -> _Tried:
        """A simpler simulation against the reference; `names`: the given model's, of parameters that have others."""
        values, seconds = self._timed(scene, model)
        return _Tried(measure.size(values, scene, model, names), max(0.0, 1 - seconds / self.seconds), choice)

    def _timed(self, scene: Scene, model: BRDF) -> tuple[Tensor, float]:
        began = time.perf_counter()
        values = self.values(scene, model)
        return values, time.perf_counter() - began


def _cheapest_material(
    model: BRDF, close: Callable[[BRDF, Mapping[str, str]], bool]
) -> tuple[BRDF, dict[str, str], dict[str, str]]:
    """The first option of each group that stays close, on top of those taken before; what was left out, and instead.

    Second, of parameters that have another name in the given model, that name.
    """
    names: dict[str, str] = {}
    skipped: dict[str, str] = {}
    tried: set[str] = set()
    while True:
        groups = {name: options for name, options in model.stand_ins().items() if name not in tried}
        if not groups:
            return model, {name: names[name] for name in trainable(model) if name in names}, skipped
        group, options = next(iter(groups.items()))
        tried.add(group)
        for option in options:
            before = {name: option.renamed.get(name, name) for name in (*option.renamed, *names)}
            given = {name: names.get(earlier, earlier) for name, earlier in before.items()}
            if close(option.model, given):
                model, names = option.model, given
                skipped |= dict.fromkeys(option.skips, option.choice)
                break


def _row(name: str, alone: _Tried, verdict: tuple[bool, str] | None, budget: float) -> Effect:
    reason = f"needed; too far off: {alone.choice}"
    if alone.size <= budget:
        reason = "small, but what is simulated brings it, or others have used up the tolerance"
    return Effect(name, alone.size, *(verdict or (True, reason)), time=alone.saved)


def _others(scene: Scene, model: BRDF) -> list[Effect]:
    """Effects that are never traded: named, so that nothing is left out silently."""
    sensor, known = scene.sensor, simulated(model, by_part=False)
    rows = [
        Effect("attached shadow", None, True, "the light's cosine: costs nothing"),
        Effect("point-spread function", None, sensor.psf_sigma > 0, "the sensor's; expose and fit apply it"),
        Effect("noise", None, sensor.read_noise > 0 or sensor.full_well is not None, "the sensor's; expose adds it"),
        Effect("quantisation", None, sensor.bits is not None, "the sensor's; expose rounds"),
        Effect("polarisation", None, False, "the light is unpolarised, and so the camera takes it to be"),
    ]
    kind = type(model).__name__
    rows += [
        Effect(name, None, False, f"nothing of it that {kind} could leave out") for name in EFFECTS if name not in known
    ]
    return rows


def _check(tolerance: float, of: str, safety: float, pixels: int, model: BRDF) -> None:
    if of not in ("radiance", "sigma"):
        raise ValueError(f'plan: of must be "radiance" or "sigma"; found {of!r}.')
    if not 0 < tolerance < math.inf:
        unit = "share of the peak radiance" if of == "radiance" else "share of sigma's standard error"
        raise ValueError(f"plan: tolerance must be positive and finite [{unit}]; found {tolerance}.")
    if not 1 <= safety < math.inf:
        raise ValueError(f"plan: safety must be at least 1 and finite; found {safety}.")
    if not isinstance(pixels, int) or pixels < 1:
        raise ValueError(f"plan: pixels must be a whole number of at least 1; found {pixels}.")
    if is_per_texel(model):
        raise ValueError("plan: the model has parameters per texel; plan with one typical material instead.")
