"""Recover roughness and albedo of a clay vase from two photographs, lit from 0 and 20 degrees.

The photographs are synthetic: sigma = 40 degrees and rho = 0.7, blurred (0.7 pixel), noisy (1 % of the peak)
and quantised to 12 bits. They are made by the exact V-cavity model with all bounces (24 slopes), or by a random
heightfield (`--truth heightfield`). Every kind of rung of the ladder is fitted to them; the exact model with all
bounces through its table (`InterpolatedRoughSurface`), which is built at the first run and kept.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from inverse import Distant, Scene, Sensor, cross_section, fit, peak_position, render, usable, vase
from inverse.figures import fit_figure
from torchbrdf import RoughSurface, sigma_from_degrees
from torchbrdf.accuracy import DIFFUSE_RUNGS, RUNGS, heightfield_reference

SIGMA_DEGREES, ALBEDO = 40.0, 0.7
FITTED = (
    "Lambert", "qualitative (0.33)", "functional", "closed form, K = 16", "fast, all bounces",
    "interpolated, all bounces", "exact, K = 16, 2 bounces", "fast heightfield",
)  # fmt: skip


def grooves(albedo: torch.Tensor, sigma: torch.Tensor) -> RoughSurface:
    return RoughSurface(albedo=albedo, sigma=sigma, nodes=24, bounces="all")


# By name: what makes the photographs, what it is called, and the rungs that the figure shows.
TRUTHS = {
    "grooves": (grooves, "the exact model with all bounces", ("Lambert", "interpolated, all bounces")),
    "heightfield": (heightfield_reference, "a random heightfield", ("Lambert", "fast heightfield")),
}


def at_limb(position: np.ndarray, brightness: np.ndarray) -> str:
    """Brightness close to both limbs, relative to the brightest."""
    left, right = (brightness[np.abs(position - x) < 0.03].mean() / brightness.max() for x in (-0.9, 0.9))
    return f"at -0.9 {left:.2f} and at +0.9 {right:.2f} of the peak"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=512, help="image side in pixels")
    parser.add_argument("--truth", choices=TRUTHS, default="grooves", help="the surface that is photographed")
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the figure")
    args = parser.parse_args()

    lights = [Distant.from_angle(0), Distant.from_angle(20)]
    surface = vase(args.size, args.size)
    build, described, shown = TRUTHS[args.truth]
    with torch.no_grad():
        clay = build(torch.tensor(ALBEDO), sigma_from_degrees(SIGMA_DEGREES))
        radiance = render(Scene(surface, lights), clay)
    peak = 0.8  # of full scale
    sensor = Sensor(exposure=peak / radiance.max().item(), psf_sigma=0.7, read_noise=0.01 * peak, bits=12)
    scene = Scene(surface, lights, sensor)
    photographs = sensor.expose(radiance, torch.Generator().manual_seed(1))

    print(f"Photographs: made by {described}, sigma = {SIGMA_DEGREES:g} deg, rho = {ALBEDO:g}.\n")
    print(f"{'model':<28}{'sigma':<24}{'rho':<24}{'residual rms':<14}time")
    valid = usable(scene, limb=85.0, shadow=85.0)
    renderings = {}
    for rung in ({k.name: k for k in (*RUNGS, *DIFFUSE_RUNGS) if k.name in FITTED}).values():
        found = fit(scene, photographs, rung.build(torch.tensor(0.5), torch.tensor(0.3)), valid=valid)
        sigma = found.estimate("sigma") if "sigma" in found.parameters else "0 (by definition)"
        rho = found.estimate("albedo")
        print(f"{rung.name:<28}{sigma:<24}{rho:<24}{found.residual_rms:<14.4f}{found.seconds:.2f} s")
        if rung.name in shown:
            with torch.no_grad():
                renderings[rung.name.split(",")[0]] = sensor.focus(render(scene, found.model)) * sensor.exposure

    print("\nCross-section of the belly (position -1 at the left limb, +1 at the right):")
    width = max(10, *map(len, renderings))
    for k, angle in enumerate((0, 20)):
        rows = args.size // 16  # averaged, so that the noise does not choose the brightest place
        position, seen = cross_section(photographs[k], surface, rows=rows)
        brightest = peak_position(position, seen)
        print(f"  light {angle} deg: photograph brightest at {brightest:+.2f}, {at_limb(position, seen)}")
        for name, images in renderings.items():
            _, values = cross_section(images[k], surface, rows=rows)
            rms = ((values - seen) ** 2).mean() ** 0.5 / seen.max()
            displaced = f"peak displaced by {peak_position(position, values) - brightest:+.2f}, " if angle else ""
            limbs = displaced + at_limb(position, values)
            print(f"    {name:<{width}} {limbs}, rms over the section {rms:.1%} of the peak")

    args.output.mkdir(parents=True, exist_ok=True)
    title = f"Photographs made by {described} (sigma 40 deg, rho 0.7); Lambert and the model, fitted"
    path = args.output / ("vase_fit.png" if args.truth == "grooves" else f"vase_fit_{args.truth}.png")
    fit_figure(surface, photographs, renderings, ["light 0 deg", "light 20 deg"], title=title).savefig(path)
    print(f"\nFigure: {path}")


if __name__ == "__main__":
    main()
