"""What accuracy costs: every rung of the ladder in error, time, memory and bias of the answer.

Errors are against the exact model with all bounces: over the hemisphere up to 85 degrees, in images of the vase, and
in sigma and rho when photographs made by the exact model are fitted with the rung. The record of a run is written as
JSON; `--draw RECORD` draws it again without measuring.
"""

import argparse
import json
import math
import platform
import re
from dataclasses import asdict
from pathlib import Path

import torch
from matplotlib.figure import Figure

from inverse import Distant, Scene, Sensor, fit, render, usable, vase
from torchbrdf import Cosines
from torchbrdf.accuracy import RUNGS, Ladder, Row, Rung, ladder, reference
from torchbrdf.testing import random_directions

HEMISPHERE = {"sigma": [5, 10, 20, 30, 40, 60], "rho": [0.3, 0.7, 0.9]}  # degrees
VASE = {"sigma": [10, 30, 50], "rho": [0.3, 0.6, 0.9]}
MARKERS = "ov^sDP*X"
LINE_OF_TEXT = 17  # [pixel]


def on_the_vase(rungs: list[Rung], size: int, sigmas: list[float], rhos: list[float]) -> dict[str, dict[str, float]]:
    """By rung: largest error of the image [share of peak], largest bias of sigma [degree] and of rho."""
    scene = Scene(vase(size, size), [Distant.from_angle(0), Distant.from_angle(20)], Sensor(exposure=1.0))
    valid = usable(scene, limb=85, shadow=85)
    largest = {rung.name: {"image_error": 0.0, "sigma_bias": 0.0, "rho_bias": 0.0} for rung in rungs}
    for sigma in sigmas:
        for rho in rhos:
            material = (torch.tensor(rho), torch.deg2rad(torch.tensor(float(sigma))))
            with torch.no_grad():
                photographs = render(scene, reference(*material))
            for rung in rungs:
                here = largest[rung.name]
                with torch.no_grad():
                    error = (render(scene, rung.build(*material)) - photographs).abs().max() / photographs.max()
                result = fit(scene, photographs, rung.build(torch.tensor(0.5), torch.tensor(0.5)), valid=valid)
                fitted = torch.rad2deg(result.parameters.get("sigma", torch.tensor(0.0))).item()
                misses = (error.item(), abs(fitted - sigma), abs(result.parameters["albedo"].item() - rho))
                for key, miss in zip(here, misses, strict=True):
                    here[key] = max(here[key], miss)
    return largest


def family(name: str) -> tuple[str, str]:
    """A rung's name without its number of slopes, and that number: rungs of one family are joined by a line."""
    slopes = re.search(r"K = (\d+), ", name)
    return (name.replace(slopes[0], ""), slopes[1]) if slopes else (name, "")


def draw(rows: list[dict], machine: str) -> Figure:
    """rms error against forward time; the rungs that no other beats in both are named at their points."""
    figure = Figure(figsize=(9, 5.8), dpi=100, layout="constrained")
    axis = figure.subplots()
    families: dict[str, list[dict]] = {}
    for row in rows:
        families.setdefault(family(row["name"])[0], []).append(row)
    for k, (name, members) in enumerate(families.items()):
        x, y = [row["forward"] for row in members], [100 * row["rms_error"] for row in members]
        slopes = ", ".join(family(row["name"])[1] for row in members)
        label = f"{name} (K = {slopes} slopes, left to right)" if len(members) > 1 else name
        look = {"marker": MARKERS[k % len(MARKERS)], "color": f"C{k}", "linewidth": 1, "markersize": 7}
        axis.loglog(x, y, linestyle="-" if len(members) > 1 else "", label=label, **look)
    fields = ("name", "max_error", "rms_error", "forward", "backward", "saved_bytes")
    front = Ladder(tuple(Row(**{key: row[key] for key in fields}) for row in rows)).pareto()
    line = sorted((row.forward, 100 * row.rms_error, row.name) for row in front)
    axis.step([x for x, *_ in line], [y for _, y, _ in line], "k:", where="post", linewidth=1, zorder=0)
    axis.set_xlim(left=0.3)  # room for the names of the cheapest
    axis.set_ylim(bottom=0.5 * line[-1][1])  # and of the best
    for scale in (axis.xaxis, axis.yaxis):
        scale.set_major_formatter("{x:g}")
    axis.set_xlabel("time of a forward pass, relative to Lambert")
    axis.set_ylabel("rms relative error of the BRDF [%]")
    axis.set_title(
        "Error against the exact model (64 slopes, all bounces); named and dotted: no rung is both better and cheaper\n"
        + machine,
        fontsize=9,
    )
    figure.legend(loc="outside lower center", ncols=3, fontsize=8.5)
    axis.grid(alpha=0.3)
    figure.draw_without_rendering()  # places the axes: what follows is in pixels
    below = math.inf
    for x, y, name in line:  # below and left of a rung nobody beats there is no other
        right, top = axis.transData.transform((x, y))
        below = min(top - LINE_OF_TEXT / 2, below - LINE_OF_TEXT)
        axis.annotate(
            name, (x, y), (right - 8, below), textcoords="figure pixels", ha="right", va="center", fontsize=10
        )
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"))
    parser.add_argument("--directions", type=int, default=1000)
    parser.add_argument("--size", type=int, default=64, help="rows of the vase images")
    parser.add_argument("--rungs", nargs="*", help="names to keep (all)")
    parser.add_argument("--compiled", action="store_true", help="time the models under torch.compile (minutes)")
    parser.add_argument("--device", default="cpu", help="where to time")
    parser.add_argument("--draw", type=Path, metavar="RECORD", help="draw the JSON of an earlier run, and nothing else")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    if args.draw:
        record = json.loads(args.draw.read_text())
        path = args.output / f"{args.draw.stem}.png"
        draw(record["rows"], record["machine"]).savefig(path)
        print(f"Figure: {path}")
        return
    rungs = [rung for rung in RUNGS if not args.rungs or rung.name in args.rungs]
    directions = random_directions(args.directions, generator=torch.Generator().manual_seed(0))
    cosines = Cosines.of(*(d.to(args.device) for d in directions))
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
    path = args.output / f"ladder_{kind}.png"
    path.with_suffix(".json").write_text(json.dumps({"machine": machine, "rows": rows}, indent=2))
    draw(rows, machine).savefig(path)
    print(f"\nFigure: {path}")


if __name__ == "__main__":
    main()
