"""Fit every diffuse model and mixture to five measured paints, and say what each leaves unexplained.

The data are the gonioreflectometer measurements of the Cornell Program of Computer Graphics: 1439 pairs of directions,
31 wavelengths, here the means of three bands. Each band has an albedo and a reflectance at normal incidence of its own;
shapes are shared. The residual is that of `inverse.fit_measurements` with a knee of 0.01/sr (a Lambert surface of 3 %):
f_r cos(light) cos(view), whose logarithm counts above the knee. Plain f_r would fit a handful of highlights.
Takes about two minutes.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

import torchbrdf as tb
from inverse import FitResult, Measurements, fit_measurements, read_gonioreflectometer, weighted_reflectance
from inverse.figures import measurement_figure

BANDS = {"blue": (400, 490), "green": (500, 590), "red": (600, 700)}  # [nm]
KNEE = 0.01  # [1/sr]
DRAWN = ("Lambert", "MaxCosinePhong", "Lambert + GGX")
OFF_HIGHLIGHT = 30.0  # half angle [deg] beyond which little is left of the highlights
GLOSSY = 0.8  # a mixture that leaves less than this share of the best matte model
RHO = {"albedo": torch.full((3,), 0.1)}
GLOSS = {"fresnel": tb.Schlick(f0=torch.full((3,), 0.04))}
COAT = {"fresnel": tb.Schlick(f0=tb.fixed(0.04))}  # held: its effect on the body is that of a darker one
COLOURS = {"diffuse": torch.full((3,), 0.1), "specular": torch.full((3,), 0.04)}


def over(*parts: tb.BRDF) -> tb.BRDF:
    """Their sum, each as bright as its own parameters say."""
    total = sum(parts)
    total.weights = tb.fixed(torch.ones(len(parts)))
    return total


DIFFUSE = {
    "Lambert": tb.Lambert(**RHO),
    "QualitativeOrenNayar": tb.QualitativeOrenNayar(**RHO),
    "OrenNayar": tb.OrenNayar(**RHO),
    "FastRoughSurface": tb.FastRoughSurface(**RHO),
    "RoughSurface": tb.RoughSurface(**RHO, nodes=8, bounces="all"),
    "FujiiOrenNayar": tb.FujiiOrenNayar(**RHO),
    "EON": tb.EON(**RHO),
    "Burley": tb.Burley(**RHO),
    "Minnaert": tb.Minnaert(**RHO),
    "LommelSeeliger": tb.LommelSeeliger(**RHO),
    "LambertSphere": tb.LambertSphere(**RHO),
    "Hapke": tb.Hapke(**RHO),
    "Coupled": tb.Coupled(**RHO, **COAT),
}
MIXTURES = {
    "ModifiedPhong": tb.ModifiedPhong(**COLOURS, exponent=100.0),
    "MaxCosinePhong": tb.MaxCosinePhong(**COLOURS, exponent=100.0),
    "AshikhminShirley": tb.AshikhminShirley(**COLOURS, exponent_x=100.0, exponent_y=100.0),
    "OrenNayar + TorranceSparrow": over(tb.OrenNayar(**RHO), tb.TorranceSparrow(sigma=0.1, **GLOSS)),
    "Lambert + Beckmann": over(tb.Lambert(**RHO), tb.Beckmann(alpha=0.1, **GLOSS)),
    "Lambert + GGX": over(tb.Lambert(**RHO), tb.GGX(alpha=0.1, **GLOSS)),
    "Lambert + GGX, dielectric": over(
        tb.Lambert(**RHO), tb.GGX(alpha=0.1, fresnel=tb.Dielectric(eta=torch.full((3,), 1.5)))
    ),
    "EON + GGX": over(tb.EON(**RHO), tb.GGX(alpha=0.1, **GLOSS)),
    "Burley + GGX": over(tb.Burley(**RHO), tb.GGX(alpha=0.1, **GLOSS)),
    "Coupled + GGX": over(tb.Coupled(**RHO, **COAT), tb.GGX(alpha=0.1, **GLOSS)),
    "Lambert + 2 GGX": over(tb.Lambert(**RHO), tb.GGX(alpha=0.3, **GLOSS), tb.GGX(alpha=0.03, **GLOSS)),
}  # fmt: skip


def rms(x: Tensor) -> float:
    return x.square().mean().sqrt().item()


class Paint:
    """A measured paint: `off` is where it shows no highlight, `polar` [deg] are the angles of light and view."""

    def __init__(self, path: Path):
        paint = read_gonioreflectometer(path)
        w = paint.wavelengths
        bands = [paint.values[:, (w >= low) & (w <= high)].mean(1) for low, high in BANDS.values()]
        middles = torch.tensor([sum(band) / 2 for band in BANDS.values()])
        # turned about the normal, each by another angle: an isotropic paint does not care, and an anisotropic model
        # finds no grain in the fact that the light always came from one side
        light, view = (turned(v) for v in (paint.light, paint.view))
        self.name, self.data = path.stem, Measurements(light, view, torch.stack(bands, -1), middles)
        self.cosines = self.data.cosines()
        self.seen = self.weighted(self.data.values)
        self.polar = torch.rad2deg(torch.stack((self.cosines.light, self.cosines.view)).clamp(max=1).acos())
        half = torch.nn.functional.normalize(light + view, dim=-1)[:, 2]
        self.off = torch.rad2deg(half.clamp(max=1).acos()) > OFF_HIGHLIGHT
        across = torch.atan2(view[:, 1], view[:, 0]) - torch.atan2(light[:, 1], light[:, 0])
        self.dphi = torch.rad2deg(across.cos().clamp(-1, 1).acos())

    def weighted(self, values: Tensor) -> Tensor:
        return weighted_reflectance(self.cosines, values, KNEE)

    def fit(self, model: tb.BRDF, *, off: bool = False) -> FitResult:
        parts = {k: getattr(self.data, k)[self.off | (not off)] for k in ("light", "view", "values")}
        return fit_measurements(replace(self.data, **parts), model, knee=KNEE, max_steps=40, throw=False)

    def misses(self, model: tb.BRDF) -> list[float]:
        """Residual rms in percent of the rms of the data: everywhere, off the highlight, in and near it."""
        with torch.no_grad():
            wrong = self.weighted(model.evaluate(self.cosines)) - self.seen
        return [100 * rms(wrong[s]) / rms(self.seen[s]) for s in (self.off | True, self.off, ~self.off)]

    def not_reciprocal(self) -> float:
        """What any reciprocal model must leave off the highlight [%]: half of the difference of two samples that
        light and view exchanged turn into one another (within 2 degrees)."""
        angles = torch.stack((*self.polar, self.dphi), -1)
        apart, partner = (angles[:, None] - angles[:, [1, 0, 2]]).abs().amax(-1).min(1)
        pairs = self.off & (apart < 2) & ((self.polar[0] - self.polar[1]).abs() > 10)
        difference = self.weighted(self.data.values[partner]) - self.seen
        return 50 * rms(difference[pairs]) / rms(self.seen[pairs])


def turned(v: Tensor) -> Tensor:
    angle = 2.4 * torch.arange(len(v), dtype=v.dtype)  # [rad], never twice the same
    x, y, z = v.unbind(-1)
    return torch.stack((angle.cos() * x - angle.sin() * y, angle.sin() * x + angle.cos() * y, z), -1)


def verdict(paint: Paint, misses: dict[str, list[float]]) -> str:
    ranked = sorted(misses, key=lambda name: misses[name][0])
    matte, mixed = (next(name for name in ranked if name in group) for group in (DIFFUSE, MIXTURES))
    power = paint.data.values.square().sum(1)
    brightest = power.sort(descending=True).values[:10].sum() / power.sum()
    flat, *rough = (paint.fit(DIFFUSE[name], off=True) for name in ("Lambert", "OrenNayar", "FastRoughSurface"))
    kind = "glossy" if misses[mixed][0] < GLOSSY * misses[matte][0] else "matte"
    lines = [
        f"{paint.name} is {kind}: the best diffuse model ({matte}) leaves {misses[matte][0]:.0f} %, "
        f"the best mixture ({mixed}) {misses[mixed][0]:.0f} %",
        f"plain f_r: 10 of {len(power)} samples hold {brightest:.2%} of the sum of squares",
        f"off the highlight the best model leaves {min(share[1] for share in misses.values()):.0f} %; the data are not "
        f"reciprocal: of pairs measured both ways, any reciprocal model leaves about {paint.not_reciprocal():.0f} %",
    ]
    for end in rough:
        share = end.residual_rms / flat.residual_rms
        lines.append(
            f"there, {type(end.model).__name__} leaves {share:.1%} of what Lambert does: {end.status}, {end.reason}"
        )
    return "\n    ".join(lines)


def in_plane(paint: Paint, models: dict[str, tb.BRDF]) -> tuple[str, dict[str, tuple[Tensor, Tensor]]]:
    """A title, and label -> viewing angle [deg] and f_r, in the band that is brightest off the highlight."""
    band = int(paint.data.values[paint.off].mean(0).argmax())
    here = ((paint.polar[0] - 50).abs() < 1) & ((paint.dphi < 1) | (paint.dphi > 179))
    angle = torch.where(paint.dphi > 90, paint.polar[1], -paint.polar[1])[here]
    values = {"measured": paint.data.values} | {k: m.evaluate(paint.cosines).detach() for k, m in models.items()}
    title = f"{paint.name}, {list(BANDS)[band]}, light at -50 deg"
    return title, {label: (angle, v[here, band]) for label, v in values.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of the .brdf files")
    parser.add_argument("--output", type=Path, default=Path("output"), help="folder of the figure")
    parser.add_argument("--models", nargs="+", default=[*DIFFUSE, *MIXTURES], help="which to fit")
    parser.add_argument("--paints", type=int, default=5, help="how many")
    args = parser.parse_args()
    files = sorted(args.folder.glob("*.brdf"))[: args.paints]
    if not files:
        parser.error(f"no .brdf files in {args.folder}: give the folder of the Cornell paint measurements.")
    paints = [Paint(path) for path in files]
    print("Residual rms in percent of the rms of the data: all / off the highlight / highlight\n")
    print(f"{'model':<29}" + "".join(f"{paint.name:<17}" for paint in paints))
    fitted = {paint.name: {} for paint in paints}
    shares = {name: {} for name in args.models}
    for name in args.models:
        for paint in paints:
            end = paint.fit((DIFFUSE | MIXTURES)[name])
            fitted[paint.name][name], shares[name][paint.name] = end, paint.misses(end.model)
        marks = {key: "" if ends[name].status in ("converged", "at bound") else " *" for key, ends in fitted.items()}
        shown = (" / ".join(f"{x:.0f}" for x in three) + marks[key] for key, three in shares[name].items())
        print(f"{name:<29}" + "".join(f"{text:<17}" for text in shown), flush=True)
    print("\n* out of steps, or a parameter is not determined\n")
    for paint in paints:
        print(verdict(paint, {name: row[paint.name] for name, row in shares.items()}), "\n")
    args.output.mkdir(parents=True, exist_ok=True)
    path = args.output / "measured_paints.png"
    drawn = [name for name in DRAWN if name in args.models]
    curves = dict(in_plane(paint, {name: fitted[paint.name][name].model for name in drawn}) for paint in paints)
    parts = ("all", "off highlight", "highlight")
    table = {
        name: {f"{paint}\n{part}": three[k] for paint, three in row.items() for k, part in enumerate(parts)}
        for name, row in shares.items()
    }
    measurement_figure(curves, table).savefig(path)
    print(f"Figure: {path}")


if __name__ == "__main__":
    main()
