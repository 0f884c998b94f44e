"""Every model at a glance: a sphere and a vase under one light, and the lobes in the plane of incidence.

One lamp at the upper right (a disc of half angle 4 degrees for the polished models, which show it) and one exposure
for all pictures: a white matte surface that faces the lamp is full scale, brighter highlights are clipped, and the
display encoding is sRGB. The mirror stands in a tiled room instead. Beside them f_r against the viewing
angle for light from 20 and 50 degrees (dashed), mean of the channels, in the plane along x; below, the largest f_r.
Thick lines are the mirror directions of polished models, the dotted arc is Lambert's (0.7).
"""

import argparse
import math
import textwrap
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import torch
from kornia.color import linear_rgb_to_rgb
from torch import Tensor

import torchbrdf as tb
from inverse import Disc, Distant, Environment, Scene, Surface, render, side_by_side, sphere, vase

matplotlib.use("Agg")
RHO = {"albedo": 0.7}
SIGMA = {"sigma": tb.sigma_from_degrees(30)}
SLOPE = {"slope": math.radians(35)}
GOLD = tb.Conductor(eta=torch.tensor([0.18, 0.42, 1.37]), k=torch.tensor([3.42, 2.35, 1.77]))
ALONG_X = torch.tensor([1.0, 0.02, 0.03])  # nearly: parallel to no normal of a pixel
COLOURS = torch.tensor([0.65, 0.55, 0.45])  # [um]
GLASS = tb.Dielectric(eta=1.5)
LAMP = torch.tensor([0.5, 0.4, 0.8])
POLISHED = (tb.Coupled, tb.Dampened, tb.Mirror)
INCIDENCE = {"tab:blue": 20, "tab:red": 50}  # [deg]


def brushed(brdf: tb.BRDF) -> tb.BRDF:
    return tb.Oriented(brdf, ALONG_X)


def aluminium(sigma0: float, tau: float) -> tb.HeTorrance:
    eta, k = tb.ALUMINIUM(COLOURS)
    return tb.HeTorrance(sigma0=sigma0, tau=tau, wavelength=COLOURS, eta=eta, k=k)


MODELS = {
    "Lambert\nrho 0.7, as everywhere but where stated": tb.Lambert(**RHO),
    "QualitativeOrenNayar\nsigma 30 deg": tb.QualitativeOrenNayar(**RHO, **SIGMA),
    "OrenNayar\nsigma 30 deg": tb.OrenNayar(**RHO, **SIGMA),
    "FastRoughSurface\nsigma 30 deg": tb.FastRoughSurface(**RHO, **SIGMA),
    "RoughSurface\nsigma 30 deg, all bounces": tb.RoughSurface(**RHO, **SIGMA, bounces="all"),
    "ClosedFormRoughSurface\nsigma 30 deg": tb.ClosedFormRoughSurface(**RHO, **SIGMA),
    "TabulatedRoughSurface\n12 slopes, equal shares": tb.TabulatedRoughSurface(
        **RHO, weights=torch.full((12,), 1 / 12)
    ),
    "AnisotropicRoughSurface\nsigma 45 deg along x, 10 deg along y": brushed(
        tb.AnisotropicRoughSurface(**RHO, sigma_x=math.radians(45), sigma_y=math.radians(10), nodes=8, azimuths=12)
    ),
    "SingleSlopeVCavities\nslope 35 deg": tb.SingleSlopeVCavities(**RHO, **SLOPE),
    "ClosedFormVCavities\nslope 35 deg": tb.ClosedFormVCavities(**RHO, **SLOPE),
    "UnidirectionalVCavities\nslope 35 deg, upright grooves": brushed(tb.UnidirectionalVCavities(**RHO, **SLOPE)),
    "FujiiOrenNayar\nroughness 0.8": tb.FujiiOrenNayar(**RHO, roughness=0.8),
    "EON\nroughness 0.8": tb.EON(**RHO, roughness=0.8),
    "Burley\nroughness 0.8": tb.Burley(**RHO, roughness=0.8),
    "Burley, renormalised\nroughness 0.8": tb.Burley(**RHO, roughness=0.8, renormalised=True),
    "Minnaert\nk 1.4": tb.Minnaert(**RHO, k=1.4),
    "Minnaert\nk 0.7": tb.Minnaert(**RHO, k=0.7),
    "LommelSeeliger\nrho 0.9": tb.LommelSeeliger(albedo=0.9),
    "LambertSphere\nrho 0.9": tb.LambertSphere(albedo=0.9),
    "Hapke\nrho 0.9, asymmetry -0.3, surge 0.5, 0.05": tb.Hapke(albedo=0.9),
    "Coupled\nrho 0.7 under Fresnel 0.04": tb.Coupled(**RHO),
    "Dampened\nrho 0.7 under Fresnel 0.04": tb.Dampened(**RHO),
    "Mirror\ngold, in a tiled room": tb.Mirror(fresnel=GOLD),
    "Phong\nkd 0.5, ks 0.2, exponent 20": tb.Phong(diffuse=0.5, specular=0.2, exponent=20.0),
    "ModifiedPhong\nkd 0.5, ks 0.2, exponent 20": tb.ModifiedPhong(diffuse=0.5, specular=0.2, exponent=20.0),
    "MaxCosinePhong\nkd 0.5, ks 0.2, exponent 20": tb.MaxCosinePhong(diffuse=0.5, specular=0.2, exponent=20.0),
    "TorranceSparrow\nsigma 15 deg, gold": tb.TorranceSparrow(sigma=tb.sigma_from_degrees(15), fresnel=GOLD),
    "OrenNayar + TorranceSparrow\nsigma 30 deg, glass": tb.OrenNayar(**RHO, **SIGMA)
    + tb.TorranceSparrow(**SIGMA, fresnel=GLASS),
    "GGX\nalpha 0.3, gold": tb.GGX(alpha=0.3, fresnel=GOLD),
    "Beckmann\nalpha 0.3, gold": tb.Beckmann(alpha=0.3, fresnel=GOLD),
    "Lambert + GGX\nalpha 0.2, glass": tb.Lambert(**RHO) + tb.GGX(alpha=0.2, fresnel=GLASS),
    "AnisotropicGGX\nalpha 0.5 along x, 0.15 along y, gold": brushed(
        tb.AnisotropicGGX(alpha_x=0.5, alpha_y=0.15, fresnel=GOLD)
    ),
    "AnisotropicBeckmann\nalpha 0.15 along x, 0.5 along y, gold": brushed(
        tb.AnisotropicBeckmann(alpha_x=0.15, alpha_y=0.5, fresnel=GOLD)
    ),
    "AshikhminShirley\nRd 0.5, Rs 0.1, exponents 10, 200": brushed(
        tb.AshikhminShirley(diffuse=0.5, specular=0.1, exponent_x=10.0, exponent_y=200.0)
    ),
    "HeTorrance\nsigma0 0.28, tau 1.77 um, aluminium": aluminium(0.28, 1.77),
    "HeTorrance\nsigma0 0.5, tau 3 um, n 1.5, blue body": tb.HeTorrance(
        sigma0=0.5, tau=3.0, wavelength=COLOURS, eta=1.5, diffuse=torch.tensor([0.1, 0.2, 0.4])
    ),
    "TabulatedBRDF\na table of Lambert + GGX, 45 x 45 x 19": tb.TabulatedBRDF.of(
        tb.Lambert(**RHO) + tb.GGX(alpha=0.2, fresnel=GLASS), dtype=torch.float32
    ),
}


def lobe(model: tb.BRDF, degrees: float, polar: Tensor) -> Tensor:
    """f_r (view,), mean of the channels, for views at signed polar angles [rad]; positive ones on the light's side."""
    normal, light = torch.tensor([0.0, 0.0, 1.0]), torch.tensor(math.radians(degrees))
    light = torch.stack((light.sin(), torch.zeros(()), light.cos()))
    view = torch.stack((polar.sin(), torch.zeros_like(polar), polar.cos()), -1)
    return model(normal, light, view).mean(-1)


def panel(axes, caption: str, image: Tensor, curves: dict[str, np.ndarray], *, polished: bool) -> None:
    """[sphere and vase | lobes], with the name and the parameters above."""
    pictures, lobes = axes
    polar = np.linspace(-np.pi / 2, np.pi / 2, len(next(iter(curves.values()))))
    pictures.imshow(image.numpy())
    name, parameters = caption.split("\n")
    pictures.set_title(name, fontsize=11, loc="left", fontweight="bold", pad=13)
    pictures.text(0, -2, parameters, fontsize=9, va="bottom")
    largest = max(float(curve.max()) for curve in curves.values())
    scale = largest or 1.0
    for (colour, curve), degrees in zip(curves.items(), INCIDENCE.values(), strict=True):
        lobes.plot(curve * np.sin(polar) / scale, curve * np.cos(polar) / scale, color=colour, linewidth=1.3)
        towards = math.radians(degrees)
        lobes.plot((0, math.sin(towards)), (0, math.cos(towards)), color=colour, linewidth=0.7, linestyle="--")
        if polished:
            lobes.plot((0, -math.sin(towards)), (0, math.cos(towards)), color=colour, linewidth=2.5)
    if largest > 0:
        lobes.plot(0.7 / math.pi / scale * np.sin(polar), 0.7 / math.pi / scale * np.cos(polar), "k:", linewidth=0.9)
    lobes.plot((-1, 1), (0, 0), "k", linewidth=0.6)
    lobes.text(0, -0.04, f"{largest:.2g}/sr" if largest > 0 else "nothing else", fontsize=9, ha="center", va="top")
    lobes.set(xlim=(-1.05, 1.05), ylim=(-0.2, 1.05), aspect="equal")
    for axis in axes:
        axis.set_axis_off()


def tiled_room(rows: int = 12) -> Environment:
    """Tiles as wide as high, every other one black, blue above and brown below."""
    tiles = torch.arange(rows)[:, None] + torch.arange(2 * rows)
    colours = torch.tensor([[0.7, 0.85, 1.0], [0.5, 0.3, 0.15]]).repeat_interleave(rows // 2, 0)
    return Environment((tiles % 2)[..., None] * colours[:, None] / math.pi)


def picture(surface: Surface, model: tb.BRDF) -> Tensor:
    """For the display (rows, columns, 3), on white; mixed in linear light, so that edges stay smooth."""
    light = Distant(LAMP)
    if isinstance(model, POLISHED):
        light = Disc(LAMP, half_angle=math.radians(4))
    if isinstance(model, tb.Mirror):
        light = tiled_room()
    covered = surface.coverage()[..., None]
    linear = (render(Scene(surface, [light]), model)[0] * math.pi).clamp(min=0).minimum(covered) + (1 - covered)
    return linear_rgb_to_rgb(linear.expand(-1, -1, 3).movedim(-1, 0)).movedim(0, -1)


@torch.no_grad()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the picture")
    parser.add_argument("--size", type=int, default=128, help="rows of a picture")
    parser.add_argument("--points", type=int, default=721, help="views of a lobe")
    parser.add_argument("--columns", type=int, default=3)
    parser.add_argument("--models", type=int, default=len(MODELS), help="how many")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    n = args.size
    objects = side_by_side([sphere(n, n, samples=3), vase(n, 3 * n // 4, samples=3)])
    shown = list(MODELS.items())[: args.models]
    rows = math.ceil(len(shown) / args.columns)
    figure, axes = plt.subplots(
        rows, 2 * args.columns, figsize=(5.4 * args.columns, 1.68 * rows), width_ratios=(1.2, 1) * args.columns,
        layout="constrained", squeeze=False,
    )  # fmt: skip
    for axis in axes.flat:
        axis.set_axis_off()
    polar = torch.linspace(-math.pi / 2, math.pi / 2, args.points)
    for place, (caption, model) in zip(axes.reshape(-1, 2), shown, strict=False):
        curves = {colour: lobe(model, degrees, polar).numpy() for colour, degrees in INCIDENCE.items()}
        panel(place, caption, picture(objects, model), curves, polished=isinstance(model, POLISHED))
        print(caption.replace("\n", ": "), flush=True)
    figure.supxlabel(textwrap.fill(" ".join(__doc__.split()), 175), fontsize=10)
    path = args.output / "model_gallery.png"
    figure.savefig(path, dpi=80)
    plt.close(figure)
    print(f"Picture: {path}")


if __name__ == "__main__":
    main()
