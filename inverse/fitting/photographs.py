"""Recover the parameters of a BRDF from photographs of a known shape under known lights."""

import copy
import math
import time

import torch
from torch import Tensor

from inverse.fitting.identifiability import Covariance, judge
from inverse.fitting.levenberg_marquardt import Residual, Solution, minimise
from inverse.fitting.prediction import predictor
from inverse.fitting.result import FitResult
from inverse.fitting.selection import checked, usable_samples
from inverse.fitting.unknowns import Unknowns
from inverse.scene import Scene
from torchbrdf import BRDF


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
    domain. Which samples count is settled before the fit and never changes: object pixels that the
    object covers fully, `valid` where given, and not saturated.

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
    dtype = scene.surface.normals.dtype
    model = checked_model(model, starts, max_steps)
    photographs = checked(scene, photographs).detach().to(dtype)
    valid = usable_samples(scene, photographs, valid)
    model = copy.deepcopy(model).to(dtype)
    pixels = valid.any(0)
    measured, used = photographs[:, pixels], valid[:, pixels, None].to(dtype)
    texels = pixels[scene.surface.coverage() == 1].nonzero()[:, 0]
    unknowns = Unknowns(
        model, texels, int(scene.surface.mask.sum()), scene.images,
        free_exposure=free_exposure, free_ambient=free_ambient,
    )  # fmt: skip
    predict = predictor(scene, model, pixels, per_texel=bool(unknowns.own_entries))

    def residual(shared: Tensor, own: Tensor) -> Tensor:
        raw, exposure, ambient = unknowns.unpack(shared, own)
        return (predict(raw) * exposure[:, None, None] + ambient[:, None, None] - measured) * used

    channels = predict(unknowns.unpack(*unknowns.pack())[0]).shape[-1]
    if channels not in (1, photographs.shape[-1]):
        raise ValueError(
            f"the photographs have {photographs.shape[-1]} channels, and model and lights {channels}. "
            "A per-texel albedo has shape (points, channel)."
        )
    samples = int(used.sum()) * photographs.shape[-1]
    return search(
        model, unknowns, residual, samples=samples, unit="of full scale",
        starts=starts, seed=seed, max_steps=max_steps, throw=throw, began=began,
    )  # fmt: skip


def search(
    model: BRDF,
    unknowns: Unknowns,
    residual: Residual,
    *,
    samples: int,
    unit: str,
    starts: int,
    seed: int,
    max_steps: int,
    throw: bool,
    began: float,
) -> FitResult:
    """The least sum of squares of `residual` over all starts, judged; `model` receives the parameters found.

    Args:
        samples: how many of the residuals are not held at 0.
        unit: of the residuals.
        began: `time.perf_counter()` of the caller's start.
    Raises: FitError when the best start diverged, unless `throw` is false.
    """
    shared, own = unknowns.pack()
    solutions = [
        minimise(residual, start, own, max_steps=max_steps) for start in _starts(unknowns, shared, starts, seed)
    ]
    best = min(solutions, key=lambda s: s.equations.cost if math.isfinite(s.equations.cost) else math.inf)
    result = _result(unknowns, best, model, samples=samples, unit=unit, seconds=time.perf_counter() - began)
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
    found = [first]
    for _ in range(count - 1):
        pieces = []
        for entry, raw in unknowns.split_shared(first):
            finite = entry.domain is not None and math.isfinite(entry.domain.high)
            drawn = 0.05 + 0.9 * torch.rand(raw.shape, generator=generator, dtype=raw.dtype)
            pieces.append(torch.logit(drawn) if finite else raw)
        found.append(torch.cat(pieces))
    return found


def _result(unknowns: Unknowns, best: Solution, model: BRDF, *, samples: int, unit: str, seconds: float) -> FitResult:
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
        found, _, _ = unknowns.unpack(best.shared, best.own)
        for name, parameter in model.named_parameters():
            if name in found:
                parameter.copy_(found[name])
    return FitResult(
        parameters=parameters,
        standard_error=errors,
        names=unknowns.shared_labels(),
        correlation=covariance.shared / (shared_error[:, None] * shared_error),
        units={entry.name: entry.domain.unit if entry.domain else "" for entry in unknowns.entries},
        status=status,
        reason=reason,
        iterations=best.iterations,
        residual_rms=math.sqrt(best.equations.cost / samples),
        samples=samples,
        seconds=seconds,
        model=model,
        history=best.history,
        residual_unit=unit,
    )
