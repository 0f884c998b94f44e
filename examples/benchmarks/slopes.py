"""Error of `RoughSurface` by number of slopes and by grazing angle, against the converged integral of two bounces.

Directions are random, a quarter of them in the plane of incidence; sigma is random from 1e-3 rad to 90 deg.
One thread: OMP_NUM_THREADS=1 python examples/benchmarks/slopes.py --directions 200
"""

import argparse
import math

import torch
from torch import Tensor

from torchbrdf import RoughSurface, fixed
from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles

DOUBLE = torch.float64
BANDS = ((0.0, 85.0), (85.0, 89.0), (89.0, 89.9))  # of the more grazing direction [degree]
ALBEDOS = (0.05, 0.5, 1.0)


def errors(
    count: int, band: tuple[float, float], numbers: tuple[int, ...], seed: int
) -> tuple[dict[int, Tensor], float]:
    """By number of slopes: relative errors; and the least reflectance of all [1/sr]."""
    generator = torch.Generator().manual_seed(seed)
    u = torch.rand(4, count, generator=generator, dtype=DOUBLE)
    light = torch.deg2rad(band[0] + (band[1] - band[0]) * u[0])
    view = light * u[1].sqrt()
    azimuth = math.pi * u[2]
    azimuth[::8], azimuth[4::8] = math.pi, 0.0
    sigma = 1e-3 * (500 * math.pi) ** u[3]
    plane = slope_plane_from_angles(light, view, azimuth)
    exact = converged(plane, sigma, panel_order=10, order=16)
    found, least = {}, math.inf
    for nodes in numbers:
        images = RoughSurface(nodes=nodes).double().images(*plane)
        parts = []
        for albedo in ALBEDOS:
            model = RoughSurface(albedo=fixed(torch.tensor(albedo, dtype=DOUBLE)), sigma=fixed(sigma), nodes=nodes)
            value = (images * model.coefficients()[..., 0, :]).sum(-1).detach()
            parts.append(value / (albedo * exact.direct + albedo**2 * exact.two_bounce) - 1)
            least = min(least, value.min().item())
        found[nodes] = torch.stack(parts)
    return found, least


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--directions", type=int, default=200, help="in each band of angles")
    parser.add_argument("--nodes", type=int, nargs="+", default=[8, 16, 48])
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    by_band = [errors(args.directions, band, tuple(args.nodes), args.seed) for band in BANDS]
    print("| nodes | " + " | ".join(f"{low:g} to {high:g} deg, max (rms)" for low, high in BANDS) + " |")
    print("|---" * (1 + len(BANDS)) + "|")
    for nodes in args.nodes:
        cells = (f"{e[nodes].abs().max():.1e} ({e[nodes].square().mean().sqrt():.0e})" for e, _ in by_band)
        print(f"| {nodes} | " + " | ".join(cells) + " |")
    print(f"\nLeast reflectance: {min(least for _, least in by_band):.2g} /sr")


if __name__ == "__main__":
    main()
