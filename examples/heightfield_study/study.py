"""Path tracing of random heightfields as they are: the calibration and the errors of `GaussianHeightfield`.

    pip install "torchbrdf[study]"
    python examples/heightfield_study/study.py [--large] [--share 1] [--processes 2] [--output FOLDER] [--against FILE]

Time: the small run about five minutes of one core, the large one (1008^2 vertices, 24 bounces) about 45 by the time of
its single surfaces, 5 and 22 s; both divide among processes. `--share 0.4` takes 0.4 of the surfaces for a first look.

Draws surfaces of Gaussian heights (`surfaces.py`), meshes each at two finenesses (`terrain.py`), follows light through
24 bounces (`tracing.py`), averages and extrapolates to vanishing cells (`samples.py`), fits the model's constants
(`calibration.py`) and prints the tables (`report.py`). Surfaces that the folder has already are not traced again.
`fresh.py` judges the model on surfaces of other seeds and slopes; `fit_neighbours.py` finds the constants of its second
bounce. `--against`: other traced data of the same format and slope, compared within standard errors.

Deterministic per seed, but for last digits that another processor or another release of Embree may change.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import surfaces
import torch
from model import LibraryModel
from report import agreement, full_report, mesh_table
from runs import AZIMUTHS, POLAR, Plan, Study, carry_out
from samples import Sample

SLOPES = (0.3, 0.67, 1.0)
OTHERS = {"two scales": surfaces.two_scale, "power law": surfaces.power_law}
OTHERS_SLOPE = 0.67


class Scale(NamedTuple):
    """Two plans: light reflected once differs between surfaces and hardly between paths, so that the constants want
    many surfaces; light of more bounces differs between paths as well, and on these surfaces the model is judged.
    """

    direct: Plan
    bounces: Plan


SMALL = Scale(
    Plan(surfaces=24, length=21, cells=(6, 12), paths=3, bounces=1, seed=2),
    Plan(surfaces=8, length=21, cells=(6, 12), paths=6, bounces=24, seed=1),
)
LARGE = Scale(
    Plan(surfaces=48, length=42, cells=(6, 12), paths=3, bounces=1, seed=2),
    Plan(surfaces=16, length=42, cells=(12, 24), paths=6, bounces=24, seed=1),
)


def traced(stem: str, plan: Plan, spectrum: surfaces.Spectrum, slope: float, *, folder: Path, processes: int) -> Study:
    """The surfaces of a case, their means saved beside them."""
    start = time.perf_counter()
    study = carry_out(plan, spectrum, slope, folder=folder / stem, processes=processes)
    print(f"{stem}: {plan.surfaces} surfaces, {time.perf_counter() - start:.0f} s", flush=True)
    for cells, sample in study.meshes.items():
        sample.save(folder / f"{stem}_{cells}_cells.npz")
    study.limit.save(folder / f"{stem}.npz")
    return study


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--large", action="store_true", help="up to 1008^2 vertices instead of 252^2")
    parser.add_argument("--share", type=float, default=1.0, help="of the surfaces planned, for a first look")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--output", type=Path, default=Path("output/heightfield_study"))
    parser.add_argument("--against", type=Path, nargs="*", default=[])
    arguments = parser.parse_args()
    folder = arguments.output / ("large" if arguments.large else "small")
    plans = LARGE if arguments.large else SMALL
    scale = Scale(*(replace(plan, surfaces=max(2, round(arguments.share * plan.surfaces))) for plan in plans))
    torch.set_num_threads(1)

    def study(title: str, plan: Plan, spectrum: surfaces.Spectrum, slope: float) -> Study:
        stem = f"{title.replace(' ', '_')}_{slope:g}"
        return traced(stem, plan, spectrum, slope, folder=folder, processes=arguments.processes)

    direct = [study("direct", scale.direct, surfaces.gaussian, slope) for slope in SLOPES]
    smooth = [study("gaussian", scale.bounces, surfaces.gaussian, slope) for slope in SLOPES]
    others = {title: study(title, scale.bounces, spectrum, OTHERS_SLOPE).limit for title, spectrum in OTHERS.items()}
    for case in direct + smooth:
        print(*mesh_table(case), "", sep="\n")
    model = LibraryModel.at(POLAR, AZIMUTHS)
    print(*full_report(model, [case.limit for case in direct], [case.limit for case in smooth], others), sep="\n")
    for path in arguments.against:
        other = Sample.load(path)
        for case in smooth:
            if case.limit.slope == other.slope:
                for cells, sample in case.meshes.items():
                    print(f"{path.name} and {cells} cells per tau: {agreement(sample, other)}")


if __name__ == "__main__":
    main()
