"""Makes `fast_rough_surface.json`: the fit of the exact V-cavity rough surface that `fast.py` evaluates.

    python examples/fast_fit/fit_fast_rough_surface.py [--output FILE] [--validate]     # minutes, deterministic

What is fitted: the BRDF of two and of all bounces at six albedos, in relative error, over roughness and directions up
to the horizon, by Levenberg-Marquardt over the weights of a small network of smooth functions (see `fast.py`); then
some steps in which large errors count more. Training, validation (--validate: what to look at while a choice is still
open) and report points have different seeds; nothing is chosen by the last. One thread, so that sums do not depend on
the number of cores; another processor or another torch may still change digits.
"""

import argparse
import json
import time
from pathlib import Path

import torch
from network import Data, fit, start
from reference import ALBEDOS, Points, exact, fitted_points, importance, reported_points
from report import print_errors, report

from torchbrdf.models.network import Network
from torchbrdf.models.oren_nayar import coordinates as places
from torchbrdf.models.oren_nayar import fast

ROOT = Path(__file__).parents[2]
FILE = Path(fast.__file__).with_name("fast_rough_surface.json")
SEEDS = {"network": 0, "train": 1, "validate": 2, "report": 61}
HIDDEN = (16, 12)
DIRECTIONS = 8000
# (points, steps, stress) of each stage
STAGES = ((4000, 60, 0.0), (24000, 20, 0.0), (24000, 8, 1.0))


def training_data(points: Points) -> Data:
    c, truth = points.cosines(), exact(points)
    given = (c.light, c.view, c.phase, c.azimuth_sine, places.slope_squared(points.sigma))
    spread = [t.expand(points.sigma.shape).flatten() for t in given]
    place = places.coordinates(*spread)
    two, every = (t.flatten(0, 1) for t in (truth.two(ALBEDOS), truth.all()))
    return Data(place.features.T, place.growth, place.share, two, every, importance(points).flatten())


def settings() -> dict[str, object]:
    """Of the coordinates: whoever changes one has to run this again."""
    names = ("KAPPA", "LEVEL", "RETURN")
    return {name.lower(): getattr(places, name) for name in names}


def dump(table: dict) -> str:
    """JSON with one row a line."""
    lines = []
    for key, value in table.items():
        if isinstance(value, list) and isinstance(value[0], list):
            inner = ",\n    ".join(json.dumps(v) for v in value)
            lines.append(f'  "{key}": [\n    {inner}\n  ]')
        else:
            lines.append(f'  "{key}": {json.dumps(value)}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def main(output: Path, *, validate: bool) -> None:
    began = time.perf_counter()
    data = training_data(fitted_points(DIRECTIONS, SEEDS["train"]))
    order = torch.randperm(len(data.weight), generator=torch.Generator().manual_seed(SEEDS["train"]))
    print(f"reference: {time.perf_counter() - began:.0f} s", flush=True)
    judged = reported_points(1500, SEEDS["validate"], 0, 85)
    truth = exact(judged)
    network = start(HIDDEN, SEEDS["network"])
    for count, steps, stress in STAGES:
        network = fit(network, data.some(order[:count]), ALBEDOS, steps=steps, stress=stress)
        rounded = {
            name: [[float(f"{x:.8g}") for x in row] for row in value.tolist()]
            for name, value in zip(network._fields, network, strict=True)
        }
        stored = {"generator": Path(__file__).relative_to(ROOT).as_posix(), "seeds": SEEDS, **settings(), **rounded}
        output.write_text(dump(stored))
        fast._FIT = Network.of(stored)  # judged is what was just written, not what was there at import
        print(f"{count} points, {steps} steps: {time.perf_counter() - began:.0f} s", flush=True)
        print_errors("validation", judged, truth)
    if not validate:
        report(SEEDS["report"])
    print(f"\ntotal {time.perf_counter() - began:.0f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Fit FastRoughSurface to the exact rough surface.")
    parser.add_argument("--output", type=Path, default=FILE)
    parser.add_argument("--validate", action="store_true", help="validation points instead of the report")
    arguments = parser.parse_args()
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    main(arguments.output, validate=arguments.validate)
