"""What a roughness is called by other models: the table of docs/models.md.

Sigma, rms slope and Beckmann's alpha by formula; the roughness of EON and of Fujii's model with the least rms relative
error against the Gaussian heightfield, the albedo kept, and that error. `--constants` prints what the library
interpolates in (`torchbrdf/accuracy/conversions.py`).
"""

import argparse
import math

import numpy as np
from torch import Tensor

from torchbrdf import BRDF, EON, FujiiOrenNayar, fixed, rms_slope_from_sigma, sigma_from_degrees
from torchbrdf.accuracy import fitted_roughness


def eon(albedo: Tensor, roughness: Tensor) -> BRDF:
    return EON(albedo=albedo, roughness=fixed(roughness))


def fujii(albedo: Tensor, roughness: Tensor) -> BRDF:
    return FujiiOrenNayar(albedo=albedo, roughness=fixed(roughness))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sigmas", type=float, nargs="*", default=[5, 10, 15, 20, 25, 30, 35, 40, 50, 60], help="deg")
    parser.add_argument("--constants", action="store_true", help="every 2.5 degrees, for the library")
    args = parser.parse_args()
    if args.constants:
        for build in (eon, fujii):
            roughness = [fitted_roughness(build, sigma_from_degrees(k))[0].item() for k in np.arange(0, 62.5, 2.5)]
            print(f"{build.__name__}: {', '.join(f'{r:g}' for r in roughness)}")
        return
    print("| sigma [deg] | rms slope | Beckmann alpha | EON r (rms error) | Fujii r (rms error) |")
    print("|---|---|---|---|---|")
    for degrees in args.sigmas:
        sigma = sigma_from_degrees(degrees)
        slope = rms_slope_from_sigma(sigma).item()
        legacy = [
            f"{r.item():.2f} ({error.item():.0%})" for r, error in (fitted_roughness(k, sigma) for k in (eon, fujii))
        ]
        print(f"| {degrees:g} | {slope:.3f} | {math.sqrt(2) * slope:.3f} | {legacy[0]} | {legacy[1]} |")


if __name__ == "__main__":
    main()
