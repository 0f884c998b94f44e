"""What accuracy costs: each rung of the Oren-Nayar ladder against its reference, in error, time and memory.

Lambert < qualitative < functional < closed-form slopes < fitted < exact slopes < exact with all bounces
"""

import json
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace

import torch
from torch import Tensor

from torchbrdf.accuracy.references import reference
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.linear import PIXELS_AT_A_TIME, ImageBRDF, LinearBRDF
from torchbrdf.models.oren_nayar.interpolated import InterpolatedRoughSurface
from torchbrdf.models.oren_nayar.qualitative import QualitativeOrenNayar
from torchbrdf.models.oren_nayar.rough_surface import ClosedFormRoughSurface, RoughSurface

Build = Callable[[Tensor, Tensor], BRDF]


@dataclass(frozen=True)
class Rung:
    """A model of the ladder: how to build it from albedo and sigma, and how many points it is timed on."""

    name: str
    build: Build
    points: int = 1 << 17


def rungs_of(name: str, build: Build) -> tuple[Rung, ...]:
    """The ladder of a model of one albedo and one sigma: its stand-ins, as it states them, and itself on top.

    Args:
        name: of the model itself.
        build: makes the model from albedo [-] and sigma [rad], both scalars.
    """
    sample = build(torch.tensor(0.5), torch.tensor(0.3))
    groups = {group: [option.choice for option in options] for group, options in sample.stand_ins().items()}

    def stand_in(group: str, place: int) -> Build:
        return lambda albedo, sigma: build(albedo, sigma).stand_ins()[group][place].model

    simpler = [
        _rung(choice, stand_in(group, place))
        for group, choices in groups.items()
        for place, choice in enumerate(choices)
    ]
    return (*simpler, _rung(name, build))


def _rung(name: str, build: Build) -> Rung:
    """Models of many images are timed on as many points as they take at a time."""
    many = isinstance(build(torch.tensor(0.5), torch.tensor(0.3)), ImageBRDF)
    return Rung(name, build, PIXELS_AT_A_TIME) if many else Rung(name, build)


def _of_the_paper() -> tuple[Rung, ...]:
    """The ladder of the exact model of 48 slopes; beside two of its rungs, what is simulated by other formulas."""
    exact = rungs_of(
        "exact, K = 48, all bounces",
        lambda albedo, sigma: RoughSurface(albedo=albedo, sigma=sigma, nodes=48, bounces="all"),
    )
    beside: dict[str, tuple[str, Build]] = {
        "qualitative (0.33)": (
            "qualitative (0.57)",
            lambda albedo, sigma: QualitativeOrenNayar(albedo=albedo, sigma=sigma, a_constant=0.57),
        ),
        "functional": (
            "closed form, K = 16",
            lambda albedo, sigma: ClosedFormRoughSurface(albedo=albedo, sigma=sigma),
        ),
        "fast, all bounces": (
            "interpolated, all bounces",
            lambda albedo, sigma: InterpolatedRoughSurface(albedo=albedo, sigma=sigma),
        ),
    }
    ladder: list[Rung] = []
    for rung in exact:
        ladder.append(rung)
        if rung.name in beside:
            ladder.append(_rung(*beside[rung.name]))
    return tuple(ladder)


RUNGS = _of_the_paper()


@dataclass(frozen=True)
class Row:
    """One rung, measured. Errors are relative to the reference; times are ratios to Lambert in the same run."""

    name: str
    max_error: float
    rms_error: float
    forward: float
    backward: float
    saved_bytes: float

    def dominates(self, other: "Row") -> bool:
        """Whether this rung is at least as accurate and as cheap, and better in one."""
        pairs = ((self.rms_error, other.rms_error), (self.forward, other.forward))
        return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


@dataclass(frozen=True)
class Ladder:
    """Rows from the cheapest to the top."""

    rows: tuple[Row, ...]

    def pareto(self) -> tuple[Row, ...]:
        """The rungs that no other rung beats in both rms error and forward time."""
        return tuple(row for row in self.rows if not any(other.dominates(row) for other in self.rows))

    def to_json(self) -> str:
        """The rows as a JSON list."""
        return json.dumps([asdict(row) for row in self.rows], indent=2)

    def to_markdown(self) -> str:
        """The rows as a table; rungs on the Pareto front are bold."""
        front = {row.name for row in self.pareto()}
        lines = [
            "| rung | max error | rms error | forward | forward + backward | saved bytes a point |",
            "|---|---|---|---|---|---|",
        ]
        for row in self.rows:
            name = f"**{row.name}**" if row.name in front else row.name
            lines.append(
                f"| {name} | {row.max_error:.2%} | {row.rms_error:.3%} | {row.forward:.1f} x | {row.backward:.1f} x "
                f"| {row.saved_bytes:.0f} |"
            )
        return "\n".join(lines)


def ladder(
    sigma: float | Sequence[float],
    rho: float | Sequence[float],
    cosines: Cosines,
    *,
    rungs: Sequence[Rung] = RUNGS,
    against: Build = reference,
    repeats: int = 9,
    compiled: bool = False,
) -> Ladder:
    """Error and cost of every rung for materials and a scene's own directions.

    Args:
        sigma: roughness, or several. [rad]
        rho: facet albedo, or several; every sigma is taken with every rho. [-]
        cosines: of the directions to judge by, (...); those below the horizon do not count.
        rungs: models to compare; the first is the unit of time. `rungs_of` lists those of a model of your own.
        against: builds what they are compared with; `reference_error` says how far `reference` is from `converged`.
        repeats: timings of each, interleaved; the median counts.
        compiled: time the models under torch.compile.
    Returns: Ladder. Errors are computed in float64, times in the dtype of the cosines, saved bytes in eager mode.
    Raises: ValueError when no direction is above the horizon.
    """
    kept = cosines.above_horizon
    if not kept.any():
        raise ValueError("ladder needs directions above the horizon; there are none.")
    products = [c[kept] for c in (cosines.light, cosines.view, cosines.phase)]
    sigmas = [sigma] if isinstance(sigma, float | int) else list(sigma)
    rhos = [rho] if isinstance(rho, float | int) else list(rho)
    wide = Cosines.from_products(*(c.double() for c in products))
    errors = relative_errors(rungs, sigmas, rhos, wide, against=against)
    costs = cost(rungs, sigmas[0], rhos[0], Cosines.from_products(*products), repeats=repeats, compiled=compiled)
    return Ladder(tuple(Row(rung.name, *errors[rung.name], *costs[rung.name]) for rung in rungs))


def relative_errors(
    rungs: Sequence[Rung],
    sigmas: Sequence[float],
    rhos: Sequence[float],
    cosines: Cosines,
    *,
    against: Build = reference,
) -> dict[str, tuple[float, float]]:
    """By name: max and rms relative error over all directions (...) and every sigma with every rho."""
    squares: dict[str, list[float]] = {rung.name: [] for rung in rungs}
    largest: dict[str, list[float]] = {rung.name: [] for rung in rungs}
    with torch.no_grad():
        images: dict[str, Tensor] = {}  # of the linear models: they serve every material

        def evaluate(name: str, model: BRDF) -> Tensor:
            if not isinstance(model, LinearBRDF):
                return model.evaluate(cosines)[..., 0]
            if name not in images:
                images[name] = model.basis(cosines)
            return (images[name] * model.coefficients()[0]).sum(-1)

        for sigma in sigmas:
            for rho in rhos:
                material = [torch.tensor(k, dtype=cosines.light.dtype) for k in (rho, sigma)]
                truth = evaluate("", against(*material))
                for rung in rungs:
                    error = evaluate(rung.name, rung.build(*material)) / truth - 1
                    largest[rung.name].append(error.abs().max().item())
                    squares[rung.name].append(error.square().mean().item())
    return {name: (max(largest[name]), statistics.fmean(squares[name]) ** 0.5) for name in largest}


def cost(
    rungs: Sequence[Rung], sigma: float, rho: float, cosines: Cosines, *, repeats: int, compiled: bool
) -> dict[str, tuple[float, float, float]]:
    """By name: forward and forward + backward time a point relative to the first rung, and saved bytes a point."""
    forward, backward, saved = {}, {}, {}
    for rung in rungs:
        count = min(rung.points, max(cosines.light.numel(), 1 << 10))
        draw = torch.arange(count, device=cosines.light.device) % cosines.light.numel()
        products = [c.flatten()[draw].requires_grad_() for c in (cosines.light, cosines.view, cosines.phase)]
        model = rung.build(*(torch.tensor(k, dtype=products[0].dtype) for k in (rho, sigma))).to(products[0].device)

        def evaluate(model=model, products=products):
            return model.evaluate(Cosines.from_products(*products))

        run = torch.compile(evaluate, fullgraph=True) if compiled else evaluate
        forward[rung.name] = (torch.no_grad()(run), count)
        backward[rung.name] = (lambda run=run: run().sum().backward(), count)
        saved[rung.name] = _saved_bytes(evaluate) / count
    # all rungs share the code of `evaluate`: with and without gradients, each needs its own compilation
    with torch._dynamo.config.patch(recompile_limit=4 * len(rungs)) if compiled else nullcontext():  # pyright: ignore
        seconds = [interleaved_medians(calls, repeats) for calls in (forward, backward)]
    unit = [medians[rungs[0].name] for medians in seconds]
    return {
        rung.name: (seconds[0][rung.name] / unit[0], seconds[1][rung.name] / unit[1], saved[rung.name])
        for rung in rungs
    }


def forward_ratios(models: Mapping[str, BRDF], cosines: Cosines, *, repeats: int = 9) -> dict[str, float]:
    """By name: forward time relative to the first model, eager, for any models.

    Args:
        cosines: of the points to time on (...), with what the models read: `Cosines.of` keeps the vectors, and a
            tangent for anisotropic ones.
        repeats: timings of each, interleaved; the median counts.
    On a CPU the time is that of the processor, all threads together, which other programs do not lengthen.
    """
    clock = time.process_time if cosines.light.device.type == "cpu" else time.perf_counter
    products = cosines.light, cosines.view, cosines.phase

    def call(model: BRDF) -> Tensor:  # what the cosines compute on demand is part of the cost
        fresh = Cosines.from_products(*products)
        return model.evaluate(replace(fresh, vectors=cosines.vectors, tangent=cosines.tangent))

    with torch.no_grad():
        seconds = interleaved_medians({name: (lambda m=m: call(m), 1) for name, m in models.items()}, repeats, clock)
    unit = next(iter(seconds.values()))
    return {name: second / unit for name, second in seconds.items()}


def interleaved_medians(
    calls: dict[str, tuple[Callable[[], object], int]], repeats: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """Median seconds a point of each call; they take turns, so that a slower minute slows them all."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call, _ in calls.values():
        call()
    for _ in range(repeats):
        for name, (call, count) in calls.items():
            call()  # untimed: the model before left caches and heap in its own state
            _wait()
            began = clock()
            call()
            _wait()
            times[name].append((clock() - began) / count)
    return {name: statistics.median(taken) for name, taken in times.items()}


def _wait() -> None:
    if torch.cuda.is_available():
        torch.cuda.synchronize()


def _saved_bytes(run: Callable[[], Tensor]) -> int:
    """Bytes autograd keeps between forward and backward, each storage counted once."""
    kept: dict[int, int] = {}

    def pack(tensor: Tensor) -> Tensor:
        storage = tensor.untyped_storage()
        kept[storage.data_ptr()] = storage.nbytes()
        return tensor

    with torch.autograd.graph.saved_tensors_hooks(pack, lambda tensor: tensor):
        result = run()
    del result
    return sum(kept.values())
