"""Figures 12 and 13 of He, Torrance, Sillion and Greenberg: aluminium cylinders of growing roughness in a room.

sigma0 and tau in um. The room has dim walls, a cool window, a warm lamp and two white strips of light, one of them
behind the cylinder, where the lid mirrors it. Last the limits: a mirror, and uniform diffuse reflection alone.
"""

import argparse
import math
from pathlib import Path

import torch
from kornia.color import linear_rgb_to_rgb
from kornia.geometry.camera import PinholeCamera
from matplotlib.figure import Figure
from torch import Tensor

from inverse import Cylinder, Environment, Scene, Surface, perspective, pinhole, render
from torchbrdf import ALUMINIUM, HeTorrance, fixed

WAVELENGTHS = torch.tensor([0.65, 0.55, 0.45])  # red, green, blue [um]
ETA, K = ALUMINIUM(WAVELENGTHS)
ROUGHNESS = ((0.18, 3.0), (0.28, 3.0), (0.38, 3.0), (0.48, 3.0), (0.58, 3.0), (2.5, 16.0))
DOWNWARD = math.radians(24)  # of the camera
BACKGROUND = 0.02


def aluminium(sigma0: float, tau: float, **parts) -> HeTorrance:
    lengths = {"sigma0": fixed(sigma0), "tau": fixed(tau), "wavelength": fixed(WAVELENGTHS)}
    return HeTorrance(**lengths, eta=fixed(ETA), k=fixed(K), **parts)


def room(rows: int) -> Environment:
    """Of `rows`, a multiple of 24: each texel is a direction of light, as good as the lobes are wide."""
    light = torch.zeros(24, 48, 3)
    light[:12] = torch.tensor([0.06, 0.065, 0.075])
    light[12:] = torch.tensor([0.06, 0.045, 0.03])
    light[4:20, 5:11] = torch.tensor([0.55, 0.75, 1.0])  # from the left
    light[4:20, 39:41] = torch.tensor([1.4, 0.85, 0.4])  # from the right
    light[4:20, 44:45] = light[4:20, 23:24] = 1.2
    return Environment(light.repeat_interleave(rows // 24, 0).repeat_interleave(rows // 24, 1))


def seen_from_above(size: int) -> Surface:
    camera = pinhole(size, size * 5 // 6, field_of_view=24)
    c, s = math.cos(DOWNWARD), math.sin(DOWNWARD)
    turn = torch.tensor([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]], dtype=torch.float64)
    above = PinholeCamera(camera.intrinsics, camera.extrinsics @ turn, camera.height.long(), camera.width.long())
    return perspective(Cylinder(radius=0.6, half_height=0.76), above, samples=3)


def edges(surface: Surface) -> Tensor:
    """Pixels (rows, columns) at the outline and at the rim of the lid: rough sides are smooth elsewhere."""
    whole = (surface.normals[..., 1] * surface.mask + 2.0 * ~surface.mask)[None]
    highest, lowest = (torch.nn.functional.max_pool2d(sign * whole, surface.samples)[0] for sign in (1, -1))
    return highest > -lowest


def picture(scene: Scene, model: HeTorrance) -> Tensor:
    """For the display (rows, columns, 3)."""
    covered = scene.surface.coverage()[..., None]
    linear = render(scene, model)[0].minimum(covered) + BACKGROUND * (1 - covered)
    return linear_rgb_to_rgb(linear.movedim(-1, 0)).movedim(0, -1)


@torch.no_grad()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the picture")
    parser.add_argument("--size", type=int, default=168, help="rows of a cylinder's picture")
    parser.add_argument("--room", type=int, default=24, help="rows of the map of the room, a multiple of 24")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    surface = seen_from_above(args.size)
    scene = Scene(surface, [room(args.room)])
    coarse = Scene(surface, [room(args.room)], fully_sampled=edges(surface))
    shown = {f"sigma0 {sigma0}, tau {tau:g}": aluminium(sigma0, tau) for sigma0, tau in ROUGHNESS}
    shown["sigma0 0"] = aluminium(0.0, 3.0, directional_diffuse=False)
    shown["uniform diffuse alone"] = aluminium(0.0, 3.0, diffuse=fixed(0.9), specular=False, directional_diffuse=False)
    figure = Figure(figsize=(9.6, 6.1), dpi=90, layout="constrained")
    axes = figure.subplots(2, 4)
    for axis, (title, model) in zip(axes.flat, shown.items(), strict=True):
        axis.imshow(picture(scene if model.sigma0 == 0 else coarse, model).numpy())
        axis.set_title(f"{title} um" if "tau" in title else title, fontsize=11)
        axis.set_axis_off()
        print(title, flush=True)
    path = args.output / "he_torrance_cylinders.png"
    figure.savefig(path)
    print(f"Picture: {path}")


if __name__ == "__main__":
    main()
