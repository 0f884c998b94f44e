"""Simulate only the effects a scene calls for: three scenes, their plans, what that leaves out and what it saves.

--grid N plans N scenes drawn from a grid of shapes, lights and materials at three tolerances, and prints how far each
planned image is from the one with everything on, and how much faster.
"""

import argparse
import itertools
import random
import statistics
import time
from pathlib import Path

import matplotlib.pyplot as plt
import torch

from inverse import (
    Disc,
    Distant,
    Group,
    Plan,
    Plane,
    Point,
    Scene,
    Sphere,
    cylinder,
    everything,
    orthographic,
    perspective,
    pinhole,
    plan,
    plane,
    render,
    sphere,
    vase,
)  # fmt: skip
from torchbrdf import BRDF, GGX, RoughSurface

SHAPES = {"sphere": sphere, "vase": vase, "cylinder": cylinder, "plane": plane}


def clay(rho: float, degrees: float, gloss: bool = False) -> BRDF:
    """The exact rough surface with all bounces, with or without a glossy coat."""
    body = RoughSurface(albedo=rho, sigma=max(degrees, 0.5) * torch.pi / 180, bounces="all")
    return 1.0 * body + 0.3 * GGX(alpha=0.4) if gloss else body


def three_scenes(size: int) -> dict[str, tuple[Scene, BRDF]]:
    """Scenes that call for different effects, each with its material."""
    up = torch.tensor([0.6, 0.9, 1.0])
    table = Group((Sphere(0.5, (0.0, -0.1, 0.0)), Plane((0.0, 0.9, 0.44), (0.0, -0.6, 0.0))))
    from_afar = perspective(vase(8, 8).solid, pinhole(size, size, field_of_view=8.0), samples=2)
    return {
        "vase of clay, light from 20 degrees": (
            Scene(vase(size, size, samples=2), [Distant.from_angle(20)]),
            clay(0.7, 30),
        ),
        "dark smooth vase, a raised lamp": (Scene(from_afar, [Point(30 * up, 1000.0)]), clay(0.15, 5)),
        "glossy ball on a table, the sun": (
            Scene(orthographic(table, size, size, samples=2), [Disc(up, 0.01, rings=2)]),
            clay(0.5, 20, gloss=True),
        ),
    }


def compared(scene: Scene, model: BRDF, planned: Plan) -> tuple[torch.Tensor, torch.Tensor, float, float]:
    """Images with everything on and as planned, and the seconds each took: the lesser of two, taken in turns."""
    full, seconds = everything(scene), ([], [])
    images = []
    with torch.no_grad():
        for times, work in itertools.product(range(2), ((0, lambda: render(full, model)), (1, planned.render))):
            began = time.perf_counter()
            image = work[1]()
            seconds[work[0]].append(time.perf_counter() - began)
            if times == 0:
                images.append(image)
    return images[0], images[1], min(seconds[0]), min(seconds[1])


def grid(count: int, size: int) -> None:
    """Worst error over tolerance, and the speed-ups, over scenes drawn from all combinations."""
    kinds = list(
        itertools.product(SHAPES, (0, 20, 60), (0, 10, 30, 50), (0.2, 0.6, 0.95), (False, True), (False, True))
    )
    drawn = random.Random(0).sample(kinds, count)
    for tolerance in (1e-1, 1e-2, 1e-3):
        worst, ratios = 0.0, []
        for shape, angle, sigma, rho, gloss, near in drawn:
            far = Distant.from_angle(angle)
            light = Point(4 * far.direction, 16.0) if near else far
            scene, model = Scene(SHAPES[shape](size, size, samples=2), [light]), clay(rho, sigma, gloss)
            full, as_planned, slow, fast = compared(scene, model, plan(scene, model, tolerance))
            worst = max(worst, float((as_planned - full).abs().max() / full.max()) / tolerance)
            ratios.append(slow / fast)
        low, *_, high = statistics.quantiles(ratios, n=10)
        print(
            f"tolerance {tolerance:5.1%}: largest error {worst:.2f} of it, speed-up {statistics.median(ratios):.1f} "
            f"(median), {low:.1f} to {high:.1f} (tenths), {min(ratios):.2f} at least, over {count} scenes"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=128, help="pixels a side")
    parser.add_argument("--tolerance", type=float, default=0.01, help="share of the peak radiance")
    parser.add_argument("--grid", type=int, default=0, help="number of scenes of the study; 0 draws the figure instead")
    parser.add_argument("--output", type=Path, default=Path("output"))
    options = parser.parse_args()
    if options.grid:
        grid(options.grid, options.size)
        return
    figure, rows = plt.subplots(3, 3, figsize=(12, 10), width_ratios=(1, 1, 1.3), layout="constrained")
    for axes, (title, (scene, model)) in zip(rows, three_scenes(options.size).items(), strict=True):
        planned = plan(scene, model, options.tolerance)
        full, found, slow, fast = compared(scene, model, planned)
        error = (found - full).abs().amax((0, -1)) / full.max()
        print(f"{title}\n{planned}\nlargest error of all pixels {error.max():.2%}; {slow / fast:.1f} times faster\n")
        axes[0].imshow((found[0, ..., 0] / full.max()).clamp(0, 1).sqrt().numpy(), cmap="gray")
        axes[0].set_title(f"{title}\nas planned, {slow / fast:.1f} times faster", fontsize=9)
        shown = axes[1].imshow(100 * error.numpy(), cmap="magma", vmin=0, vmax=100 * options.tolerance)
        axes[1].set_title(f"difference to everything on\nat most {error.max():.2%} of the peak", fontsize=9)
        figure.colorbar(shown, ax=axes[1], label="% of peak", shrink=0.8)
        sized = [effect for effect in planned.effects if effect.size]
        colours = ["tab:red" if effect.simulate else "tab:green" for effect in sized]
        axes[2].barh([e.name for e in sized], [100 * (e.size or 0.0) for e in sized], color=colours)
        axes[2].axvline(100 * options.tolerance, color="black", linestyle=":")
        axes[2].set(xscale="log", xlabel="size when left out alone, % of peak")
        axes[2].set_title("red: simulated, green: left out, dotted: tolerance", fontsize=9)
        axes[2].invert_yaxis()
        axes[2].tick_params(labelsize=8)
        for image in axes[:2]:
            image.axis("off")
    options.output.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.output / "only_what_matters.png", dpi=100)
    print(options.output / "only_what_matters.png")


if __name__ == "__main__":
    main()
