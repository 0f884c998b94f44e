"""Recover roughness and albedo of a clay vase from two photographs, lit from 0 and 20 degrees.

The photographs are synthetic: made by the functional Oren-Nayar model with sigma = 40 degrees and
rho = 0.7, then blurred (0.7 pixel), noisy (1 % of the peak) and quantised to 12 bits.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from inverse import Distant, Scene, Sensor, cross_section, fit, peak_position, render, usable, vase
from inverse.plots import fit_figure
from torchbrdf import Lambert, OrenNayar, QualitativeOrenNayar, sigma_from_degrees

SIGMA_DEGREES, ALBEDO = 40.0, 0.7


def at_limb(position: np.ndarray, brightness: np.ndarray) -> str:
    """Brightness close to both limbs, relative to the brightest."""
    left, right = (brightness[np.abs(position - x) < 0.03].mean() / brightness.max() for x in (-0.9, 0.9))
    return f"at -0.9 {left:.2f} and at +0.9 {right:.2f} of the peak"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=512, help="image side in pixels")
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the figure")
    args = parser.parse_args()

    lights = [Distant.from_angle(0), Distant.from_angle(20)]
    surface = vase(args.size, args.size, samples=2)
    clay = OrenNayar(albedo=ALBEDO, sigma=sigma_from_degrees(SIGMA_DEGREES))
    peak = render(Scene(surface, lights), clay).max().item()
    sensor = Sensor(exposure=0.8 / peak, psf_sigma=0.7, read_noise=0.01 * 0.8, bits=12)
    scene = Scene(surface, lights, sensor)
    photographs = sensor.expose(render(scene, clay), torch.Generator().manual_seed(1)).detach()

    print(f"Photographs: made by OrenNayar (functional), sigma = {SIGMA_DEGREES:g} deg, rho = {ALBEDO:g}.\n")
    print(f"{'model':<22}{'sigma':<24}{'rho':<22}{'residual rms':<14}time")
    valid = usable(scene, limb=85.0, shadow=85.0)
    renderings = {}
    for model in (Lambert(), QualitativeOrenNayar(), OrenNayar()):
        found = fit(scene, photographs, model, valid=valid)
        sigma = found.estimate("sigma") if "sigma" in found.parameters else "0 (by definition)"
        rho = found.estimate("albedo")
        print(f"{type(model).__name__:<22}{sigma:<24}{rho:<22}{found.residual_rms:<14.4f}{found.seconds:.2f} s")
        renderings[type(model).__name__] = sensor.focus(render(scene, found.model)).detach() * sensor.exposure

    print("\nCross-section of the belly (position -1 at the left limb, +1 at the right):")
    for k, angle in enumerate((0, 20)):
        position, seen = cross_section(photographs[k], surface)
        peak = peak_position(*cross_section(photographs[k], surface, rows=args.size // 16))
        print(f"  light {angle} deg: photograph brightest at {peak:+.2f}, {at_limb(position, seen)}")
        for name in ("Lambert", "OrenNayar"):
            _, values = cross_section(renderings[name][k], surface)
            displaced = peak_position(position, values) - peak
            rms = ((values - seen) ** 2).mean() ** 0.5 / seen.max()
            print(
                f"    {name:<10} peak displaced by {displaced:+.2f}, {at_limb(position, values)}, "
                f"rms over the section {rms:.1%} of the peak"
            )

    args.output.mkdir(parents=True, exist_ok=True)
    shown = {"Lambert": renderings["Lambert"], "Oren-Nayar": renderings["OrenNayar"]}
    title = "Photographs made by the functional Oren-Nayar model (sigma 40 deg, rho 0.7); Lambert and the model, fitted"
    fit_figure(args.output / "vase_fit.png", surface, photographs, shown, ["light 0 deg", "light 20 deg"], title=title)
    print(f"\nFigure: {args.output / 'vase_fit.png'}")


if __name__ == "__main__":
    main()
