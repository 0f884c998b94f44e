"""How far the checked-in fit is from the exact model, on points of a given seed: every figure of its docstring.

python examples/fast_fit/report.py [--seed 61]
"""

import argparse
import math

import torch
from reference import ALBEDOS, Points, Quadrature, Truth, exact, reported_points
from torch import Tensor

from torchbrdf import FastRoughSurface, fast_rough_surface, fixed

ROUGHNESSES = (2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)  # degrees
DERIVED = (2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0)
FURNACE = torch.tensor([0, 20, 40, 60, 70, 75, 80, 83, 85], dtype=torch.float64)  # degrees
COUNT = 800  # directions
STEP = 1e-4  # [rad] of the difference by sigma
TWICE = Quadrature(panel=16, azimuth=24, slopes=128, modes=16, later=16)


def rms(error: Tensor) -> float:
    return float(error.square().mean().sqrt())


def said(error: Tensor) -> str:
    return f"{rms(error):.3f}/{error.abs().max():.2f}"


def errors(points: Points, truth: Truth) -> tuple[Tensor, Tensor]:
    """Fit over exact less 1, of two and of all bounces (n, S, albedo). [%]"""
    cosines = points.cosines()
    two = fast_rough_surface(cosines, albedo=ALBEDOS, sigma=points.sigma, bounces=2)
    every = fast_rough_surface(cosines, albedo=ALBEDOS, sigma=points.sigma, bounces="all")
    return 100 * (two / truth.two(ALBEDOS) - 1), 100 * (every / truth.all() - 1)


def print_errors(label: str, points: Points, truth: Truth) -> None:
    """Root mean square and largest error in %, by number of bounces and albedo."""
    two, every = errors(points, truth)
    cells = [said(two), said(every[..., :-1]), said(every[..., -1])]
    print("{}: two bounces {}, all {} (rho .1 to .9), {} (rho 1)".format(label, *cells), flush=True)


def report(seed: int) -> None:
    print(f"\nrms/largest error in %, rho {ALBEDOS.tolist()}, sigma 2 to 60 deg")
    for low, high in ((0, 80), (0, 85), (85, 89)):
        points = reported_points(COUNT, seed, low, high)
        print_errors(f"larger angle {low} to {high} deg", points, exact(points))
    crowded = reported_points(COUNT, seed + 1, 0, 85, crowded=True)
    print_errors("crowded at grazing, in the plane of incidence and at light = view", crowded, exact(crowded))
    points = reported_points(COUNT // 3, seed + 2, 0, 85, sigma=ROUGHNESSES)
    truth = exact(points)
    two, every = errors(points, truth)
    for k, degrees in enumerate(ROUGHNESSES):
        by_albedo = " ".join(said(e) for e in every[:, k].unbind(-1))
        print(f"  sigma {degrees:2.0f} deg: two {said(two[:, k])}; all, by albedo {by_albedo}")
    print("white furnace: directional albedo at rho = 1 less 1, in 1e-3, at", FURNACE.int().tolist())
    for degrees in ROUGHNESSES:
        sigma = torch.tensor(math.radians(degrees), dtype=torch.float64)
        white = FastRoughSurface(albedo=fixed(torch.ones_like(sigma)), sigma=fixed(sigma))
        got = white.directional_albedo(torch.deg2rad(FURNACE).cos(), nodes=128)[:, 0] - 1
        print(f"  sigma {degrees:2.0f} deg: " + " ".join(f"{1000 * g:6.2f}" for g in got.tolist()))
    print_derivatives(seed + 3)
    print_convergence(seed + 4)


def print_derivatives(seed: int) -> None:
    """d/dsigma against central differences of the exact model, over its rms."""
    points = reported_points(COUNT // 4, seed, 0, 85, sigma=DERIVED)
    high, low = exact(points.moved(STEP)), exact(points.moved(-STEP))
    cosines, one = points.cosines(), torch.ones_like(points.sigma)
    print(f"derivative by sigma: rms error in % of its rms, at rho {ALBEDOS.tolist()} | two bounces || all")
    columns = []
    for bounces, above, below in ((2, high.two(ALBEDOS), low.two(ALBEDOS)), ("all", high.all(), low.all())):
        expected = (above - below) / (2 * STEP)

        def value(sigma: Tensor, bounces=bounces) -> Tensor:
            return fast_rough_surface(cosines, albedo=ALBEDOS, sigma=sigma, bounces=bounces)

        slope = torch.func.jvp(value, (points.sigma,), (one,))[1]
        columns.append(100 * (slope - expected).square().mean(0).sqrt() / expected.square().mean(0).sqrt())
    for degrees, *rows in zip(DERIVED, *columns, strict=True):
        print(f"  sigma {degrees:2.0f} deg: " + " || ".join(" ".join(f"{x:.1f}" for x in row) for row in rows))


def print_convergence(seed: int) -> None:
    """The quadrature of the reference against one of twice the order."""
    for low, high in ((0, 85), (85, 89.9)):
        points = reported_points(COUNT // 80, seed, low, high)
        truth, better = exact(points), exact(points, TWICE)
        two = truth.two(ALBEDOS) / better.two(ALBEDOS) - 1
        every = truth.all() / better.all() - 1
        print(f"reference to {high} deg, orders doubled: {two.abs().max():.1e} (two), {every.abs().max():.1e} (all)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Judge FastRoughSurface.")
    parser.add_argument("--seed", type=int, default=61)
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    report(parser.parse_args().seed)
