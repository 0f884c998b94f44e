"""Fit real photographs of an object of known shape: one roughness, an albedo for every pixel.

By default the matte gray sphere of the photometric-stereo set of S. Seitz (12 photographs), where
that folder is at hand; otherwise a synthetic stack of a sphere, written and read back.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import torch

from inverse import Distant, Scene, Sensor, bootstrap, fit, read_stack, render, sphere, usable, write_stack
from inverse.figures import residual_figure
from torchbrdf import Lambert, OrenNayar, QualitativeOrenNayar, sigma_from_degrees

GRAY_SPHERE = Path("../shared/data/gray_sphere")
LINE = "sphere 244.5 144.5 108"  # centre and radius in pixels


def synthetic(folder: Path, size: int) -> Path:
    lights = [Distant(torch.tensor([x, y, 1.0])) for x, y in ((0, 0), (0.6, 0), (-0.5, 0.3), (0, -0.7), (0.3, 0.5))]
    scene = Scene(sphere(size, size), lights, Sensor(exposure=3.0, read_noise=0.005))
    clay = OrenNayar(albedo=torch.tensor([0.6, 0.5, 0.4]), sigma=sigma_from_degrees(15))
    photographs = scene.sensor.expose(render(scene, clay), torch.Generator().manual_seed(0)).detach()
    write_stack(folder, photographs, scene, overwrite=True)
    print("Photographs: synthetic, made by OrenNayar with sigma = 15 deg.")
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the figure")
    parser.add_argument("--size", type=int, default=200, help="of the synthetic stack, in pixels")
    parser.add_argument("--refits", type=int, default=30, help="bootstrap samples of the images")
    parser.add_argument("--synthetic", action="store_true", help="do not use the gray sphere")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    real = GRAY_SPHERE.is_dir() and not args.synthetic
    stack = read_stack(GRAY_SPHERE, geometry=LINE) if real else read_stack(synthetic(args.output / "stack", args.size))
    # irradiances are in units that make a white surface facing the light full scale, unless stated
    scene = stack.scene if stack.sensor_stated else replace(stack.scene, sensor=Sensor(exposure=torch.pi))
    photographs = stack.images.mean(-1, keepdim=True)  # grey: the three channels say the same of sigma
    valid = usable(scene, limb=70, highlight=20, shadow=75)
    points = int(scene.surface.mask.sum())
    print(f"{scene.images} images, {points} object pixels, {int(valid.sum())} samples away from limb and highlight.\n")
    albedo = torch.full((points, 1), 0.5)
    fitted = {}
    for model in (Lambert(albedo=albedo), QualitativeOrenNayar(albedo=albedo), OrenNayar(albedo=albedo)):
        found = fit(scene, photographs, model, valid=valid)
        fitted[type(model).__name__] = found
        print(found, "\n")
    spread = bootstrap(scene, photographs, QualitativeOrenNayar(albedo=albedo), samples=args.refits, valid=valid)
    sigma = fitted["QualitativeOrenNayar"]
    print(f"QualitativeOrenNayar: sigma {sigma.estimate('sigma')} counts the noise of the pixels alone;")
    print(f"refits to {args.refits} bootstrap samples of the images: +- {torch.rad2deg(spread['sigma']):.1f} deg.")
    print("Errors of lights and shape are shared by all pixels of an image: only the second number sees them.")
    rms = {name: found.residual_rms for name, found in fitted.items()}
    gain = 1 - (rms["QualitativeOrenNayar"] / rms["Lambert"]) ** 2
    print(f"Oren-Nayar explains {gain:.1%} of the variance that Lambert leaves; the figure shows where it does not.")
    shown = {name: render(scene, found.model).detach() * scene.sensor.exposure for name, found in fitted.items()}
    path = args.output / "photographs_fit.png"
    residual_figure(path, scene, photographs, shown, valid)
    print(f"Figure: {path}")


if __name__ == "__main__":
    main()
