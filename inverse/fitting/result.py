"""What a fit returns."""

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor

from torchbrdf import BRDF

# Errors smaller than this, relative to the value, are printed as powers of ten.
_SHOWN_EXACTLY = 1e-6


_Value = TypeVar("_Value")


@dataclass(frozen=True)
class FitResult:
    """Fitted parameters, how well the data determine them, and how the fit ended.

    Attributes:
        parameters: by name, in the model's own units (angles in rad); also the nuisances.
        standard_error: of each entry, from J'J and the residual: noise, not a wrong model or geometry.
        names, correlation: labels and correlation matrix of the shared (not per-texel) parameters.
        units: "rad" or "" by parameter name.
        angles: names of the parameters that are angles.
        nuisances: names of those that belong to the photographs and not to the model: "exposure" and "ambient" when
            free, "image exposure" and "image ambient" where the model has a parameter of that name.
        status: converged | at bound | not identified | out of steps | diverged.
        reason: one sentence on the status.
        residual_rms: of the used samples, in `residual_unit`.
        samples: number of samples used.
        clipped: number of samples left out because noise there may have been clipped at black or at full scale.
        warnings: what residuals that are no noise of the sensor say against the fit, with the likely cause; empty where
            nothing, and where the sensor states no noise.
        model: a fitted copy of the model.
        history: cost after each step.
        residual_unit: "of full scale" (of the sensor) for photographs, "1/sr" for measured reflectance.
        mask: which pixels (rows, columns) the entries of a per-texel parameter belong to, in row-major order; None
            where there are no photographs, or several points a pixel.
    """

    parameters: dict[str, Tensor]
    standard_error: dict[str, Tensor]
    names: list[str]
    correlation: Tensor
    units: dict[str, str]
    angles: frozenset[str]
    nuisances: tuple[str, ...]
    status: str
    reason: str
    iterations: int
    residual_rms: float
    samples: int
    clipped: int
    warnings: tuple[str, ...]
    seconds: float
    model: BRDF
    history: list[float]
    residual_unit: str
    mask: Tensor | None

    @property
    def trusted(self) -> bool:
        """Whether it ended at a minimum that the data determine, and no warning stands. No proof: docs/fitting.md."""
        return self.status in ("converged", "at bound") and not self.warnings

    @property
    def per_texel(self) -> tuple[str, ...]:
        """Names of the parameters with a value for each point."""
        shared = {_entry(label)[0] for label in self.names}
        return tuple(name for name in self.parameters if name not in shared)

    def image(self, name: str) -> Tensor:
        """A parameter as an image (rows, columns, channel), NaN off the object; a shared one is the same all over it.

        Raises: KeyError; ValueError without a mask.
        """
        return self._image(name, self.parameters[name])

    def error_image(self, name: str) -> Tensor:
        """The standard error of a parameter, as `image`; NaN also where a texel had no samples."""
        return self._image(name, self.standard_error[name])

    def _image(self, name: str, value: Tensor) -> Tensor:
        if self.mask is None:
            raise ValueError("a result has images when it is of photographs of a surface with one point a pixel.")
        points = int(self.mask.sum())
        rows = value.reshape(points, -1) if name in self.per_texel else value.reshape(1, -1).expand(points, -1)
        image = rows.new_full((*self.mask.shape, rows.shape[1]), torch.nan)
        image[self.mask] = rows
        return image

    def save(self, path: str | Path) -> None:
        """Write everything but the model's class to a file for `load`: tensors, numbers and text, no code. Of a planned
        fit that is the fit, without the plan.
        """
        content = {field.name: getattr(self, field.name) for field in fields(FitResult)}
        content |= {"angles": sorted(self.angles), "model": self.model.state_dict()}
        torch.save(content, path)

    @staticmethod
    def load(path: str | Path, model: BRDF) -> "FitResult":
        """What `save` wrote; a copy of `model`, one of the class that was fitted, takes the fitted parameters.

        Raises: OSError; ValueError for a file that is no result, or one of another model.
        """
        if not Path(path).is_file():
            raise OSError(f"{path}: no such file.")
        try:
            content = torch.load(path, weights_only=True)
            model = copy.deepcopy(model)
            model.load_state_dict(_shaped(model, content["model"]))
            content |= {"angles": frozenset(content["angles"]), "model": model}
            return FitResult(**content)
        except Exception as error:  # torch raises what it meets
            kind = type(model).__name__
            raise ValueError(f"{path}: holds no result of {kind}: {error}") from error

    def __str__(self) -> str:
        rows = [("model", type(self.model).__name__)]
        rows += [(name, self.estimate(name)) for name in self.parameters]
        if len(self.names) > 1 and self.correlation.isfinite().all():
            strongest = self.correlation.abs().fill_diagonal_(0.0)
            i, j = divmod(int(strongest.argmax()), len(self.names))
            if i != j:
                rows.append(("correlation", f"{self.correlation[i, j]:+.2f} ({self.names[i]}, {self.names[j]})"))
        left_out = f", {self.clipped} left out that may be clipped" if self.clipped else ""
        rows.append(("residual rms", f"{self.residual_rms:.3g} {self.residual_unit}, {self.samples} samples{left_out}"))
        doubted = ", with warnings" if self.warnings else ""
        rows.append(("status", f"{self.status}{doubted}: {self.reason} ({self.seconds:.2f} s)"))
        rows += [("warning", warning) for warning in self.warnings]
        width = max(14, *(len(name) + 2 for name, _ in rows))
        return "\n".join(f"{name:<{width}}{text}" for name, text in rows)

    def renamed(self, names: Mapping[str, str]) -> "FitResult":
        """The same with other names for some parameters."""

        def under_new_names(values: dict[str, _Value]) -> dict[str, _Value]:
            return {names.get(name, name): value for name, value in values.items()}

        return replace(
            self,
            parameters=under_new_names(self.parameters),
            standard_error=under_new_names(self.standard_error),
            units=under_new_names(self.units),
            angles=frozenset(names.get(name, name) for name in self.angles),
            names=[names.get(name, name) + entry for name, entry in map(_entry, self.names)],
        )

    def estimate(self, name: str) -> str:
        """A parameter and its standard error as text, angles in degrees; a summary of a per-texel one."""
        return _estimate(self.parameters[name], self.standard_error[name], angular=name in self.angles)

    def to_json(self) -> dict[str, Any]:
        """Plain numbers, lists and strings; None for what is not finite. Angles in degrees, named so."""
        report: dict[str, Any] = {"model": type(self.model).__name__, "status": self.status, "reason": self.reason}
        report["warnings"] = list(self.warnings)
        for name, value in self.parameters.items():
            angular = name in self.angles
            key = f"{name}_degrees" if angular else name
            report[key] = _plain(in_display_unit(value, angular=angular))
            report[f"{key}_standard_error"] = _plain(in_display_unit(self.standard_error[name], angular=angular))
        report["names"], report["correlation"] = self.names, _plain(self.correlation)
        report |= {"residual_rms": _plain(torch.tensor(self.residual_rms)), "samples": self.samples}
        return report | {"clipped": self.clipped, "iterations": self.iterations, "seconds": self.seconds}


def _shaped(model: BRDF, state: dict[str, Tensor]) -> dict[str, Tensor]:
    """The state; the model's parameters take its shapes and dtypes, which those of its start values need not have."""
    for name, parameter in model.named_parameters():
        if name in state:
            parameter.data = state[name].clone()
    return state


def _entry(label: str) -> tuple[str, str]:
    """Name of a parameter, and which entry of it a label means: "[1]", or nothing."""
    name, bracket, rest = label.partition("[")
    return name, bracket + rest


def in_display_unit(value: Tensor, *, angular: bool) -> Tensor:
    """Degrees for angles, the value itself otherwise."""
    return torch.rad2deg(value) if angular else value


def _estimate(value: Tensor, error: Tensor, *, angular: bool) -> str:
    value, error = (in_display_unit(k, angular=angular).double() for k in (value, error))
    suffix = " deg" if angular else ""
    if value.numel() > 8:
        known = error[error.isfinite()]
        typical = f"{known.median():.2g}" if known.numel() else "unknown"
        return f"{value.numel()} values, median {value.nanmedian():.4g}, median error {typical}{suffix}"
    pairs = zip(value.flatten().tolist(), error.flatten().tolist(), strict=True)
    return ", ".join(_plus_minus(v, e) + suffix for v, e in pairs)


def _plus_minus(value: float, error: float) -> str:
    """value +- error with the error's two leading digits."""
    if not math.isfinite(error):
        return f"{value:.4g} +- unknown"
    if error < _SHOWN_EXACTLY * max(abs(value), 1):
        return f"{value:.7g} +- {error:.1g}"
    digits = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{digits}f} +- {error:.{digits}f}"


def _plain(value: Tensor) -> Any:
    def clean(x: Any) -> Any:
        if isinstance(x, list):
            return [clean(y) for y in x]
        return x if math.isfinite(x) else None

    return clean(value.detach().tolist())
