"""Makes `fast_heightfield.json`: the fit of `GaussianHeightfield` (occlusion 1, all bounces) that `fast.py` evaluates.

    python examples/fast_heightfield/fit_fast_heightfield.py [--output FILE] [--validate]     # minutes, deterministic

What is fitted: the whole BRDF at six albedos, in relative error, over roughness and directions up to 89 degrees, by
Levenberg-Marquardt over the weights of a small network of smooth functions (see `fast.py`); then some steps in which
large errors count more. Training, validation (--validate: what to look at while a choice is still open) and report
points have different seeds; nothing is chosen by the last. One thread, so that sums do not depend on the number of
cores; another processor or another torch may still change digits.
"""

import argparse
import json
import math
import time
from pathlib import Path

import torch
from network import Data, fit, start
from numpy.polynomial import Chebyshev, Polynomial
from reference import Points, Reference, fitted_points, reported_points, totals
from report import print_errors, report
from torch import Tensor

from torchbrdf import rms_slope_from_sigma
from torchbrdf.models.heightfield import fast
from torchbrdf.models.heightfield.coordinates import KNEE, coordinates, slope_squared

ROOT = Path(__file__).parents[2]
FILE = Path(fast.__file__).with_name("fast_heightfield.json")
SEEDS = {"network": 0, "train": 1, "validate": 2, "report": 61}
HIDDEN = (16, 12)
ALBEDOS = torch.tensor([0.1, 0.3, 0.5, 0.7, 0.95, 1.0], dtype=torch.float64)
SLOPE_DEGREE = 8
# (points, steps, stress) of each stage
STAGES = ((6000, 60, 0.0), (20000, 40, 0.0), (20000, 15, 1.0))


def slope_series() -> tuple[float, ...]:
    """s/sigma as a polynomial in x, lowest power first; good to 3e-4."""
    largest = (math.pi / 2) ** 2 / ((math.pi / 2) ** 2 + KNEE**2)

    def ratio(v):
        x = torch.as_tensor((1 + v) / 2 * largest)
        sigma = KNEE * (x / (1 - x)).sqrt()
        return (rms_slope_from_sigma(sigma) / sigma).numpy()

    series = Chebyshev.interpolate(ratio, SLOPE_DEGREE).convert(kind=Polynomial)
    in_x = Polynomial(series.convert(domain=[-1, 1]).coef)(Polynomial([-1, 2 / largest]))
    return tuple(float(f"{c:.9g}") for c in in_x.coef)


def training_data(reference: Reference, points: Points, series: tuple[float, ...]) -> Data:
    c = points.cosines()
    found = coordinates(c.light, c.view, c.phase, c.azimuth_sine, slope_squared(points.sigma, series))
    truth = totals(reference.orders(points), ALBEDOS)
    return Data(found.features.T, found.masked, found.share, truth, importance(points))


def importance(points: Points) -> Tensor:
    """Beyond 85 degrees, beyond 62 and below 1.5 degrees of roughness the fit may be looser."""
    sigma = torch.rad2deg(points.sigma)
    weight = torch.where(points.steepest > 85, 0.35, 1.0).double()
    return weight * torch.where(sigma > 62, 0.4, 1.0) * torch.where(sigma < 1.5, 0.5, 1.0)


def main(output: Path, *, validate: bool) -> None:
    began = time.perf_counter()
    reference, series = Reference(), slope_series()
    most = max(count for count, _, _ in STAGES)
    data = training_data(reference, fitted_points(most, SEEDS["train"]), series)
    print(f"reference: {time.perf_counter() - began:.0f} s", flush=True)
    network = start(HIDDEN, SEEDS["network"])
    for count, steps, stress in STAGES:
        network = fit(network, data.first(count), ALBEDOS, steps=steps, stress=stress)
        stored = {"generator": Path(__file__).relative_to(ROOT).as_posix(), "seeds": SEEDS, "slope": list(series)}
        rounded = {
            name: [[float(f"{x:.8g}") for x in row] for row in value.tolist()]
            for name, value in zip(network._fields, network, strict=True)
        }
        output.write_text(dump(stored | rounded))
        fast._FIT = fast._read(output)  # judged is what was just written, not what was there at import
        print(f"{count} points, {steps} steps: {time.perf_counter() - began:.0f} s", flush=True)
        print_errors("validation", reference, reported_points(6000, SEEDS["validate"], 0, 85))
    if not validate:
        report(reference, SEEDS["report"])
    print(f"\ntotal {time.perf_counter() - began:.0f} s")


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


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Fit FastGaussianHeightfield to GaussianHeightfield.")
    parser.add_argument("--output", type=Path, default=FILE)
    parser.add_argument("--validate", action="store_true", help="validation points instead of the report")
    arguments = parser.parse_args()
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    main(arguments.output, validate=arguments.validate)
