"""Figures 7 to 11 of He, Torrance, Sillion and Greenberg: five surfaces, and what the paper says of them.

Light comes from the left, the mirror direction lies to the right. The specular part is averaged over a source and a
detector of pi/1024 sr. Every claim is checked and printed. Lengths are in um.
"""

import argparse
import math
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import torch
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from torch import Tensor

from torchbrdf import ACRYLIC, ALUMINIUM, MAGNESIUM_OXIDE, HeTorrance, fixed

CONE = math.pi / 1024  # [sr]
Shown = dict[int, tuple[str, HeTorrance, tuple[int, ...]]]


def material(table, sigma0: float, tau: float, wavelengths: Sequence[float], **details) -> HeTorrance:
    """A surface with the index of the table; prints the warning of an a that reflects too much."""
    wavelength = torch.tensor(wavelengths, dtype=torch.float64)
    eta, k = (fixed(x) for x in table(wavelength))
    lengths = {"sigma0": torch.tensor(sigma0).double(), "tau": torch.tensor(tau).double(), "wavelength": wavelength}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = HeTorrance(**{name: fixed(x) for name, x in lengths.items()}, eta=eta, k=k, **details)
    for warning in caught:
        print(f"{table.name}: {warning.message}")
    return model


def figures() -> Shown:
    """Number -> (title, model, angles of incidence [degree])."""
    seen = {"solid_angle": CONE}
    white, blue = (fixed(torch.tensor(a).double()) for a in (0.9, 0.15))
    rough = (0.28, 1.77)
    return {
        7: ("aluminium, wavelength 2 um", material(ALUMINIUM, *rough, [2.0], **seen), (10, 45, 75)),
        8: ("aluminium, wavelength 0.5 um", material(ALUMINIUM, *rough, [0.5], **seen), (10, 30, 45, 60, 75)),
        9: ("magnesium oxide", material(MAGNESIUM_OXIDE, 1.45, 13.2, [0.5], diffuse=white, **seen), (10, 45, 60, 75)),
        10: ("sandpaper, sigma0/tau = 4.4", material(ACRYLIC, 44.0, 10.0, [0.55], **seen), (0,)),
        11: ("blue plastic", material(ACRYLIC, 0.0, 1.0, [0.46], diffuse=blue, **seen), (15, 30, 45, 60)),
    }


def in_plane(model: HeTorrance, theta_i: float, theta_r: Tensor) -> dict[str, Tensor]:
    """Parts of f_r (view,) [1/sr], and their total, for views (view,) [degree]; positive ones lie to the right."""
    angles = -torch.deg2rad(torch.full_like(theta_r, theta_i)), torch.deg2rad(theta_r)
    light, view = (torch.stack((t.sin(), torch.zeros_like(t), t.cos()), -1) for t in angles)
    parts = {name: f[:, 0] for name, f in model.components(view.new_tensor([0, 0, 1]), light, view).items()}
    return parts | {"total": sum(parts.values(), torch.zeros_like(theta_r))}


def at(model: HeTorrance, theta_i: float, theta_r: float) -> dict[str, float]:
    parts = in_plane(model, theta_i, torch.tensor([theta_r], dtype=torch.float64))
    return {name: value.item() for name, value in parts.items()}


def specular_over_the_rest(model: HeTorrance, theta: float) -> float:
    """In the mirror direction."""
    parts = at(model, theta, theta)
    return parts["specular"] / (parts["total"] - parts["specular"])


def listed(numbers: Sequence[float], digits: str = ".3g") -> str:
    return ", ".join(f"{x:{digits}}" for x in numbers)


def claims(shown: Shown) -> Iterator[tuple[int, str, bool]]:
    """(figure, what the paper says and what is found, whether it holds)."""
    views = torch.linspace(0, 89.9, 1799, dtype=torch.float64)
    ratios = [specular_over_the_rest(shown[7][1], t) for t in shown[7][2]]
    yield 7, f"a strong specular peak: {listed(ratios)} times what is under it", min(ratios) > 1
    peaks = [views[in_plane(shown[8][1], t, views)["total"].argmax()].item() for t in shown[8][2]]
    beyond = all(peak > t + 1 for t, peak in zip(shown[8][2][:-1], peaks, strict=False))
    yield 8, f"up to 60 deg the maximum is beyond the specular angle: at {listed(peaks[:-1])} deg", beyond
    ratio = specular_over_the_rest(shown[8][1], 75)
    yield 8, f"at 75 deg the specular peak emerges: at {peaks[-1]:.1f} deg, {ratio:.2g} times the rest", ratio > 1
    oxide = in_plane(shown[9][1], 75, views)["total"]
    ratio, rise = specular_over_the_rest(shown[9][1], 75), oxide.max().item() / at(shown[9][1], 75, 75)["total"]
    found = f"{ratio:.0e} of the rest, whose own maximum is at {views[oxide.argmax()]:.1f} deg, {rise:.1f} times higher"
    yield 9, f"at 75 deg a specular peak emerges: {found}", ratio > 1
    rises = [at(shown[10][1], 0, t)["total"] / at(shown[10][1], 0, 0)["total"] for t in (30, 60, 75, 85, 89)]
    yield 10, f"maxima at grazing: {listed(rises)} of normal at 30, 60, 75, 85, 89 deg", rises[-1] > 1
    parts = [at(shown[11][1], t, t) for t in shown[11][2]]
    found = f"peaks {listed([p['specular'] for p in parts])}/sr over {parts[0]['uniform_diffuse']:.3f}/sr"
    yield 11, f"specular and uniform parts alone: {found}", all(p["directional_diffuse"] == 0 for p in parts)


def draw(shown: Shown, points: int) -> Figure:
    figure = Figure(figsize=(13, 7.4), dpi=80, layout="constrained")
    views = torch.linspace(-89, 89, points, dtype=torch.float64)
    for place, (number, (title, model, angles)) in enumerate(shown.items(), 1):
        polar = number != 11
        axis = figure.add_subplot(2, 3, place, projection="polar" if polar else "rectilinear")
        for theta in angles:
            near = theta + torch.linspace(-3.6, 3.6, 73, dtype=torch.float64)  # the specular part
            theta_r = torch.cat((views, near)).sort().values
            curve = in_plane(model, theta, theta_r)["total"]
            if polar:
                over = curve / at(model, theta, theta)["total"]
                axis.plot(torch.deg2rad(theta_r).numpy(), over.numpy(), label=f"{theta} deg")
            else:
                axis.semilogy(theta_r.numpy(), curve.numpy(), label=f"{theta} deg")
        if polar:
            axis.set(thetamin=-90, thetamax=90, theta_zero_location="N", theta_direction=-1)
            axis.yaxis.set_major_locator(MaxNLocator(3))
            axis.legend(fontsize=7.5, ncols=5, loc="upper center", bbox_to_anchor=(0.5, 0.17), frameon=False,
                        columnspacing=0.8, handlelength=1.2)  # fmt: skip
        else:
            axis.set(xlabel="viewing angle [deg]", ylabel="f_r [1/sr]", xlim=(-90, 90))
            axis.legend(fontsize=8)
        axis.set_title(f"Figure {number}: {title}", fontsize=11, y=0.88 if polar else None)
        axis.grid(alpha=0.4)
    axis = figure.add_subplot(2, 3, 6)
    waves = torch.linspace(0.32, 2.05, points, dtype=torch.float64)
    mirror = material(ALUMINIUM, 0.28, 1.77, waves.tolist())
    for theta in (10, 45, 75):
        share = mirror.specular_reflectivity(torch.tensor(math.cos(math.radians(theta)), dtype=torch.float64))
        axis.plot(waves.numpy(), share.numpy(), label=f"{theta} deg")
    axis.set(xlabel="wavelength [um]", ylabel="specular reflectance")
    axis.set_title("Figures 7 and 8: growth of the specular part", fontsize=11)
    axis.legend(fontsize=8)
    axis.grid(alpha=0.4)
    figure.suptitle("f_r in the plane of incidence, over its value in the mirror direction (11: absolute)")
    return figure


@torch.no_grad()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the picture")
    parser.add_argument("--points", type=int, default=721, help="views of a curve")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    shown = figures()
    for number, found, holds in claims(shown):
        print(f"Figure {number}, {found}: {'holds' if holds else 'does NOT hold'}")
    path = args.output / "he_torrance_lobes.png"
    draw(shown, args.points).savefig(path)
    print(f"Picture: {path}")


if __name__ == "__main__":
    main()
