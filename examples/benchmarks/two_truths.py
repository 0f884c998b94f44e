"""Every kind of rough diffuse model against both surfaces: V-cavities, and a random heightfield.

Errors are rms relative errors of the BRDF over the hemisphere up to 85 degrees, sigma 5 to 60 degrees, rho 0.3 to 0.9,
the same sigma and rho given (the roughness of EON and Fujii's model converted); times are relative to Lambert. The
record of a run is written as JSON; `--draw RECORD` draws it again without measuring.
"""

import argparse
import json
import math
import platform
from pathlib import Path

import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from torchbrdf import Cosines
from torchbrdf.accuracy import DIFFUSE_RUNGS, forward_ratios, heightfield_reference, reference, relative_errors
from torchbrdf.testing import random_directions

SIGMAS, RHOS = [5, 10, 20, 30, 40, 60], [0.3, 0.7, 0.9]  # [deg], [-]
TRUTHS = {"V-cavities": reference, "heightfield": heightfield_reference}
TITLES = {"V-cavities": "V-cavities (grooves)", "heightfield": "a random heightfield"}
FAMILIES = {"V-cavities": ("o", "C0"), "a random heightfield": ("s", "C3"), "neither": ("D", "0.45")}
# Places of a name about its point, the nearest free one is taken. [point]
PLACES = [
    (dx, dy)
    for reach in (7, 14, 22, 32)
    for dx, dy in ((9, 0), (-9, 0), (0, reach), (0, -reach), (6, reach), (6, -reach), (-6, reach), (-6, -reach))
]


def family(name: str) -> str:
    """The surface that a rung is a model of."""
    if name in ("Lambert", "Fujii", "EON"):
        return "neither"
    return "a random heightfield" if name == "Smith" or "heightfield" in name else "V-cavities"


def draw(rows: list[dict], machine: str) -> Figure:
    """Error against time beside each surface; a rung's own surface is its colour."""
    figure = Figure(figsize=(9.6, 5.2), dpi=100, layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for axis, truth in zip(axes, TRUTHS, strict=True):
        for surface, (marker, colour) in FAMILIES.items():
            rungs = [row for row in rows if family(row["name"]) == surface]
            errors = [100 * row["rms_error"][truth] for row in rungs]
            label = f"a model of {surface}"
            axis.loglog([row["forward"] for row in rungs], errors, marker, color=colour, label=label, markersize=7)
        axis.set_title(f"against {TITLES[truth]}", fontsize=11)
        axis.set_xlabel("time of a forward pass, relative to Lambert")
        axis.grid(alpha=0.3)
        axis.margins(0.13, 0.1)
        for scale in (axis.xaxis, axis.yaxis):
            scale.set_major_formatter("{x:g}")
    axes[0].set_ylabel("rms relative error of the BRDF [%]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9.5)
    figure.suptitle(machine, fontsize=8.5)
    figure.draw_without_rendering()  # places the axes: what follows is in pixels
    for axis, truth in zip(axes, TRUTHS, strict=True):
        name_points(axis, {row["name"]: (row["forward"], 100 * row["rms_error"][truth]) for row in rows})
    return figure


def name_points(axis: Axes, points: dict[str, tuple[float, float]]) -> None:
    """Each name at the first place beside its point where it covers no point and no other name."""
    taken: list[Bbox] = []
    pixels = axis.transData.transform(list(points.values()))
    for name, point in points.items():
        for dx, dy in PLACES:
            ha = "left" if dx > 0 else "right" if dx < 0 else "center"
            va = "bottom" if dy > 0 else "top" if dy < 0 else "center"
            text = axis.annotate(name, point, (dx, dy), textcoords="offset points", ha=ha, va=va, fontsize=9)
            box = text.get_window_extent()
            inside = axis.bbox.x0 < box.x0 and box.x1 < axis.bbox.x1 and axis.bbox.y0 < box.y0 and box.y1 < axis.bbox.y1
            if (
                inside
                and not any(box.padded(4).overlaps(k) for k in taken)
                and box.padded(6).count_contains(pixels) == 0
            ):
                taken.append(box)
                break
            text.remove()


def table(rows: list[dict]) -> str:
    heads = " | ".join(f"max error, {truth} | rms" for truth in TRUTHS)
    lines = [f"| rung | {heads} | time |", "|---" * 6 + "|"]
    for row in rows:
        errors = " | ".join(f"{row['max_error'][truth]:.2%} | {row['rms_error'][truth]:.3%}" for truth in TRUTHS)
        lines.append(f"| {row['name']} | {errors} | {float(format(row['forward'], '.2g')):g} x |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"))
    parser.add_argument("--directions", type=int, default=1000, help="to judge by")
    parser.add_argument("--points", type=int, default=1 << 14, help="to time on")
    parser.add_argument("--rungs", nargs="*", help="names to keep (all)")
    parser.add_argument("--draw", type=Path, metavar="RECORD", help="draw the JSON of an earlier run, and nothing else")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    path = args.output / "ladder_two_truths.png"
    if args.draw:
        draw(**json.loads(args.draw.read_text())).savefig(path)
        print(f"Figure: {path}")
        return
    rungs = [rung for rung in DIFFUSE_RUNGS if not args.rungs or rung.name in args.rungs]
    directions = random_directions(args.directions, generator=torch.Generator().manual_seed(0))
    wide = Cosines.of(*(d.double() for d in directions), normalize=True)
    sigmas = [math.radians(sigma) for sigma in SIGMAS]
    errors = {truth: relative_errors(rungs, sigmas, RHOS, wide, against=build) for truth, build in TRUTHS.items()}
    models = {rung.name: rung.build(torch.tensor(RHOS[1]), torch.tensor(sigmas[2])) for rung in rungs}
    points = random_directions(args.points, generator=torch.Generator().manual_seed(0))
    forward = forward_ratios(models, Cosines.of(*points), repeats=5)
    rows = [
        {
            "name": rung.name,
            "max_error": {truth: errors[truth][rung.name][0] for truth in TRUTHS},
            "rms_error": {truth: errors[truth][rung.name][1] for truth in TRUTHS},
            "forward": forward[rung.name],
        }
        for rung in rungs
    ]
    machine = (
        f"{platform.machine()} CPU, {torch.get_num_threads()} thread(s), float32, eager, torch {torch.__version__}, "
        f"{args.points:,} points, processor time"
    )
    print(f"{machine}\n\n{table(rows)}\n")
    path.with_suffix(".json").write_text(json.dumps({"machine": machine, "rows": rows}, indent=2))
    draw(rows, machine).savefig(path)
    print(f"Figure: {path}")


if __name__ == "__main__":
    main()
