"""Fit photographs of an object of known shape: one roughness, an albedo for every pixel.

FOLDER holds your photographs (`pydoc inverse.files.stacks` tells its layout). The numbers in docs/fitting.md are those
of the matte gray sphere of S. Seitz's photometric-stereo set: 12 photographs, `--geometry "sphere 244.5 144.5 108"`.
Without FOLDER five photographs of a sphere are made, written to disk and read back.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import torch

from inverse import (
    Distant,
    Photographs,
    Scene,
    Sensor,
    bootstrap,
    fit,
    read_stack,
    render,
    sphere,
    usable,
    write_stack,
)
from inverse.figures import residual_figure
from torchbrdf import Lambert, OrenNayar, QualitativeOrenNayar, sigma_from_degrees


def synthetic(size: int) -> Photographs:
    lights = [Distant(torch.tensor([x, y, 1.0])) for x, y in ((0, 0), (0.6, 0), (-0.5, 0.3), (0, -0.7), (0.3, 0.5))]
    scene = Scene(sphere(size, size), lights, Sensor(exposure=torch.pi, read_noise=0.005))
    clay = OrenNayar(albedo=torch.tensor([0.6, 0.5, 0.4]), sigma=sigma_from_degrees(15))
    images = scene.sensor.expose(render(scene, clay).detach(), torch.Generator().manual_seed(0))
    print("Photographs: synthetic, made by OrenNayar with sigma = 15 deg and rho = 0.5 on average.")
    with TemporaryDirectory() as folder:
        stack = Path(folder) / "stack"
        write_stack(stack, images, scene)
        return read_stack(stack)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="of photographs; without it they are synthetic")
    parser.add_argument("--geometry", metavar="LINE", help="instead of the folder's geometry.txt")
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the figure")
    parser.add_argument("--size", type=int, default=200, help="of the synthetic photographs, in pixels")
    parser.add_argument("--refits", type=int, default=30, help="bootstrap samples of the images")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    stack = read_stack(args.folder, geometry=args.geometry) if args.folder else synthetic(args.size)
    # irradiances are in units that make a white surface facing the light full scale, unless stated
    scene = stack.scene if stack.sensor_stated else replace(stack.scene, sensor=Sensor(exposure=torch.pi))
    photographs = stack.images.mean(-1, keepdim=True)  # grey: the three channels say the same of sigma
    valid = usable(scene, limb=70, highlight=20, shadow=75)
    points = int(scene.surface.mask.sum())
    print(f"{scene.images} images, {points} object pixels, {int(valid.sum())} samples away from limb and highlight.\n")
    albedo = torch.full((points, 1), 0.5)
    fits = {}
    for model in (Lambert(albedo=albedo), QualitativeOrenNayar(albedo=albedo), OrenNayar(albedo=albedo)):
        result = fit(scene, photographs, model, valid=valid)
        fits[type(model).__name__] = result
        print(result, "\n")
    spread = bootstrap(scene, photographs, QualitativeOrenNayar(albedo=albedo), samples=args.refits, valid=valid)
    sigma = fits["QualitativeOrenNayar"]
    print(f"QualitativeOrenNayar: sigma {sigma.estimate('sigma')} counts the noise of the pixels alone;")
    print(f"refits to {args.refits} bootstrap samples of the images: +- {torch.rad2deg(spread['sigma']):.1f} deg.")
    print("Errors of lights and shape are shared by all pixels of an image: only the second number sees them.")
    rms = {name: result.residual_rms for name, result in fits.items()}
    gain = 1 - (rms["QualitativeOrenNayar"] / rms["Lambert"]) ** 2
    print(f"Oren-Nayar explains {gain:.1%} of the variance that Lambert leaves; the figure shows where it does not.")
    shown = {name: render(scene, result.model).detach() * scene.sensor.exposure for name, result in fits.items()}
    path = args.output / "photographs_fit.png"
    residual_figure(scene, photographs, shown, valid).savefig(path)
    print(f"Figure: {path}")


if __name__ == "__main__":
    main()
