"""How far the checked-in fit is from the reference, on points of a given seed: every figure of its docstring.

python examples/fast_heightfield/report.py [--seed 61]
"""

import argparse
import math

import torch
from reference import Points, Reference, fitted_points, reported_points, totals
from torch import Tensor

from torchbrdf import FastGaussianHeightfield, fast_gaussian_heightfield, fixed

ALBEDOS = torch.tensor([0.1, 0.3, 0.5, 0.7, 0.9, 0.95], dtype=torch.float64)
ROUGHNESSES = (2, 5, 10, 20, 30, 40, 50, 60)  # degrees
FURNACE = torch.tensor([0, 20, 40, 60, 70, 75, 80, 83, 85], dtype=torch.float64)  # degrees
STEP = 1e-5  # [rad] of the difference by sigma


def rms(error: Tensor) -> float:
    return float(error.square().mean().sqrt())


def errors(reference: Reference, points: Points, albedos: Tensor = ALBEDOS) -> Tensor:
    """Fit over reference less 1, (n, albedo). [%]"""
    truth = totals(reference.orders(points), albedos)
    f = fast_gaussian_heightfield(points.cosines(), albedo=albedos, sigma=points.sigma)
    return 100 * (f / truth - 1)


def print_errors(label: str, reference: Reference, points: Points) -> None:
    error = errors(reference, points)
    print(f"{label}: rms {rms(error):.3f} %, at most {error.abs().max():.2f} %", flush=True)


def report(reference: Reference, seed: int) -> None:
    print(f"\nerrors in %, rho {ALBEDOS.tolist()}, sigma 2..60 deg")
    for low, high in ((0, 80), (0, 85), (85, 89)):
        print_errors(f"larger angle {low} to {high} deg", reference, reported_points(20_000, seed, low, high))
    crowded = fitted_points(20_000, seed, top=85.0)
    inside = (torch.rad2deg(crowded.sigma) >= 2) & (torch.rad2deg(crowded.sigma) <= 60)
    crowded = Points(crowded.light[inside], crowded.view[inside], crowded.dphi[inside], crowded.sigma[inside])
    print_errors("crowded at grazing, in the plane of incidence and at light = view", reference, crowded)
    for degrees in ROUGHNESSES:
        points = reported_points(3000, seed + 1, 0, 85, sigma=(degrees, degrees))
        error = errors(reference, points)
        by_albedo = " ".join(f"{rms(e):.3f}" for e in error.T)
        print(f"  sigma {degrees:2d} deg: rms {rms(error):.3f}, max {error.abs().max():.2f}; by albedo {by_albedo}")
    print("white furnace: directional albedo at rho = 1 less 1, in 1e-3")
    for degrees in ROUGHNESSES:
        sigma = torch.tensor(math.radians(degrees), dtype=torch.float64)
        white = FastGaussianHeightfield(albedo=fixed(torch.tensor(1.0, dtype=torch.float64)), sigma=fixed(sigma))
        got = white.directional_albedo(torch.deg2rad(FURNACE).cos(), nodes=64)[:, 0] - 1
        print(f"  sigma {degrees:2d} deg: " + " ".join(f"{1000 * g:6.2f}" for g in got.tolist()))
    print_derivatives(reference, seed + 2)


def print_derivatives(reference: Reference, seed: int) -> None:
    """d/dsigma against central differences of the reference, over its rms."""
    for degrees in (5, 10, 20, 40, 60):
        points = reported_points(1000, seed, 0, 85, sigma=(degrees, degrees))
        sigma = points.sigma.clone().requires_grad_()
        f = fast_gaussian_heightfield(points.cosines(), albedo=ALBEDOS[3:5], sigma=sigma)
        slope = torch.stack([torch.autograd.grad(c.sum(), sigma, retain_graph=True)[0] for c in f.unbind(-1)], -1)
        moved = [
            totals(reference.orders(Points(points.light, points.view, points.dphi, points.sigma + h)), ALBEDOS[3:5])
            for h in (STEP, -STEP)
        ]
        exact = (moved[0] - moved[1]) / (2 * STEP)
        print(f"derivative by sigma at {degrees} deg: rms error {100 * rms(slope - exact) / rms(exact):.1f} %")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Judge FastGaussianHeightfield.")
    parser.add_argument("--seed", type=int, default=61)
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    report(Reference(), parser.parse_args().seed)
