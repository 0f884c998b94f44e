"""What the tables of the exact surfaces err by, and what they cost.

Errors are of f_r pi/rho against the references, at random directions, each with a roughness (2 to 60 degrees) and an
albedo (0.1 to 0.95) of its own: grooves against `converged`, which integrates until nothing changes, heightfields
against 560 slopes a direction and the finest table of bounces. A quarter of the azimuths crowds at light = view. Times
are of the processor: of one vase lit by one light, and of building the tables, which `--fresh` does anew in a folder of
its own.
"""

import argparse
import math
import os
import tempfile
import time
from collections.abc import Callable

import torch
from torch import Tensor

from inverse import Distant, Scene, render, vase
from torchbrdf import (
    BRDF,
    Cosines,
    GaussianHeightfield,
    InterpolatedGaussianHeightfield,
    InterpolatedRoughSurface,
    RoughSurface,
    interpolated_gaussian_heightfield,
    interpolated_rough_surface,
)
from torchbrdf.accuracy import converged, heightfield_reference

RANGES = ((0.0, 85.0), (85.0, 89.0), (89.0, 89.9))  # of the more grazing direction [degree]
ROUGHNESSES = 10  # of the heightfields: each needs a table of bounces
REPEATS = 3


def random_angles(count: int, low: float, high: float, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Polar angles and azimuth (count,) [rad]: uniform cosines, one of the angles between low and high [degree]."""
    draw = torch.rand(3, count, dtype=torch.float64, generator=generator)
    start, stop = (math.cos(math.radians(angle)) for angle in (high, low))
    larger = start + (stop - start) * draw[0]
    azimuth = math.pi * draw[2]
    azimuth[::4] *= draw[2, ::4] ** 2
    return larger.acos(), (larger + (1 - larger) * draw[1]).acos(), azimuth


def cosines_of(theta: Tensor, other: Tensor, azimuth: Tensor) -> Cosines:
    zero, one = torch.zeros_like(theta), torch.ones_like(theta)
    light = torch.stack((theta.sin(), zero, theta.cos()), -1)
    view = torch.stack((other.sin() * azimuth.cos(), other.sin() * azimuth.sin(), other.cos()), -1)
    return Cosines.of(torch.stack((zero, zero, one), -1), light, view, normalize=True)


def random_materials(count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Albedo (count, 1) and roughness (count,) [rad]."""
    draw = torch.rand(2, count, dtype=torch.float64, generator=generator)
    return (0.1 + 0.85 * draw[0])[:, None], torch.deg2rad(2 + 58 * draw[1])


def grooves_apart(cosines: Cosines, generator: torch.Generator) -> Tensor:
    """Table less reference, times pi/rho (count, 1)."""
    albedo, sigma = random_materials(len(cosines.light), generator)
    exact = converged(cosines, albedo=albedo, sigma=sigma)
    return (interpolated_rough_surface(cosines, albedo=albedo, sigma=sigma) - exact) * math.pi / albedo


def heightfields_apart(cosines: Cosines, generator: torch.Generator) -> Tensor:
    """The same, on a few roughnesses of many directions each."""
    count = len(cosines.light) // ROUGHNESSES
    albedo, _ = random_materials(count, generator)
    _, sigmas = random_materials(ROUGHNESSES, generator)
    errors = []
    for place, sigma in enumerate(sigmas):
        part = slice(place * count, (place + 1) * count)
        few = Cosines.from_products(cosines.light[part], cosines.view[part], cosines.phase[part])
        exact = heightfield_reference(albedo, sigma).evaluate(few)
        table = interpolated_gaussian_heightfield(few, albedo=albedo, sigma=sigma)
        errors.append((table - exact) * math.pi / albedo)
    return torch.cat(errors)


def seconds(call: Callable[[], object]) -> float:
    """Of one call, the quickest of a few."""
    best = math.inf
    for _ in range(REPEATS):
        began = time.process_time()
        call()
        best = min(best, time.process_time() - began)
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--directions", type=int, default=400, help="in each range of angles")
    parser.add_argument("--size", type=int, default=512, help="image side of the vase in pixels; 0 leaves it out")
    parser.add_argument("--exact-size", type=int, default=64, help="the same for the exact models, scaled up")
    parser.add_argument("--fresh", action="store_true", help="build the tables, in a temporary folder")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, torch.no_grad():
        if args.fresh:
            os.environ["TORCHBRDF_CACHE"] = folder
        report(args)


def report(args: argparse.Namespace) -> None:
    albedo, sigma = torch.tensor(0.7), torch.tensor(0.6)
    surfaces: dict[str, tuple[Callable[[Cosines, torch.Generator], Tensor], BRDF, BRDF]] = {
        "grooves": (
            grooves_apart,
            InterpolatedRoughSurface(albedo=albedo, sigma=sigma),
            RoughSurface(albedo=albedo, sigma=sigma, bounces="all"),
        ),
        "heightfield": (
            heightfields_apart,
            InterpolatedGaussianHeightfield(albedo=albedo, sigma=sigma),
            GaussianHeightfield(albedo=albedo, sigma=sigma),
        ),
    }
    up = torch.tensor([[0.0, 0.0, 1.0]])
    print(f"{'table of':<14}{'first call':>12}" + "".join(f"{f'{a:g} to {b:g} deg':>24}" for a, b in RANGES))
    print(" " * 26 + f"{'rms':>14}{'max':>10}" * len(RANGES))
    for name, (apart, model, _) in surfaces.items():
        began = time.process_time()
        model(up, up, up)
        line = f"{name:<14}{time.process_time() - began:>10.2f} s"
        generator = torch.Generator().manual_seed(0)
        for low, high in RANGES:
            cosines = cosines_of(*random_angles(args.directions, low, high, generator))
            error = apart(cosines, generator)
            line += f"{error.square().mean().sqrt():>14.1e}{error.abs().max():>10.1e}"
        print(line)
    if not args.size:
        return
    print(f"\n{'vase':<14}{'table':>12}{'exact':>12}{'ratio':>9}   processor seconds a picture of {args.size}^2")
    for name, (_, model, exact) in surfaces.items():
        table_scene, exact_scene = (
            Scene(vase(size, size), [Distant.from_angle(20)]) for size in (args.size, args.exact_size)
        )
        fast = seconds(lambda scene=table_scene, model=model: render(scene, model))
        slow = seconds(lambda scene=exact_scene, model=exact: render(scene, model))
        slow *= (args.size / args.exact_size) ** 2
        print(f"{name:<14}{fast:>12.3f}{slow:>12.2f}{slow / fast:>9.0f}")


if __name__ == "__main__":
    main()
