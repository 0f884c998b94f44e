"""The figures of Oren and Nayar's paper: radiance against viewing angle, spheres, and a scene of three objects.

"integral" is the numerical model (two bounces, 48 slopes) that the approximations stand for. Radiances
are for an irradiance of 1; positive viewing angles are on the light's side.
"""

import argparse
import math
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import torch
from torch import Tensor

from inverse import Distant, Scene, cuboid, cylinder, render, side_by_side, sphere, vase
from torchbrdf import BRDF, Cosines, OrenNayar, QualitativeOrenNayar, RoughSurface, fixed, sigma_from_degrees

matplotlib.use("Agg")
SAMPLES = {  # figure: sample, sigma [deg], rho, (theta_i, dphi) [deg]
    15: ("wall plaster A", 30, 0.90, ((30, 0), (45, 0), (60, 0))),
    16: ("painted sandpaper B", 40, 0.80, ((30, 0), (45, 0), (60, 0))),
    17: ("white sand C", 35, 0.80, ((30, 0), (45, 0), (60, 0))),
    18: ("white sand C, out of plane", 35, 0.80, ((60, 45), (75, 60))),
}


def rough(sigma: float, rho: float, bounces: int = 2, nodes: int = 48) -> BRDF:
    material = {"albedo": fixed(rho), "sigma": fixed(sigma_from_degrees(sigma))}
    return RoughSurface(**material, nodes=nodes, order=8, bounces=bounces)


def approximation(cls, sigma: float, rho: float) -> BRDF:
    return cls(albedo=fixed(rho), sigma=fixed(sigma_from_degrees(sigma)))


def radiance(model: BRDF, theta_i: float, dphi: float, theta_r: Tensor) -> Tensor:
    """Radiance for irradiance 1 at signed viewing angles (view,) [deg]; dphi is the azimuth on the positive side."""
    t, r, d = math.radians(theta_i), torch.deg2rad(theta_r), math.radians(dphi)
    phase = math.cos(t) * r.cos() + math.sin(t) * r.sin() * math.cos(d)
    cosines = Cosines.from_products(torch.full_like(r, math.cos(t)), r.cos(), phase)
    return (model.evaluate(cosines)[:, 0] * math.cos(t)).detach()


def curves() -> dict[str, tuple[str, list]]:
    """File name -> (title, [(label, model, theta_i, dphi, line style)])."""
    found = {
        "figure_08": ("sigma 30 deg, rho 0.9, light at 75 deg", [
            ("with interreflection", rough(30, 0.9), 75, 0, "-"), ("without", rough(30, 0.9, 1), 75, 0, "--")]),
        "figure_09": ("rho 0.9, light at 75 deg", [
            (f"sigma {s} deg", rough(s, 0.9), 75, 0, "-") for s in (0, 10, 20, 40)]),
        "figure_10": ("sigma 40 deg, rho 0.9", [
            (f"light at {t} deg", rough(40, 0.9), t, 0, "-") for t in (0, 30, 60, 75)]),
        "figure_11": ("sigma 40 deg, rho 0.9, light at 75 deg", [
            (f"azimuth {d} deg", rough(40, 0.9), 75, d, "-") for d in (0, 60, 90)]),
        "figure_12": ("integral and functional approximation, sigma 30 deg, rho 0.9", [
            line for t in (30, 60, 75) for line in (
                (f"integral, light at {t} deg", rough(30, 0.9), t, 0, "-"),
                ("functional", approximation(OrenNayar, 30, 0.9), t, 0, ":"))]),
        "figure_13": ("integral and qualitative model, sigma 30 deg, rho 0.9, light at 75 deg", [
            ("integral", rough(30, 0.9), 75, 0, "-"),
            ("qualitative", approximation(QualitativeOrenNayar, 30, 0.9), 75, 0, ":")]),
    }  # fmt: skip
    for number, (name, sigma, rho, geometries) in SAMPLES.items():
        lines = [(f"light at {t} deg, azimuth {d} deg", rough(sigma, rho), t, d, "-") for t, d in geometries]
        found[f"figure_{number}"] = (f"{name}: model, sigma {sigma} deg, rho {rho:g}, over its value at 0", lines)
    return found


def save(figure, path: Path) -> None:
    figure.savefig(path, dpi=80)
    plt.close(figure)
    print(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the figures")
    parser.add_argument("--size", type=int, default=256, help="rows of the pictures")
    parser.add_argument("--points", type=int, default=359, help="viewing angles of a curve")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    theta_r = torch.linspace(-89.5, 89.5, args.points)
    for name, (title, lines) in curves().items():
        figure, axis = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
        for label, model, theta_i, dphi, style in lines:
            values = radiance(model, theta_i, dphi, theta_r)
            if "over its value" in title:
                values = values / radiance(model, theta_i, dphi, torch.zeros(1))
            axis.plot(theta_r.numpy(), values.numpy(), style, label=label)
        axis.set_title(title, fontsize=10)
        axis.set(xlabel="viewing angle [deg], light's side positive", ylabel="radiance", xlim=(-90, 90))
        axis.set_ylim(bottom=0)
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
        save(figure, args.output / f"{name}.png")

    n = args.size
    straight, oblique = Distant.from_angle(0), Distant.from_angle(20)
    figure, axes = plt.subplots(1, 4, figsize=(10, 2.9), layout="constrained")
    for axis, sigma in zip(axes, (0, 10, 20, 40), strict=True):
        image = render(Scene(sphere(n, n, samples=2), [straight]), rough(sigma, 0.9, nodes=16))[0, :, :, 0]
        axis.imshow((image / image.max()).numpy(), cmap="gray", vmin=0)
        axis.set(title=f"sigma {sigma} deg")
        axis.set_axis_off()
    save(figure, args.output / "spheres.png")

    objects = [vase(n, n, samples=2), cylinder(n, n, half_height=0.6, samples=2), cuboid(n, n, samples=2)]
    figure, axes = plt.subplots(2, 2, figsize=(12, 8.4), layout="constrained")
    for axis, (sigma, light, label) in zip(axes.flat, (
        (0, straight, "smooth, light from the viewer"), (30, straight, "sigma 30 deg, light from the viewer"),
        (0, oblique, "smooth, light at 20 deg"), (30, oblique, "sigma 30 deg, light at 20 deg"),
    ), strict=True):  # fmt: skip
        image = render(Scene(side_by_side(objects), [light]), rough(sigma, 0.9, nodes=16))[0, :, :, 0]
        axis.imshow(image.numpy(), cmap="gray", vmin=0, vmax=0.9 / math.pi)
        axis.set(title=label)
        axis.set_axis_off()
    save(figure, args.output / "scene.png")


if __name__ == "__main__":
    main()
