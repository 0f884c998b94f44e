"""Recover the parameters of a BRDF from photographs of a known shape under known lights."""

import copy
import math
import time
from dataclasses import replace

import torch
from torch import Tensor

from inverse.fitting.gram import condensed
from inverse.fitting.identifiability import Covariance, judge
from inverse.fitting.levenberg_marquardt import Residuals, Solution, minimise
from inverse.fitting.misfit import warnings_of
from inverse.fitting.prediction import predictor
from inverse.fitting.result import FitResult
from inverse.fitting.selection import checked, clear_of_clipping, usable_samples
from inverse.fitting.unknowns import Unknowns
from inverse.scene import Scene
from torchbrdf import BRDF

# Each selection of samples follows the fit before it; what the second changes is already small.
_SELECTIONS = 3


class FitError(RuntimeError):
    """The fit diverged. `result` holds what was reached."""

    def __init__(self, result: FitResult):
        super().__init__(
            f"fit of {type(result.model).__name__} diverged: {result.reason}. throw=False returns the result."
        )
        self.result = result


def fit(
    scene: Scene,
    photographs: Tensor,
    model: BRDF,
    *,
    valid: Tensor | None = None,
    free_exposure: bool = False,
    free_ambient: bool = False,
    starts: int = 1,
    seed: int = 0,
    max_steps: int = 100,
    throw: bool = True,
) -> FitResult:
    """Least-squares fit of the model's trainable parameters to all images jointly.

    Levenberg-Marquardt with exact derivatives, in coordinates that keep every parameter inside its
    domain. The samples that count are object pixels that the object covers fully, `valid` where given, not
    saturated, and, where the sensor has cut off noise, predicted clear of black and full scale (`clear_of_clipping`).

    Args:
        scene: geometry, lights, exposure and point-spread function, all taken as known.
        photographs: sensor values (image, rows, columns, channel), linear, full scale 1.
        model: start values; it is copied, not changed. Per-texel parameters have one entry for each
            masked point of the surface, in row-major order, and are fitted pixel by pixel.
        valid: samples that may be used, bool (image, rows, columns).
        free_exposure: fit the exposure of every image after the first, relative to it.
        free_ambient: fit a constant added to each image: stray and ambient light, black level.
        starts: number of starts; after the model's own, drawn at random over the domains.
        seed: of the random starts.
        max_steps: of each start.
        throw: raise FitError when the fit diverges, instead of returning it.
    Returns: FitResult. Its status says when the photographs do not determine a parameter.
    Raises: ValueError for photographs that do not match the scene, are not finite, all dark or
        saturated, and when no sample is left; FitError.
    """
    began = time.perf_counter()
    model = checked_model(model, starts, max_steps)
    photographs = checked(scene, photographs).detach()
    dtype = _widest(scene, model)
    scene, model = replace(scene, surface=scene.surface.to(dtype)), copy.deepcopy(model).to(dtype)
    photographs = photographs.to(dtype)
    valid = usable_samples(scene, photographs, valid)
    pixels = valid.any(0)
    recorded, first_used = photographs[:, pixels], valid[:, pixels, None].expand(-1, -1, photographs.shape[-1])
    texels = pixels[scene.surface.coverage() == 1].nonzero()[:, 0]
    unknowns = Unknowns(
        model, texels, int(scene.surface.mask.sum()), scene.images,
        free_exposure=free_exposure, free_ambient=free_ambient,
    )  # fmt: skip
    of_material = predictor(scene, model, pixels, per_texel=bool(unknowns.own_entries))

    def predict(shared: Tensor, own: Tensor) -> Tensor:
        raw, exposure, ambient = unknowns.unpack(shared, own)
        return of_material(raw) * exposure[:, None, None] + ambient[:, None, None]

    def problem_of(used: Tensor) -> tuple[Residuals, Tensor]:
        """The residuals and the start values of each pixel's own unknowns."""
        if of_material.basis is None or of_material.coefficients is None or unknowns.own_entries:
            return Residuals(lambda shared, own: (predict(shared, own) - recorded) * used), unknowns.pack()[1]
        return condensed(of_material.basis, of_material.coefficients, unknowns, recorded, used)

    channels = of_material.channels(unknowns.unpack(*unknowns.pack())[0])
    if channels not in (1, photographs.shape[-1]):
        raise ValueError(
            f"the photographs have {photographs.shape[-1]} channels, and model and lights {channels}. "
            "A per-texel albedo has shape (points, channel)."
        )
    best = best_of_starts(*problem_of(first_used), unknowns, starts=starts, seed=seed, max_steps=max_steps)
    used = first_used
    predicted = predict(best.shared, best.own).detach()
    for _ in range(_SELECTIONS):
        if best.status == "diverged":
            break
        clear = clear_of_clipping(scene.sensor, recorded, predicted, first_used)
        if torch.equal(clear, used):
            break
        used, earlier = clear, best
        residuals, own = problem_of(used)
        best = minimise(residuals, best.shared, best.own if best.own.numel() else own, max_steps=max_steps)
        best.iterations, best.history = best.iterations + earlier.iterations, earlier.history + best.history
        predicted = predict(best.shared, best.own).detach()
    samples = int(used.sum())
    # of the residuals themselves: in sums of products a perfect fit drowns in rounding
    cost = ((predicted - recorded) * used).double().square().sum().item()
    best.equations = replace(best.equations, cost=cost)
    unknown_values = len(best.shared) + best.own.numel()
    warnings = warnings_of(scene.sensor, predicted, predicted - recorded, used, unknown_values)
    return judged(
        model, unknowns, best, samples=samples, clipped=int(first_used.sum()) - samples, warnings=warnings,
        unit="of full scale", throw=throw, began=began, mask=scene.surface.mask if scene.surface.samples == 1 else None,
    )  # fmt: skip


def best_of_starts(
    residuals: Residuals, own: Tensor, unknowns: Unknowns, *, starts: int, seed: int, max_steps: int
) -> Solution:  # fmt: skip
    """The least sum of squares of the residuals over all starts of the shared unknowns."""
    shared, _ = unknowns.pack()
    solutions = [
        minimise(residuals, start, own, max_steps=max_steps) for start in _starts(unknowns, shared, starts, seed)
    ]
    return min(solutions, key=lambda s: s.equations.cost if math.isfinite(s.equations.cost) else math.inf)


def judged(
    model: BRDF,
    unknowns: Unknowns,
    best: Solution,
    *,
    samples: int,
    unit: str,
    throw: bool,
    began: float,
    clipped: int = 0,
    warnings: tuple[str, ...] = (),
    mask: Tensor | None = None,
) -> FitResult:
    """What a solution says; `model` receives the parameters found.

    Args:
        samples: how many of the residuals are not held at 0.
        clipped: how many of those held at 0 are so because they may be clipped.
        warnings: what the residuals say against it.
        unit: of the residuals.
        began: `time.perf_counter()` of the caller's start.
        mask: of the result.
    Raises: FitError when it diverged, unless `throw` is false.
    """
    seconds = time.perf_counter() - began
    result = _result(unknowns, best, model, samples=samples, clipped=clipped, unit=unit, seconds=seconds)
    result = replace(result, warnings=warnings, mask=mask)
    if result.status == "diverged" and throw:
        raise FitError(result)
    return result


def checked_model(model: BRDF, starts: int, max_steps: int) -> BRDF:
    """The model; TypeError or ValueError for what no fit can start from."""
    if not isinstance(model, BRDF):
        raise TypeError(f"model must be a BRDF; found {model!r}.")
    for name, count in (("starts", starts), ("max_steps", max_steps)):
        if not isinstance(count, int) or count < 1:
            raise ValueError(f"{name} must be a whole number of at least 1; found {count}.")
    return model


def _starts(unknowns: Unknowns, first: Tensor, count: int, seed: int) -> list[Tensor]:
    """The model's own start and count - 1 random ones, spread over the finite domains."""
    generator = torch.Generator().manual_seed(seed)
    starts = [first]
    for _ in range(count - 1):
        pieces = []
        for entry, raw in unknowns.split_shared(first):
            finite = entry.domain is not None and math.isfinite(entry.domain.high)
            drawn = 0.05 + 0.9 * torch.rand(raw.shape, generator=generator, dtype=raw.dtype)
            pieces.append(torch.logit(drawn) if finite else raw)
        starts.append(torch.cat(pieces))
    return starts


def _widest(scene: Scene, model: BRDF) -> torch.dtype:
    """The wider of the surface's dtype and those of the model's numbers."""
    dtype = scene.surface.normals.dtype
    for value in (*model.parameters(), *model.buffers()):
        if value.is_floating_point():
            dtype = torch.promote_types(dtype, value.dtype)
    return dtype


def _result(
    unknowns: Unknowns, best: Solution, model: BRDF, *, samples: int, clipped: int, unit: str, seconds: float
) -> FitResult:  # fmt: skip
    covariance = Covariance(best.equations, best.shared.dtype)
    freedom = samples - len(best.shared) - best.own.numel()
    noise = math.sqrt(best.equations.cost / freedom) if freedom > 0 else math.inf
    status, reason = judge(unknowns, best, covariance, noise)
    shared_error = covariance.shared.diagonal().sqrt()
    own_error = covariance.own.sqrt() * noise

    parameters, errors = {}, {}
    position = 0
    for entry, raw in unknowns.split_shared(best.shared):
        block = slice(position, position := position + len(raw))
        value, error = entry.physical(raw), entry.shared_error(raw, covariance.shared[block, block] * noise**2)
        shape = entry.start.shape if value.numel() == entry.start.numel() else value.shape
        parameters[entry.name], errors[entry.name] = value.reshape(shape), error.reshape(shape)
    for (entry, raw), (_, error) in zip(unknowns.split_own(best.own), unknowns.split_own(own_error), strict=True):
        shape = (-1, *entry.start.shape[1:])
        unused = torch.full_like(entry.start, torch.nan)  # texels outside the used pixels
        parameters[entry.name] = unused.index_copy(0, unknowns.texels, entry.physical(raw).reshape(shape))
        in_unit = entry.physical_error(raw, error).reshape(shape)
        errors[entry.name] = unused.index_copy(0, unknowns.texels, in_unit)
    with torch.no_grad():
        fitted, _, _ = unknowns.unpack(best.shared, best.own)
        for name, parameter in model.named_parameters():
            if name in fitted:
                parameter.copy_(fitted[name])
    return FitResult(
        parameters=parameters,
        standard_error=errors,
        names=unknowns.shared_labels(),
        correlation=covariance.shared / (shared_error[:, None] * shared_error),
        units={entry.name: entry.domain.unit if entry.domain else "" for entry in unknowns.entries},
        angles=frozenset(entry.name for entry in unknowns.entries if entry.domain and entry.domain.angular),
        nuisances=tuple(entry.name for entry in unknowns.nuisances),
        status=status,
        reason=reason,
        iterations=best.iterations,
        residual_rms=math.sqrt(best.equations.cost / samples),
        samples=samples,
        clipped=clipped,
        warnings=(),
        seconds=seconds,
        model=model,
        history=best.history,
        residual_unit=unit,
        mask=None,
    )
