"""Command line: `python -m inverse fit FOLDER` and `python -m inverse render`."""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from inverse.files import read_stack, write_stack
from inverse.fitting import FitError, bootstrap, fit, usable
from inverse.scene import Distant, Scene, Sensor, cylinder, plane, sphere, vase
from inverse.transport import render
from torchbrdf import BRDF, Lambert, OrenNayar, QualitativeOrenNayar, fixed

_ROUGH = {"qualitative": QualitativeOrenNayar, "oren-nayar": OrenNayar}
_EXPOSURE = "image value per unit radiance; with pi, white that faces a light of irradiance 1 is full scale"
_SHAPES = {"vase": vase, "sphere": sphere, "cylinder": cylinder, "plane": plane}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 on success, 2 on bad input with one line on stderr."""
    options = _parser().parse_args(arguments)
    try:
        report = options.run(options)
    except (ValueError, OSError, FitError) as error:
        print("error:", " ".join(str(error).split()), file=sys.stderr)
        return 2
    print(json.dumps(report, indent=2, allow_nan=False) if options.json else report["table"])
    return 0


class _Parser(argparse.ArgumentParser):
    def error(self, message: str):  # argparse would print the usage as well
        self.exit(2, f"error: {message} ({self.prog} --help tells more)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="python -m inverse", description="Reflectance of rough surfaces from photographs.")
    commands = parser.add_subparsers(required=True, metavar="{fit,render}")
    _add_fit(commands.add_parser("fit", help="recover roughness and albedo from a folder of photographs"))
    _add_render(commands.add_parser("render", help="make photographs of a known material, as `fit` reads them"))
    return parser


def _add_fit(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_fit)
    add = parser.add_argument
    add("folder", help="images and what is known of them, as `pydoc inverse.files.stacks` describes")
    add("--model", choices=["lambert", *_ROUGH], default="oren-nayar")
    add("--albedo", choices=["single", "per-pixel"], default="single")
    add("--geometry", metavar="LINE", help='instead of geometry.txt, such as "sphere 244.5 144.5 108"')
    add("--images", metavar="PATTERN", help='image files, such as "gray.*.tga"')
    add("--mask", metavar="FILE", help="instead of the image with mask in its name")
    add("--lights", metavar="FILE", help="instead of lights.txt")
    add("--srgb", action="store_true", help="the images are sRGB-encoded, not linear")
    add("--limb", type=float, default=70.0, help="leave out points seen at more than this [deg] (%(default)s)")
    add("--highlight", type=float, default=0.0, help="leave out points this close to mirroring the light [deg]")
    add("--shadow", type=float, default=80.0, help="leave out points lit at more than this [deg] (%(default)s)")
    add("--exposure", type=float, help=f"{_EXPOSURE} (that of the folder's stack.json; pi where it has none)")
    add("--free-exposure", action="store_true", help="fit the exposure of each image after the first")
    add("--free-ambient", action="store_true", help="fit a constant added to each image")
    add("--starts", type=int, default=1, help="number of starting points (%(default)s)")
    add("--bootstrap", type=int, default=0, metavar="N", help="refit to N samples of the images for error bars")
    add("--seed", type=int, default=0, help="of random starts and bootstrap (%(default)s)")
    add("--json", action="store_true", help="print JSON")


def _add_render(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_render)
    add = parser.add_argument
    add("--output", required=True, metavar="FOLDER", help="where to write 16-bit images and what `fit` needs")
    add("--geometry", choices=list(_SHAPES), default="vase")
    add("--model", choices=["lambert", *_ROUGH], default="oren-nayar")
    add("--sigma", type=float, default=40.0, metavar="DEG", help="roughness [deg] (%(default)s)")
    add("--albedo", type=float, default=0.7, help="facet albedo (%(default)s)")
    add("--lights-deg", type=float, nargs="+", default=[0.0, 20.0], metavar="DEG",
        help="a light an image, this far to the right of the camera [deg] (0 20)")  # fmt: skip
    add("--size", type=int, default=256, help="rows and columns (%(default)s)")
    add("--noise", type=float, default=0.0, help="standard deviation, share of full scale (%(default)s)")
    add("--seed", type=int, default=0, help="of the noise (%(default)s)")
    add("--exposure", type=float, default=math.pi, help=f"{_EXPOSURE} (pi)")
    add("--overwrite", action="store_true", help="replace an older stack in the output folder")
    add("--json", action="store_true", help="print JSON")


def _fit(options: argparse.Namespace) -> dict[str, Any]:
    photos = read_stack(
        options.folder, images=options.images, mask=options.mask, lights=options.lights, geometry=options.geometry,
        color="srgb" if options.srgb else "linear", dtype=torch.float64,
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
    result = fit(scene, photos.images, model, seed=options.seed, **how)
    report = {"images": list(photos.names), **result.to_json()}
    table = [str(result)]
    if options.bootstrap:
        spread = bootstrap(scene, photos.images, model, samples=options.bootstrap, seed=options.seed, **how)
        report["bootstrap"] = {"samples": options.bootstrap}
        for name, value in spread.items():
            angle = name in result.angles
            label, shown = (f"{name}_degrees", torch.rad2deg(value)) if angle else (name, value)
            report["bootstrap"][label] = _plain(shown)
            numbers = ", ".join(f"{k:.2g}" for k in shown.flatten().tolist())
            table.append(f"{'bootstrap':<14}{name} +- {numbers}{' deg' if angle else ''}, {options.bootstrap} refits")
    return report if options.json else {"table": "\n".join(table)}


def _render(options: argparse.Namespace) -> dict[str, Any]:
    if not math.isfinite(options.albedo) or not math.isfinite(options.sigma):
        raise ValueError(f"albedo and sigma must be finite; found {options.albedo} and {options.sigma}.")
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
    return report | {"table": f"{len(images)} images of {options.size} x {options.size} pixels in {options.output}"}


def _model(name: str, albedo: Tensor | fixed, sigma: Tensor | fixed) -> BRDF:
    return Lambert(albedo=albedo) if name == "lambert" else _ROUGH[name](albedo=albedo, sigma=sigma)


def _plain(value: Tensor) -> Any:
    """Numbers for strict JSON, None for those that are not finite."""
    if value.ndim:
        return [_plain(entry) for entry in value]
    return value.item() if value.isfinite() else None
