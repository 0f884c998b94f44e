"""Every model at a glance: a sphere and a vase under one light, and the lobes in the plane of incidence.

One lamp at the upper right (a disc of half angle 4 degrees for the polished models, which show it) and one exposure
for all pictures: a white matte surface that faces the lamp is full scale, brighter highlights are clipped, and the
display encoding is sRGB. The mirror stands in a tiled room instead. Beside them f_r against the viewing angle
for light from 20 and 50 degrees (dashed), mean of the channels, in the plane along x; below, the largest f_r. Thick
lines are the mirror directions of polished models, the dotted arc is Lambert's (0.7).
"""

import argparse
import math
import textwrap
from pathlib import Path

import numpy as np
import torch
from gallery_models import MODELS
from kornia.color import linear_rgb_to_rgb
from matplotlib.figure import Figure
from torch import Tensor

import torchbrdf as tb
from inverse import Disc, Distant, Environment, Scene, Surface, render, side_by_side, sphere, vase

LAMP = torch.tensor([0.5, 0.4, 0.8])
POLISHED = (tb.Coupled, tb.Dampened, tb.Mirror)
INCIDENCE = {"tab:blue": 20, "tab:red": 50}  # [deg]


def lobe(model: tb.BRDF, degrees: float, polar: Tensor) -> np.ndarray:
    """f_r (view,), mean of the channels, for views at signed polar angles [rad]; positive ones on the light's side."""
    angles = torch.tensor(math.radians(degrees)), polar
    light, view = (torch.stack((k.sin(), torch.zeros_like(k), k.cos()), -1) for k in angles)
    return model(torch.tensor([0.0, 0.0, 1.0]), light, view).mean(-1).numpy()


def draw_lobes(axis, model: tb.BRDF, polar: Tensor) -> None:
    curves = {degrees: lobe(model, degrees, polar) for degrees in INCIDENCE.values()}
    largest = float(np.max(list(curves.values())))
    scale, x, y = largest or 1.0, polar.sin().numpy(), polar.cos().numpy()
    for colour, degrees in INCIDENCE.items():
        axis.plot(curves[degrees] * x / scale, curves[degrees] * y / scale, color=colour, linewidth=1.3)
        across, up = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
        axis.plot((0, across), (0, up), color=colour, linewidth=0.7, linestyle="--")
        if isinstance(model, POLISHED):
            axis.plot((0, -across), (0, up), color=colour, linewidth=2.5)
    if largest > 0:
        axis.plot(0.7 / math.pi / scale * x, 0.7 / math.pi / scale * y, "k:", linewidth=0.9)
    axis.plot((-1, 1), (0, 0), "k", linewidth=0.6)
    axis.text(0, -0.09, f"{largest:.2g}/sr" if largest > 0 else "nothing else", fontsize=8.5, ha="center", va="top")
    axis.set(xlim=(-1.05, 1.05), ylim=(-0.28, 1.05), aspect="equal")


def tiled_room() -> Environment:
    """Tiles as wide as high, every other one black, blue above and brown below."""
    tiles = torch.arange(12)[:, None] + torch.arange(24)
    colours = torch.tensor([[0.7, 0.85, 1.0], [0.5, 0.3, 0.15]]).repeat_interleave(6, 0)
    return Environment((tiles % 2)[..., None] * colours[:, None] / math.pi)


def picture(surface: Surface, model: tb.BRDF) -> Tensor:
    """For the display (rows, columns, 3), on white; mixed in linear light, so that edges stay smooth."""
    light = Disc(LAMP, half_angle=math.radians(4)) if isinstance(model, POLISHED) else Distant(LAMP)
    scene = Scene(surface, [tiled_room() if isinstance(model, tb.Mirror) else light])
    covered = surface.coverage()[..., None]
    linear = (render(scene, model)[0] * math.pi).clamp(min=0).minimum(covered) + 1 - covered
    return linear_rgb_to_rgb(linear.expand(-1, -1, 3).movedim(-1, 0)).movedim(0, -1)


@torch.no_grad()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the picture")
    parser.add_argument("--size", type=int, default=128, help="rows of a picture")
    parser.add_argument("--points", type=int, default=721, help="views of a lobe")
    parser.add_argument("--models", type=int, default=len(MODELS), help="how many")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    objects = side_by_side([sphere(args.size, args.size, samples=3), vase(args.size, 3 * args.size // 4, samples=3)])
    rows = math.ceil(args.models / 3)
    figure = Figure(figsize=(10.6, 1.32 * rows), layout="constrained")
    axes = figure.subplots(rows, 6, squeeze=False, width_ratios=(1.2, 1) * 3).reshape(-1, 2)
    for axis in axes.flat:
        axis.set_axis_off()
    polar = torch.linspace(-math.pi / 2, math.pi / 2, args.points)
    for (left, right), (caption, model) in zip(axes[: args.models], MODELS.items(), strict=False):
        name, parameters = caption.split("\n")
        left.imshow(picture(objects, model).numpy())
        left.set_title(name, fontsize=9.5, loc="left", fontweight="bold", pad=13)
        left.annotate(parameters, (0, 1), (0, 3), "axes fraction", textcoords="offset points", fontsize=8)
        draw_lobes(right, model, polar)
        print(f"{name}: {parameters}", flush=True)
    figure.supxlabel(textwrap.fill(" ".join(__doc__.split()), 140), fontsize=9)
    figure.savefig(args.output / "model_gallery.png", dpi=90)
    print(f"Picture: {args.output / 'model_gallery.png'}")


if __name__ == "__main__":
    main()
