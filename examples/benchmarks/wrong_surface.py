"""What choosing the wrong surface does to sigma and rho: photographs of one surface fitted with models of the other.

The photographs (a vase lit from 0 and 20 degrees, without noise) are made by the exact V-cavity model and by the
Gaussian heightfield. By sigma of the photographs: the miss of sigma, the largest over all rho with its sign; then the
largest miss of rho, and the largest residual, of the peak. EON and Fujii's model have a roughness of their own: the
sigma meant is the one that `torchbrdf.accuracy` converts to it, 60 degrees at most.
"""

import argparse
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from inverse import Distant, FitResult, Scene, Sensor, fit, render, usable, vase
from torchbrdf.accuracy import (
    DIFFUSE_RUNGS,
    Rung,
    eon_roughness_from_sigma,
    fujii_roughness_from_sigma,
    heightfield_reference,
    reference,
)

TRUTHS = {"V-cavities": reference, "heightfield": heightfield_reference}
CONVERSIONS = {"Fujii": fujii_roughness_from_sigma, "EON": eon_roughness_from_sigma}
SLOWEST = "heightfield, 240 nodes"  # within 1e-3 of 160 nodes


class Miss(NamedTuple):
    """Of one fit."""

    sigma: float | None  # [deg]
    rho: float
    residual: float  # rms, of the peak


def as_sigma(result: FitResult, conversion: Callable[[Tensor], Tensor] | None) -> float | None:
    """The fitted sigma [deg], or what the fitted roughness stands for; None of a model that has neither."""
    if conversion is None:
        sigma = result.parameters.get("sigma")
        return None if sigma is None else torch.rad2deg(sigma).item()
    sigmas = torch.deg2rad(torch.arange(0, 60.25, 0.25, dtype=torch.float64))
    place = torch.searchsorted(conversion(sigmas), result.parameters["roughness"].double())
    return torch.rad2deg(sigmas[place.clamp(max=len(sigmas) - 1)]).item()


def misses(rung: Rung, scene: Scene, photographs: Tensor, sigma: float, rho: float) -> Miss:
    valid = usable(scene, limb=85, shadow=85)
    result = fit(scene, photographs, rung.build(torch.tensor(0.5), torch.tensor(0.5)), valid=valid)
    fitted = as_sigma(result, CONVERSIONS.get(rung.name))
    miss = None if fitted is None else fitted - sigma
    peak = photographs.max().item()
    return Miss(miss, result.parameters["albedo"].item() - rho, result.residual_rms / peak)


def row(name: str, by_sigma: dict[float, list[Miss]]) -> str:
    cells = [
        "" if all(k.sigma is None for k in of_rho) else f"{max((k.sigma for k in of_rho), key=abs):+.1f}"
        for of_rho in by_sigma.values()
    ]
    every = [miss for of_rho in by_sigma.values() for miss in of_rho]
    rho, residual = max((k.rho for k in every), key=abs), max(k.residual for k in every)
    return f"| {name} | {' | '.join(cells)} | {rho:+.3f} | {residual:.2%} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=32, help="rows of the vase images")
    parser.add_argument("--sigmas", type=float, nargs="*", default=[10, 20, 30, 40, 50], help="of the photographs, deg")
    parser.add_argument("--rhos", type=float, nargs="*", default=[0.3, 0.6, 0.9])
    parser.add_argument("--rungs", nargs="*", help="names to keep (all but the finest heightfield)")
    args = parser.parse_args()
    rungs = [k for k in DIFFUSE_RUNGS if (k.name in args.rungs if args.rungs else k.name != SLOWEST)]
    scene = Scene(vase(args.size, args.size), [Distant.from_angle(0), Distant.from_angle(20)], Sensor(exposure=1.0))
    for surface, truth in TRUTHS.items():
        table: dict[str, dict[float, list[Miss]]] = {rung.name: {} for rung in rungs}
        for sigma in args.sigmas:
            for rho in args.rhos:
                with torch.no_grad():
                    photographs = render(scene, truth(torch.tensor(rho), torch.deg2rad(torch.tensor(sigma))))
                for rung in rungs:
                    table[rung.name].setdefault(sigma, []).append(misses(rung, scene, photographs, sigma, rho))
        heads = " | ".join(f"{sigma:g} deg" for sigma in args.sigmas)
        print(f"Photographs of {surface}\n\n| fitted with | {heads} | rho | residual |")
        print("|---" * (len(args.sigmas) + 3) + "|")
        for name, by_sigma in table.items():
            print(row(name, by_sigma), flush=True)
        print()


if __name__ == "__main__":
    main()
