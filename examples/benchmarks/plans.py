"""How good plans are: scenes drawn from a grid of shapes, lights and materials, planned at three tolerances.

Printed are the largest error of any pixel of a planned image against the one with everything on, as a share of the
tolerance, and how much faster the planned image is. The table of docs/planning.md: --scenes 40 --size 64, one thread.
"""

import argparse
import itertools
import random
import statistics
import time
from collections.abc import Callable

import torch
from torch import Tensor

from inverse import Distant, Point, Scene, cylinder, everything, plan, plane, render, sphere, vase
from torchbrdf import BRDF, GGX, RoughSurface, sigma_from_degrees

SHAPES = {"sphere": sphere, "vase": vase, "cylinder": cylinder, "plane": plane}
GRID = (SHAPES, (0, 20, 60), (0, 10, 30, 50), (0.2, 0.6, 0.95), (False, True), (False, True))
TOLERANCES = (1e-1, 1e-2, 1e-3)


def clay(rho: float, degrees: float, gloss: bool) -> BRDF:
    """The exact rough surface with all bounces, with or without a glossy coat."""
    body = RoughSurface(albedo=rho, sigma=sigma_from_degrees(max(degrees, 0.5)), bounces="all")
    return 1.0 * body + 0.3 * GGX(alpha=0.4) if gloss else body


def seconds(work: Callable[[], Tensor]) -> tuple[float, Tensor]:
    began = time.perf_counter()
    with torch.no_grad():
        image = work()
    return time.perf_counter() - began, image


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=40)
    parser.add_argument("--size", type=int, default=64, help="pixels a side")
    args = parser.parse_args()
    drawn = random.Random(0).sample(list(itertools.product(*GRID)), args.scenes)
    for tolerance in TOLERANCES:
        worst, ratios = 0.0, []
        for shape, angle, sigma, rho, gloss, near in drawn:
            far = Distant.from_angle(angle)
            light = Point(4 * far.direction, 16.0) if near else far
            scene, model = Scene(SHAPES[shape](args.size, args.size, samples=2), [light]), clay(rho, sigma, gloss)
            full, planned = everything(scene), plan(scene, model, tolerance)
            turns = [(seconds(lambda: render(full, model)), seconds(planned.render)) for _ in range(2)]  # noqa: B023
            (_, image), (_, as_planned) = turns[0]
            worst = max(worst, float((as_planned - image).abs().max() / image.max()) / tolerance)
            slow, fast = (min(turn[k][0] for turn in turns) for k in range(2))
            ratios.append(slow / fast)
        low, *_, high = statistics.quantiles(ratios, n=10)
        print(
            f"tolerance {tolerance:5.1%}: largest error {worst:.2f} of it, speed-up {statistics.median(ratios):.1f} "
            f"(median), {low:.1f} to {high:.1f} (tenths), {min(ratios):.2f} at least, over {args.scenes} scenes"
        )


if __name__ == "__main__":
    main()
