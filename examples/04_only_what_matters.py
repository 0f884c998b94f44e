"""Simulate only the effects a scene calls for: three scenes, their plans, what that leaves out and what it saves."""

import argparse
import itertools
import time
from pathlib import Path

import torch
from matplotlib.figure import Figure
from torch import Tensor

from inverse import (
    Disc,
    Distant,
    Group,
    Plan,
    Plane,
    Point,
    Scene,
    Sphere,
    everything,
    orthographic,
    perspective,
    pinhole,
    plan,
    render,
    vase,
)
from torchbrdf import BRDF, GGX, RoughSurface, sigma_from_degrees


def clay(rho: float, degrees: float) -> BRDF:
    """The exact rough surface with all bounces."""
    return RoughSurface(albedo=rho, sigma=sigma_from_degrees(degrees), bounces="all")


def three_scenes(size: int) -> dict[str, tuple[Scene, BRDF]]:
    """Scenes that call for different effects, each with its material."""
    level, up = Distant.from_angle(20), torch.tensor([0.6, 0.9, 1.0])
    table = Group((Sphere(0.5, (0.0, -0.1, 0.0)), Plane((0.0, 0.9, 0.44), (0.0, -0.6, 0.0))))
    near = perspective(vase(8, 8).solid, pinhole(size, size, field_of_view=8.0), samples=2)
    above, sun = orthographic(table, size, size, samples=2), Disc(up, 0.01, rings=2)
    return {
        "vase of clay, light from 20 degrees": (Scene(vase(size, size, samples=2), [level]), clay(0.7, 30)),
        "dark smooth vase, a raised lamp": (Scene(near, [Point(30 * up, 1000.0)]), clay(0.15, 5)),
        "glossy ball on a table, the sun": (Scene(above, [sun]), 1.0 * clay(0.5, 20) + 0.3 * GGX(alpha=0.4)),
    }


@torch.no_grad()
def compared(scene: Scene, model: BRDF, planned: Plan) -> tuple[Tensor, Tensor, float]:
    """Images with everything on and as planned, and how much faster the second is: least of two, taken in turns."""
    full, images, seconds = everything(scene), {}, {True: [], False: []}
    for _, follow in itertools.product(range(2), (False, True)):
        began = time.perf_counter()
        images[follow] = planned.render() if follow else render(full, model)
        seconds[follow].append(time.perf_counter() - began)
    return images[False], images[True], min(seconds[False]) / min(seconds[True])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=128, help="pixels a side")
    parser.add_argument("--tolerance", type=float, default=0.01, help="share of the peak radiance")
    parser.add_argument("--output", type=Path, default=Path("output"))
    args = parser.parse_args()
    figure = Figure(figsize=(9.6, 8.4), layout="constrained")
    rows = figure.subplots(3, 3, width_ratios=(1, 1.2, 1.3))
    for axes, (title, (scene, model)) in zip(rows, three_scenes(args.size).items(), strict=True):
        planned = plan(scene, model, args.tolerance)
        full, image, faster = compared(scene, model, planned)
        error = (image - full).abs().amax((0, -1)) / full.max()
        print(f"{title}\n{planned}\nlargest error of all pixels {error.max():.2%}; {faster:.1f} times faster\n")
        axes[0].imshow((image[0, ..., 0] / full.max()).clamp(0, 1).sqrt().numpy(), cmap="gray")
        axes[0].set_title(title.replace(", ", ",\n"), fontsize=9)
        shown = axes[1].imshow(100 * error.numpy(), cmap="magma", vmin=0, vmax=100 * args.tolerance)
        axes[1].set_title(f"difference to everything on\nat most {error.max():.2%} of the peak", fontsize=9)
        figure.colorbar(shown, ax=axes[1], label="% of peak", shrink=0.8, format="{x:g}")
        sized = [effect for effect in planned.effects if effect.size]
        colours = ["tab:red" if effect.simulate else "tab:green" for effect in sized]
        axes[2].barh([e.name for e in sized], [100 * (e.size or 0.0) for e in sized], color=colours)
        axes[2].axvline(100 * args.tolerance, color="black", linestyle=":")
        axes[2].set(xscale="log", xlabel="size when left out alone, % of peak")
        axes[2].set_title("red: simulated, green: left out, dotted: tolerance", fontsize=9, loc="right")
        axes[2].tick_params(labelsize=8)
        axes[2].invert_yaxis()
        for image_axis in axes[:2]:
            image_axis.axis("off")
    args.output.mkdir(parents=True, exist_ok=True)
    figure.savefig(args.output / "only_what_matters.png", dpi=100)
    print(args.output / "only_what_matters.png")


if __name__ == "__main__":
    main()
