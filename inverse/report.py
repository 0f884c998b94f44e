"""A fit as a folder: numbers, maps, a picture of what it leaves unexplained, and the result to load again."""

import json
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from inverse.fitting import FitResult
from inverse.scene import Scene
from inverse.transport import render


def write_report(folder: Path, scene: Scene, photographs: Tensor, valid: Tensor, result: FitResult) -> None:
    """Write what was fitted to photographs of a scene into a folder that exists; needs matplotlib.

    report.txt, report.json      as printed
    result.pt                    for `FitResult.load`
    NAME.npy, NAME_error.npy     a parameter fitted per texel and its standard error, (rows, columns, channel), NaN off
                                 the object. [in the parameter's unit]
    residuals.npy                photographs minus fit (image, rows, columns, channel), NaN where not fitted
    residuals.png                of the first image, and over all against the angle of the light

    Args:
        valid: the samples that were allowed, bool (image, rows, columns).
    """
    from inverse.figures import residual_figure  # drawing is an extra

    exposure, ambient = (_nuisance(result, name, len(photographs)) for name in ("exposure", "ambient"))
    with torch.no_grad():
        recorded = scene.sensor.focus(render(scene, result.model)) * scene.sensor.exposure
    fitted = (recorded * exposure + ambient).expand_as(photographs)
    residuals = (photographs - fitted).masked_fill(~valid[..., None], torch.nan)
    (folder / "report.txt").write_text(f"{result}\n")
    (folder / "report.json").write_text(json.dumps(result.to_json(), indent=1, allow_nan=False) + "\n")
    result.save(folder / "result.pt")
    np.save(folder / "residuals.npy", residuals.numpy())
    for name in result.per_texel:
        np.save(folder / f"{name}.npy", result.image(name).numpy())
        np.save(folder / f"{name}_error.npy", result.error_image(name).numpy())
    figure = residual_figure(scene, photographs, {type(result.model).__name__: fitted}, valid)
    figure.savefig(folder / "residuals.png")


def _nuisance(result: FitResult, name: str, images: int) -> Tensor:
    """Exposure or ambient (image, 1, 1, 1) of each photograph, where it was fitted; the exposure of the first is 1."""
    neutral = torch.full((images,), 1.0 if name == "exposure" else 0.0, dtype=torch.float64)
    for label in (name, f"image {name}"):
        if label in result.nuisances:
            neutral[images - len(result.parameters[label]) :] = result.parameters[label]
    return neutral[:, None, None, None]
