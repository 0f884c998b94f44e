"""What a picture costs: shadow rays a point and light, and images of one diffuse object, on one core.

    OMP_NUM_THREADS=1 python examples/benchmarks/pictures.py [--size 512] [--repeats 7]

The least of several processor times counts. Images: `size` rows, 2 level lights, 1 and 4 samples a pixel, float32.
Shadows: at half as many rows, 16 lights on the camera's side.
"""

import argparse
import math
import time
from collections.abc import Callable
from functools import partial

import torch

from inverse import Distant, Group, Plane, Scene, Sphere, from_depth, orthographic, render, sphere, vase
from inverse.scene import Footprints
from inverse.transport import Shadows
from torchbrdf import Lambert, OrenNayar

LIGHTS = 16


def seconds(call: Callable[[], object], repeats: int) -> float:
    """Least processor time of a call, after one that warms up."""
    call()
    times = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return min(times)


def rig() -> list[Distant]:
    """Lights all around, 20 to 65 degrees above the image's plane."""
    turns = [(2 * math.pi * k / LIGHTS, math.radians((20, 35, 50, 65)[k % 4])) for k in range(LIGHTS)]
    return [
        Distant(torch.tensor([math.cos(up) * math.cos(turn), math.cos(up) * math.sin(turn), math.sin(up)]))
        for turn, up in turns
    ]


def shadows(size: int, repeats: int) -> None:
    pair = Group(
        (Sphere(0.4, (0.0, -0.3, 0.0)), Plane((0.0, 1.0, 0.3), (0.0, -0.7, 0.0)), Sphere(0.3, (0.6, -0.3, 0.2)))
    )
    front = vase(size, size)
    depth = torch.where(front.mask, 200 - size / 2 * front.points[..., 2], torch.nan)
    surfaces = {
        "vase": front,
        "two spheres on a plane": orthographic(pair, size, size),
        "vase's depth map": from_depth(depth),
    }
    print("| shadows of | ns a point and light |\n|---|---|")
    for name, surface in surfaces.items():
        points = Footprints.of(surface)

        def cast(points: Footprints = points) -> None:
            hidden = Shadows(points.solid, points.points, points.normals)
            for light in rig():
                hidden.clear(light.direction)

        spent = seconds(cast, repeats) / len(points.points) / LIGHTS
        print(f"| {name} | {1e9 * spent:.0f} |")


def images(size: int, repeats: int) -> None:
    print("\n| image of | samples | Lambert [ms] | OrenNayar [ms] |\n|---|---|---|---|")
    lights = [(Distant.from_angle(30), Distant.from_angle(-50))]
    for name, make in (("vase", vase), ("sphere", sphere)):
        for samples in (1, 2):
            scene = Scene(make(size, size, samples=samples), lights)
            spent = [seconds(partial(render, scene, model), repeats) for model in (Lambert(), OrenNayar())]
            print(f"| {name} | {samples**2} | {1e3 * spent[0]:.1f} | {1e3 * spent[1]:.1f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--size", type=int, default=512)
    options = parser.parse_args()
    torch.set_num_threads(1)
    with torch.no_grad():
        shadows(options.size // 2, options.repeats)
        images(options.size, options.repeats)


if __name__ == "__main__":
    main()
