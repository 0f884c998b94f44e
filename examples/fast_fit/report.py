"""How far the checked-in fit is from the exact model, on points of a given seed: every figure of its docstring.

python examples/fast_fit/report.py [--seed 61]
"""

import argparse
import math

import torch
from reference import Sample, directions, exact
from torch import Tensor

from torchbrdf import FastRoughSurface, fast_rough_surface, fixed
from torchbrdf.models.oren_nayar.fast import Bounces

DEGREES = (0.7, 2.5, 5, 7, 11, 15, 21, 28, 36, 45, 52, 60)  # none of them fitted but 5 and 60
ALBEDOS = (0.3, 0.5, 0.7, 0.9, 1.0)
COUNT = 3000
TOP = 85.0  # degrees
STEP = 1e-4  # [rad] of the central difference by sigma
BOUNCES: tuple[Bounces, ...] = (2, "all")
DERIVED = (5, 10, 20, 30, 40, 50, 60)  # degrees


def relative_errors(sample: Sample, bounces: Bounces) -> Tensor:
    """Fit over exact less 1, (P, S, R). [%]"""
    rho = torch.tensor(ALBEDOS, dtype=torch.float64)
    cosines = sample.angles.cosines()
    found = [fast_rough_surface(cosines, albedo=rho, sigma=s, bounces=bounces) for s in sample.sigmas]
    return 100 * (math.pi * torch.stack(found, 1) / sample.total(rho, bounces) - 1)


def rms(error: Tensor) -> Tensor:
    return error.square().mean().sqrt()


def print_values(label: str, seed: int, *, edges: bool) -> None:
    sigmas = torch.deg2rad(torch.tensor(DEGREES, dtype=torch.float64))
    sample = exact(directions(seed, COUNT, TOP, edges=edges), sigmas, albedos=ALBEDOS)
    errors = {bounces: relative_errors(sample, bounces) for bounces in BOUNCES}
    print(f"\n{label}: max/rms % at rho = {ALBEDOS} | two bounces || all bounces")
    for k, degrees in enumerate(DEGREES):
        cells = [" ".join(f"{e.abs().max():.2f}/{rms(e):.3f}" for e in error[:, k].T) for error in errors.values()]
        print(f"{degrees:5.1f}  {cells[0]}  ||  {cells[1]}")
    for bounces, error in errors.items():
        for name, some in (("0.3..0.9", error[..., :4]), ("1", error[..., 4:])):
            print(f"  all sigma, rho {name}, bounces={bounces}: max {some.abs().max():.2f} rms {rms(some):.3f}")


def print_derivatives(seed: int) -> None:
    """d/dsigma against central differences of the exact model, relative to its rms over the directions."""
    sigmas = torch.deg2rad(torch.tensor(DERIVED, dtype=torch.float64))
    angles = directions(seed, 1000, TOP, edges=False)
    sample = exact(angles, torch.cat((sigmas - STEP, sigmas + STEP)), albedos=ALBEDOS)
    rho, cosines, count = torch.tensor(ALBEDOS, dtype=torch.float64), angles.cosines(), len(DERIVED)
    print("\nderivative by sigma: rms % of its own rms at the same rho | two bounces || all bounces")
    for k, degrees in enumerate(DERIVED):
        cells = []
        for bounces in BOUNCES:
            total = sample.total(rho, bounces)
            expected = (total[:, k + count] - total[:, k]) / (2 * STEP)

            def value(sigma: Tensor, bounces: Bounces = bounces) -> Tensor:
                return math.pi * fast_rough_surface(cosines, albedo=rho, sigma=sigma, bounces=bounces)

            found = torch.func.jvp(value, (sigmas[k],), (torch.ones_like(sigmas[k]),))[1]
            ratios = (found - expected).square().mean(0).sqrt() / expected.square().mean(0).sqrt()
            cells.append(" ".join(f"{100 * r:.1f}" for r in ratios))
        print(f"{degrees:5.1f}  {cells[0]}  ||  {cells[1]}")


def print_furnace() -> None:
    """Light returned at rho = 1: the exact surface returns all of it."""
    cosine = torch.deg2rad(torch.tensor((0.0, 30, 50, 65, 75, 80, 85), dtype=torch.float64)).cos()
    print("\ndirectional albedo at rho = 1, all bounces, less 1 (%): worst over 0..85 degrees")
    for degrees in (5, 10, 20, 30, 40, 50, 60, 90):
        sigma = torch.deg2rad(torch.tensor(degrees, dtype=torch.float64))
        model = FastRoughSurface(albedo=fixed(torch.ones_like(sigma)), sigma=fixed(sigma), bounces="all")
        excess = 100 * (model.directional_albedo(cosine, nodes=128) - 1)
        print(f"{degrees:5.1f}  {excess.min():+.2f} {excess.max():+.2f}")


def report(seed: int) -> None:
    print_values("REPORT, uniform", seed, edges=False)
    print_values("REPORT, edges", seed + 1, edges=True)
    print_derivatives(seed + 2)
    print_furnace()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=61)
    torch.set_num_threads(1)
    report(parser.parse_args().seed)
