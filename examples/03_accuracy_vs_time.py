"""What accuracy costs: every rung of the ladder in error, time, memory and bias of the answer.

Errors are against the exact model with all bounces: over the hemisphere up to 85 degrees, in images of
the vase, and in sigma and rho when photographs made by the exact model are fitted with the rung.
`--models` times every model of the library instead, `--series` compares ways to sum the series of `HeTorrance`.
"""

import argparse
import inspect
import json
import math
import platform
from dataclasses import asdict
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import torch

import torchbrdf
from inverse import Distant, Scene, Sensor, fit, render, usable, vase
from torchbrdf import BRDF, Cosines
from torchbrdf.accuracy import RUNGS, Rung, SeriesLadder, forward_ratios, ladder, reference, series_ladder
from torchbrdf.testing import random_directions

matplotlib.use("Agg")
HEMISPHERE = {"sigma": [5, 10, 20, 30, 40, 60], "rho": [0.3, 0.7, 0.9]}  # degrees
VASE = {"sigma": [10, 30, 50], "rho": [0.3, 0.6, 0.9]}


def every_model() -> dict[str, BRDF]:
    """One of each public model, Lambert first; those that are made of other models left out."""
    found: dict[str, BRDF] = {"Lambert": torchbrdf.Lambert()}
    for name in torchbrdf.__all__:
        kind = getattr(torchbrdf, name)
        if not (isinstance(kind, type) and issubclass(kind, BRDF)) or inspect.isabstract(kind):
            continue
        if kind is torchbrdf.TabulatedBRDF:
            found[name] = kind.of(torchbrdf.EON(), dtype=torch.float32)
        elif kind is torchbrdf.TabulatedRoughSurface:
            found[name] = kind(weights=torch.full((16,), 1 / 16))
        elif kind is torchbrdf.HeTorrance:  # Figure 8 of the paper, lengths in um
            found[name] = kind(sigma0=0.28, tau=1.77, wavelength=0.5, eta=0.77, k=6.08)
        elif kind not in (torchbrdf.Oriented, torchbrdf.WeightedSum):
            found[name] = kind()
    return found


def on_the_vase(rungs: list[Rung], size: int, sigmas: list[float], rhos: list[float]) -> dict[str, dict[str, float]]:
    """By rung: largest error of the image [share of peak], largest bias of sigma [degree] and of rho."""
    scene = Scene(vase(size, size), [Distant.from_angle(0), Distant.from_angle(20)], Sensor(exposure=1.0))
    valid = usable(scene, limb=85, shadow=85)
    found = {rung.name: {"image_error": 0.0, "sigma_bias": 0.0, "rho_bias": 0.0} for rung in rungs}
    for sigma in sigmas:
        for rho in rhos:
            material = (torch.tensor(rho), torch.deg2rad(torch.tensor(float(sigma))))
            with torch.no_grad():
                photographs = render(scene, reference(*material))
            for rung in rungs:
                here = found[rung.name]
                with torch.no_grad():
                    error = (render(scene, rung.build(*material)) - photographs).abs().max() / photographs.max()
                result = fit(scene, photographs, rung.build(torch.tensor(0.5), torch.tensor(0.5)), valid=valid)
                sigma_found = torch.rad2deg(result.parameters.get("sigma", torch.tensor(0.0))).item()
                misses = (error.item(), abs(sigma_found - sigma), abs(result.parameters["albedo"].item() - rho))
                for key, miss in zip(here, misses, strict=True):
                    here[key] = max(here[key], miss)
    return found


def draw(rows: list[dict], front: set[str], machine: str, path: Path) -> None:
    figure, axis = plt.subplots(figsize=(8.5, 5.2), layout="constrained")
    for row in rows:
        on_front = row["name"] in front
        axis.loglog(row["forward"], row["rms_error"], "o", color="tab:red" if on_front else "tab:gray")
        axis.annotate(
            row["name"],
            (row["forward"], row["rms_error"]),
            xytext=(5, 3),
            textcoords="offset points",
            fontsize=8 if on_front else 5,
            rotation=0 if on_front else 35,
        )
    line = sorted((row["forward"], row["rms_error"]) for row in rows if row["name"] in front)
    axis.step(*zip(*line, strict=True), where="post", color="tab:red", linewidth=0.8, label="Pareto front")
    axis.margins(x=0.2)
    axis.set(xlabel=f"forward time relative to Lambert ({machine})", ylabel="rms relative error of the BRDF")
    axis.legend()
    axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def draw_series(table: SeriesLadder, path: Path) -> None:
    figure, axis = plt.subplots(figsize=(8.5, 4.6), layout="constrained")
    for row in table.rows:
        shown = [min(max(error, 1e-8), 2.0) for error in row.largest]
        label = f"{row.name}, {row.forward:.0f} x Lambert"
        axis.stairs(shown, table.edges, baseline=None, linewidth=2, label=label)
    axis.set(xscale="log", yscale="log", xlabel="g", ylabel="largest relative error of the series (float32)")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"))
    parser.add_argument("--directions", type=int, default=1000)
    parser.add_argument("--size", type=int, default=64, help="rows of the vase images")
    parser.add_argument("--models", action="store_true", help="forward time of every model, and nothing else")
    parser.add_argument("--series", action="store_true", help="schemes for the series of HeTorrance, and nothing else")
    parser.add_argument("--points", type=int, default=1 << 14, help="points of --models and --series")
    parser.add_argument("--rungs", nargs="*", help="names to keep (all)")
    parser.add_argument("--compiled", action="store_true", help="time the models under torch.compile (minutes)")
    parser.add_argument("--device", default="cpu", help="where to time")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    if args.series:
        table = series_ladder(points=args.points)
        draw_series(table, args.output / "series.png")
        print(f"{table.to_markdown()}\n\nFigure: {args.output / 'series.png'}")
        return
    rungs = [rung for rung in RUNGS if not args.rungs or rung.name in args.rungs]
    directions = random_directions(args.directions, generator=torch.Generator().manual_seed(0))
    cosines = Cosines.of(*(d.to(args.device) for d in directions))
    if args.models:
        points = random_directions(args.points, generator=torch.Generator().manual_seed(0))
        normal, light, view = (d.to(args.device) for d in points)
        timed = Cosines.of(normal, light, view, tangent=torch.linalg.cross(normal, normal.roll(1, -1)))
        models = {name: model.to(args.device) for name, model in every_model().items()}
        for name, ratio in forward_ratios(models, timed).items():
            print(f"{name:<26}{float(f'{ratio:.2g}'):8g} x")
        return
    sigmas = [math.radians(s) for s in HEMISPHERE["sigma"]]
    table = ladder(sigmas, HEMISPHERE["rho"], cosines, rungs=rungs, compiled=args.compiled)
    vases = on_the_vase(rungs, args.size, VASE["sigma"], VASE["rho"])
    kind = "compiled" if args.compiled else "eager"
    name = torch.cuda.get_device_name() if args.device == "cuda" else f"{platform.machine()} CPU"
    machine = f"{name}, {torch.get_num_threads()} threads, float32, {kind}, torch {torch.__version__}"
    rows = [asdict(row) | vases[row.name] for row in table.rows]
    print(f"{machine}\n\n{table.to_markdown()}\n")
    print("| rung | max error of the vase image, of peak | max bias of sigma [deg] | max bias of rho |")
    print("|---|---|---|---|")
    for row in rows:
        print(f"| {row['name']} | {row['image_error']:.2%} | {row['sigma_bias']:.2f} | {row['rho_bias']:.4f} |")
    (args.output / f"ladder_{kind}.json").write_text(json.dumps({"machine": machine, "rows": rows}, indent=2))
    draw(rows, {row.name for row in table.pareto()}, machine, args.output / f"ladder_{kind}.png")
    print(f"\nFigure: {args.output / f'ladder_{kind}.png'}")


if __name__ == "__main__":
    main()
