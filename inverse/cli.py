"""Command line: `python -m inverse fit FOLDER` and `python -m inverse render`."""

import argparse
import json
import logging
import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from inverse.files import MAX_PIXELS, read_stack, whole_folder, write_stack
from inverse.fitting import FitError, bootstrap, fit, usable
from inverse.report import write_report
from inverse.scene import Distant, Scene, Sensor, cylinder, plane, sphere, vase
from inverse.transport import render
from torchbrdf import (
    BRDF,
    FastGaussianHeightfield,
    FastRoughSurface,
    Lambert,
    OrenNayar,
    QualitativeOrenNayar,
    RoughSurface,
    fixed,
)

_ROUGH: dict[str, Callable[..., BRDF]] = {
    "qualitative": QualitativeOrenNayar,
    "oren-nayar": OrenNayar,
    "fast": FastRoughSurface,
    "exact": RoughSurface,
    "heightfield": FastGaussianHeightfield,
}
_SURFACES = (
    "the V-cavities of Oren and Nayar: qualitative, oren-nayar (functional), fast (fitted, all bounces), exact (16 "
    "slopes, all bounces: minutes); heightfield (fitted): sand, plaster, clay (%(default)s)"
)
_EXPOSURE = "image value per unit radiance; with pi, white that faces a light of irradiance 1 is full scale"
_SHAPES = {"vase": vase, "sphere": sphere, "cylinder": cylinder, "plane": plane}


# What a scene of the command line takes at its peak, measured with all shapes, and what each image adds.
_BYTES_A_PIXEL, _BYTES_AN_IMAGE_PIXEL = 950, 16
_STEP = tuple[dict[str, Any], str]
_DOUBTFUL, _INTERRUPTED = 3, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 on success, otherwise one line on stderr and 2, or 130 after an interrupt.

    What was finished by then is printed in any case. 3: printed as well, and not to be trusted: something was not
    identified, or a warning stands.
    """
    options = _parser().parse_args(arguments)
    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # what it logs comes as an error as well
    finished: dict[str, Any] = {}
    trouble, code = "", 0
    try:
        for report, text in options.run(options):
            finished |= report
            code = max(code, _DOUBTFUL if report.get("trusted") is False else 0)
            if not options.json:
                _print(text)
    except (ValueError, OSError, FitError) as error:
        trouble, code = str(error), 2
    except KeyboardInterrupt:
        trouble, code = "interrupted" + ("; what is printed was finished" if finished else ""), _INTERRUPTED
    except (MemoryError, RuntimeError) as error:
        if not _out_of_memory(error):
            raise
        trouble, code = "out of memory: smaller or fewer images may fit", 2
    if options.json and finished:
        try:
            _print(json.dumps(finished, indent=2, allow_nan=False))
        except OSError as error:
            trouble, code = trouble or str(error), 2
    if trouble:
        print("error:", " ".join(trouble.split()), file=sys.stderr)
    return code


def _print(text: str) -> None:
    try:
        print(text, flush=True)
    except OSError as error:
        # what is still in the buffer goes nowhere: the interpreter would try again at its end, and complain
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise OSError(f"standard output: {error}") from error


def _out_of_memory(error: Exception) -> bool:
    # torch raises a plain RuntimeError for memory of the processor
    return isinstance(error, (MemoryError, torch.OutOfMemoryError)) or "allocate memory" in str(error)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str):  # argparse would print the usage as well
        self.exit(2, f"error: {message} ({self.prog} --help tells more)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="python -m inverse", description="Reflectance of rough surfaces from photographs.")
    commands = parser.add_subparsers(required=True, metavar="{fit,render}")
    _add_fit(commands.add_parser("fit", help="recover roughness and albedo from a folder of photographs"))
    _add_render(commands.add_parser("render", help="make photographs of a known material, as `fit` reads them"))
    return parser


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be finite; found {text!r}")
    return value


def _seed(text: str) -> int:
    value = int(text)
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"must lie in [0, 2^63); found {text!r}")
    return value


def _samples(text: str) -> int:
    value = int(text)
    if value < 2 and value != 0:
        raise argparse.ArgumentTypeError(f"must be at least 2, or 0 for none; found {text!r}")
    return value


def _add_fit(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_fit)
    add = parser.add_argument
    add("folder", help="images and what is known of them, as `pydoc inverse.files.stacks` describes")
    add("--model", choices=["lambert", *_ROUGH], default="oren-nayar", help=_SURFACES)
    add("--output", metavar="FOLDER", help="where to write the report, the result, maps and residuals")
    add("--overwrite", action="store_true", help="replace an older report in the output folder")
    add("--albedo", choices=["single", "per-pixel"], default="single")
    add("--geometry", metavar="LINE", help='instead of geometry.txt, such as "sphere 244.5 144.5 108"')
    add("--images", metavar="PATTERN", help='image files, such as "gray.*.tga"')
    add("--mask", metavar="FILE", help="instead of the image with mask in its name")
    add("--lights", metavar="FILE", help="instead of lights.txt")
    add("--srgb", action="store_true", help="the images are sRGB-encoded, not linear")
    add("--limb", type=_number, default=70.0, help="leave out points seen at more than this [deg] (%(default)s)")
    add("--highlight", type=_number, default=0.0, help="leave out points this close to mirroring the light [deg]")
    add("--shadow", type=_number, default=80.0, help="leave out points lit at more than this [deg] (%(default)s)")
    add("--exposure", type=_number, help=f"{_EXPOSURE} (that of the folder's stack.json; pi where it has none)")
    add("--free-exposure", action="store_true", help="fit the exposure of each image after the first")
    add("--free-ambient", action="store_true", help="fit a constant added to each image")
    add("--starts", type=int, default=1, help="number of starting points (%(default)s)")
    add("--bootstrap", type=_samples, default=0, metavar="N", help="refit to N samples of the images for error bars")
    add("--max-megapixels", type=_number, default=MAX_PIXELS / 1e6, help="refuse larger images (%(default)s)")
    add("--seed", type=_seed, default=0, help="of random starts and bootstrap (%(default)s)")
    add("--json", action="store_true", help="print JSON")


def _add_render(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_render)
    add = parser.add_argument
    add("--output", required=True, metavar="FOLDER", help="where to write 16-bit images and what `fit` needs")
    add("--geometry", choices=list(_SHAPES), default="vase")
    add("--model", choices=["lambert", *_ROUGH], default="oren-nayar")
    add("--sigma", type=_number, default=40.0, metavar="DEG", help="roughness [deg] (%(default)s)")
    add("--albedo", type=_number, default=0.7, help="facet albedo (%(default)s)")
    add("--lights-deg", type=_number, nargs="+", default=[0.0, 20.0], metavar="DEG",
        help="a light an image, this far to the right of the camera [deg] (0 20)")  # fmt: skip
    add("--size", type=int, default=256, help="rows and columns (%(default)s)")
    add("--noise", type=_number, default=0.0, help="standard deviation, share of full scale (%(default)s)")
    add("--seed", type=_seed, default=0, help="of the noise (%(default)s)")
    add("--exposure", type=_number, default=math.pi, help=f"{_EXPOSURE} (pi)")
    add("--overwrite", action="store_true", help="replace an older stack in the output folder")
    add("--json", action="store_true", help="print JSON")


def _fit(options: argparse.Namespace) -> Iterator[_STEP]:
    photos = read_stack(
        options.folder, images=options.images, mask=options.mask, lights=options.lights, geometry=options.geometry,
        color="srgb" if options.srgb else "linear", dtype=torch.float64,
        max_pixels=round(options.max_megapixels * 1e6),
    )  # fmt: skip
    scene = photos.scene
    if options.exposure is not None or not photos.sensor_stated:
        exposure = math.pi if options.exposure is None else options.exposure
        scene = replace(scene, sensor=replace(scene.sensor, exposure=exposure))
    valid = usable(scene, limb=options.limb, highlight=options.highlight, shadow=options.shadow)
    channels = photos.images.shape[-1]
    points = int(scene.surface.mask.sum())
    start = torch.full((points, channels) if options.albedo == "per-pixel" else (channels,), 0.5, dtype=torch.float64)
    model = _model(options.model, start, torch.tensor(0.3, dtype=torch.float64))
    how = {
        "valid": valid, "free_exposure": options.free_exposure, "free_ambient": options.free_ambient,
        "starts": options.starts,
    }  # fmt: skip
    with _report_folder(options) as folder:
        result = fit(scene, photos.images, model, seed=options.seed, **how)
        if folder is not None:
            write_report(folder, scene, photos.images, valid, result)
    text = str(result)
    if options.output:
        text += f"\n{'written to':<14}{options.output}"
    yield {"images": list(photos.names), "trusted": result.trusted, **result.to_json()}, text
    if options.bootstrap:
        spread = bootstrap(scene, photos.images, model, samples=options.bootstrap, seed=options.seed, **how)
        report: dict[str, Any] = {"samples": options.bootstrap}
        lines = []
        for name, value in spread.items():
            angle = name in result.angles
            label, shown = (f"{name}_degrees", torch.rad2deg(value)) if angle else (name, value)
            report[label] = _plain(shown)
            numbers = ", ".join(f"{k:.2g}" for k in shown.flatten().tolist())
            lines.append(f"{'bootstrap':<14}{name} +- {numbers}{' deg' if angle else ''}, {options.bootstrap} refits")
        yield {"bootstrap": report}, "\n".join(lines)


def _report_folder(options: argparse.Namespace) -> AbstractContextManager[Path | None]:
    """Where to write the report, refused before the fit rather than after it."""
    if not options.output:
        return nullcontext()
    if find_spec("matplotlib") is None:
        raise ValueError("--output draws a figure and needs matplotlib: pip install 'torchbrdf[plots]'.")
    return whole_folder(Path(options.output), overwrite=options.overwrite, ours=lambda name: False)


def _render(options: argparse.Namespace) -> Iterator[_STEP]:
    _check_memory(options.size, len(options.lights_deg))
    surface = _SHAPES[options.geometry](options.size, options.size, dtype=torch.float64)
    sensor = Sensor(exposure=options.exposure, read_noise=options.noise)
    scene = Scene(surface, [Distant.from_angle(angle) for angle in options.lights_deg], sensor)
    sigma = torch.tensor(math.radians(options.sigma), dtype=torch.float64)
    model = _model(options.model, *(fixed(k) for k in (torch.tensor(options.albedo, dtype=torch.float64), sigma)))
    with torch.no_grad():
        images = sensor.expose(render(scene, model), torch.Generator().manual_seed(options.seed))
    write_stack(options.output, images, scene, overwrite=options.overwrite)
    report = {"folder": options.output, "images": len(images), "rows": options.size, "columns": options.size}
    report |= {"clipped": (images >= 1).double().mean().item()}
    yield report, f"{len(images)} images of {options.size} x {options.size} pixels in {options.output}"


def _check_memory(size: int, images: int) -> None:
    """ValueError for pictures that this machine cannot hold, before it tries."""
    needed = size * size * (_BYTES_A_PIXEL + images * _BYTES_AN_IMAGE_PIXEL)
    try:
        there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # not every system says
        return
    if needed > there:
        raise ValueError(
            f"{images} images of {size} x {size} pixels need about {needed / 2**30:.3g} GiB of memory; "
            f"this machine has {there / 2**30:.3g}."
        )


def _model(name: str, albedo: Tensor | fixed, sigma: Tensor | fixed) -> BRDF:
    return Lambert(albedo=albedo) if name == "lambert" else _ROUGH[name](albedo=albedo, sigma=sigma)


def _plain(value: Tensor) -> Any:
    """Numbers for strict JSON, None for those that are not finite."""
    if value.ndim:
        return [_plain(entry) for entry in value]
    return value.item() if value.isfinite() else None
