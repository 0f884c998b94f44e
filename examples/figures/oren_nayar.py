"""The figures of Oren and Nayar's paper: radiance against viewing angle, spheres, and a scene of three objects.

"integral" is the numerical model (two bounces, 32 slopes) that the approximations stand for. Radiances are for an
irradiance of 1; positive viewing angles are on the light's side. Figure 10 shows the BRDF, as in the paper, and
Figures 15 to 18 the radiance over its value at a viewing angle of 0.
"""

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

import torch
from matplotlib.figure import Figure
from torch import Tensor

from inverse import Distant, Scene, cuboid, cylinder, render, side_by_side, sphere, vase
from torchbrdf import BRDF, Cosines, OrenNayar, QualitativeOrenNayar, RoughSurface, fixed, sigma_from_degrees

SAMPLES = {  # figure: sample, sigma [deg], rho, (theta_i, dphi) [deg]
    15: ("wall plaster A", 30, 0.90, ((30, 0), (45, 0), (60, 0))),
    16: ("painted sandpaper B", 40, 0.80, ((30, 0), (45, 0), (60, 0))),
    17: ("white sand C", 35, 0.80, ((30, 0), (45, 0), (60, 0))),
    18: ("white sand C, out of plane", 35, 0.80, ((60, 45), (75, 60))),
}


def rough(sigma: float, rho: float, bounces: Literal[1, 2] = 2, nodes: int = 32) -> BRDF:
    material = {"albedo": fixed(rho), "sigma": fixed(sigma_from_degrees(sigma))}
    return RoughSurface(**material, nodes=nodes, order=5, bounces=bounces)


def approximation(cls, sigma: float, rho: float) -> BRDF:
    return cls(albedo=fixed(rho), sigma=fixed(sigma_from_degrees(sigma)))


@torch.no_grad()
def reflectance(model: BRDF, theta_i: float, dphi: float, theta_r: Tensor) -> Tensor:
    """f_r (view,) [1/sr] at signed viewing angles (view,) [deg]; dphi is the azimuth on the positive side."""
    t, r, d = math.radians(theta_i), torch.deg2rad(theta_r), math.radians(dphi)
    phase = math.cos(t) * r.cos() + math.sin(t) * r.sin() * math.cos(d)
    return model.evaluate(Cosines.from_products(torch.full_like(r, math.cos(t)), r.cos(), phase))[:, 0]


def radiance(model: BRDF, theta_i: float, dphi: float, theta_r: Tensor) -> Tensor:
    """Radiance (view,) for an irradiance of 1."""
    return reflectance(model, theta_i, dphi, theta_r) * math.cos(math.radians(theta_i))


def over_nadir(model: BRDF, theta_i: float, dphi: float, theta_r: Tensor) -> Tensor:
    return radiance(model, theta_i, dphi, theta_r) / radiance(model, theta_i, dphi, theta_r.new_zeros(1))


class Curves(NamedTuple):
    """One figure: what it plots, and of each line the label, the model, theta_i, dphi [deg] and the style."""

    title: str
    lines: list[tuple[str, BRDF, float, float, str]]
    value: Callable[[BRDF, float, float, Tensor], Tensor] = radiance
    label: str = "radiance for an irradiance of 1 [1/sr]"


def curves() -> dict[int, Curves]:
    figures = {
        8: Curves("sigma 30 deg, rho 0.9, light at 75 deg", [
            ("with interreflection", rough(30, 0.9), 75, 0, "-"), ("without", rough(30, 0.9, 1), 75, 0, "--")]),
        9: Curves("rho 0.9, light at 75 deg", [
            (f"sigma {s} deg", rough(s, 0.9), 75, 0, "-") for s in (0, 10, 20, 40)]),
        10: Curves("BRDF, sigma 40 deg, rho 0.9", [
            (f"light at {t} deg", rough(40, 0.9), t, 0, "-") for t in (0, 30, 60, 75)],
            reflectance, "BRDF [1/sr]"),
        11: Curves("sigma 40 deg, rho 0.9, light at 75 deg", [
            (f"azimuth {d} deg", rough(40, 0.9), 75, d, "-") for d in (0, 60, 90)]),
        12: Curves("integral and functional approximation, sigma 30 deg, rho 0.9", [
            line for t in (30, 60, 75) for line in (
                (f"integral, light at {t} deg", rough(30, 0.9), t, 0, "-"),
                ("functional", approximation(OrenNayar, 30, 0.9), t, 0, ":"))]),
        13: Curves("integral and qualitative model, sigma 30 deg, rho 0.9, light at 75 deg", [
            ("integral", rough(30, 0.9), 75, 0, "-"),
            ("qualitative", approximation(QualitativeOrenNayar, 30, 0.9), 75, 0, ":")]),
    }  # fmt: skip
    for number, (name, sigma, rho, geometries) in SAMPLES.items():
        lines = [(f"light at {t} deg, azimuth {d} deg", rough(sigma, rho), t, d, "-") for t, d in geometries]
        title = f"{name}: model, sigma {sigma} deg, rho {rho:g}"
        figures[number] = Curves(title, lines, over_nadir, "radiance over its value at 0")
    return figures


def draw(number: int, plotted: Curves, theta_r: Tensor) -> Figure:
    figure = Figure(figsize=(6.4, 4.2), dpi=100, layout="constrained")
    axis = figure.subplots()
    for label, model, theta_i, dphi, style in plotted.lines:
        axis.plot(theta_r.numpy(), plotted.value(model, theta_i, dphi, theta_r).numpy(), style, label=label)
    axis.set_title(f"Figure {number}: {plotted.title}", fontsize=10)
    axis.set(xlabel="viewing angle [deg], light's side positive", ylabel=plotted.label, xlim=(-90, 90))
    axis.set_ylim(bottom=0)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    return figure


def pictures(size: int) -> dict[str, Figure]:
    straight, oblique = Distant.from_angle(0), Distant.from_angle(20)
    spheres = Figure(figsize=(10, 2.9), dpi=80, layout="constrained")
    for axis, sigma in zip(spheres.subplots(1, 4), (0, 10, 20, 40), strict=True):
        image = render(Scene(sphere(size, size, samples=2), [straight]), rough(sigma, 0.9, nodes=16))[0, :, :, 0]
        axis.imshow((image / image.max()).numpy(), cmap="gray", vmin=0)
        axis.set(title=f"sigma {sigma} deg")
        axis.set_axis_off()

    objects = [vase(size, size, samples=2), cylinder(size, size, half_height=0.6, samples=2)]
    objects.append(cuboid(size, size, samples=2))
    scene = Figure(figsize=(12, 4.6), dpi=80, layout="constrained")
    for axis, (sigma, light, label) in zip(scene.subplots(2, 2).flat, (
        (0, straight, "smooth, light from the viewer"), (30, straight, "sigma 30 deg, light from the viewer"),
        (0, oblique, "smooth, light at 20 deg"), (30, oblique, "sigma 30 deg, light at 20 deg"),
    ), strict=True):  # fmt: skip
        image = render(Scene(side_by_side(objects), [light]), rough(sigma, 0.9, nodes=16))[0, :, :, 0]
        axis.imshow(image.numpy(), cmap="gray", vmin=0, vmax=0.9 / math.pi)
        axis.set(title=label)
        axis.set_axis_off()
    return {"spheres": spheres, "scene": scene}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the figures")
    parser.add_argument("--size", type=int, default=256, help="rows of the pictures")
    parser.add_argument("--points", type=int, default=359, help="viewing angles of a curve")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    theta_r = torch.linspace(-89.5, 89.5, args.points)
    figures = {f"figure_{number:02d}": draw(number, plotted, theta_r) for number, plotted in curves().items()}
    for name, figure in (figures | pictures(args.size)).items():
        figure.savefig(args.output / f"{name}.png")
        print(args.output / f"{name}.png")


if __name__ == "__main__":
    main()
