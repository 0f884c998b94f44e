"""`GaussianHeightfield` on surfaces that neither its constants nor `NEIGHBOURING_FACETS` were fitted to.

    python examples/heightfield_study/fresh.py [--processes 2] [--output FOLDER]

Traces surfaces of seeds of their own, at slopes between and beyond those of the calibration, at the slopes of sigma =
10 .. 40 degrees, and of two other spectra; meshes of 8 and 16 cells a correlation length, the limit of vanishing cells.
Prints relative errors up to 80 deg with default settings and with `NEIGHBOURING_FACETS`: rms and its standard error
between surfaces, the largest, and the noise of the data. 96 surfaces of some ten seconds of one core each; those in the
folder are not traced again. Deterministic per seed.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import surfaces
import torch
from calibration import error, occlusion
from model import LibraryModel
from runs import AZIMUTHS, POLAR, Plan
from samples import Sample
from study import traced

from torchbrdf import FastGaussianHeightfield, rms_slope_from_sigma, sigma_from_rms_slope
from torchbrdf.models.heightfield.neighbours import NEIGHBOURING_FACETS
from torchbrdf.parameters import fixed

SLOPES = (0.5, 0.2, 0.85)
SIGMAS = (40, 30, 20, 10)  # degrees
OTHERS = {"two scales": surfaces.two_scale, "power law": surfaces.power_law}
OTHERS_SLOPE = 0.5
FIRST_SEED = 101
SURFACES, FEWER = 16, 8  # of the first slopes, on which two bounces are judged; of the others
PARTS = {
    "f1": (1.0,),
    "f2": (0.0, 1.0),
    **{f"rho {rho:g}": tuple(rho ** np.arange(1, 25)) for rho in (0.25, 0.5, 0.9)},
}
ALBEDOS = (0.25, 0.5, 0.9)


def cases() -> list[tuple[str, surfaces.Spectrum, float]]:
    """Title, spectrum and rms slope; the seed counts on from `FIRST_SEED`."""
    slopes = [(f"s = {s:g}", s) for s in SLOPES]
    slopes += [(f"sigma {d}", float(rms_slope_from_sigma(torch.tensor(math.radians(d)).double()))) for d in SIGMAS]
    rows = [(title, surfaces.gaussian, s) for title, s in slopes]
    return rows + [(title, spectrum, OTHERS_SLOPE) for title, spectrum in OTHERS.items()]


def row(title: str, model: LibraryModel, sample: Sample, e: float) -> str:
    predicted = model(sample.slope, e, model.constants, 24)
    return title.ljust(24) + "".join(cell(predicted, sample, weights) for weights in PARTS.values())


def cell(predicted: np.ndarray, sample: Sample, weights: Sequence[float]) -> str:
    e = error(predicted, sample, weights)
    return f"{100 * e.rms:.2f} +- {100 * e.rms_se:.2f} ({100 * e.largest:.1f}; {100 * e.noise:.2f})".ljust(28)


def fast_row(model: LibraryModel, sample: Sample) -> str:
    """The closed form: the full BRDF at each albedo."""
    sigma = fixed(sigma_from_rms_slope(torch.tensor(sample.slope).double()))
    cells = []
    for rho in ALBEDOS:
        brdf = FastGaussianHeightfield(albedo=fixed(torch.tensor(rho).double()), sigma=sigma)
        with torch.no_grad():
            f = brdf.evaluate(model.cosines)[..., 0].numpy()
        # a model of one field, against the sum of the bounces
        whole = np.tensordot(rho ** np.arange(1, sample.each.shape[1] + 1), sample.each, axes=(0, 1))
        total = Sample.of(sample.slope, sample.polar, whole[:, None], sample.alb[None, :1].repeat(2, 0))
        cells.append(cell(f[None], total, (1.0,)))
    return "  closed form".ljust(24 + 56) + "".join(cells)


def keep(samples: Sequence[Sample], path: Path) -> None:
    """What tests read: f_2 with its standard error and the full BRDF at rho 0.9, dphi in [0, pi], single precision."""
    half = AZIMUTHS // 2 + 1
    arrays = {"theta": POLAR}
    for sample in samples:
        values = {"f2": sample.f[1], "f2_se": sample.f_se[1], "full_0.9": sample.total(0.9)}
        arrays |= {f"{sample.slope:g}_{name}": f[..., :half].astype(np.float32) for name, f in values.items()}
    np.savez_compressed(path, **arrays)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--output", type=Path, default=Path("output/heightfield_study"))
    parser.add_argument("--keep", type=Path, help="write what tests read of the first three cases to this file")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    model = LibraryModel.at(POLAR, AZIMUTHS)
    neighbours = replace(model, transport=NEIGHBOURING_FACETS)
    print("Relative error, %: rms +- standard error (largest; noise of the data)")
    print("".ljust(24) + "".join(p.ljust(28) for p in PARTS))
    judged = []
    for number, (case, spectrum, slope) in enumerate(cases()):
        count = SURFACES if number < len(SLOPES) else FEWER
        plan = Plan(count, length=21, cells=(8, 16), paths=6, bounces=24, seed=FIRST_SEED + number)
        name = case.replace(" ", "_") if spectrum is not surfaces.gaussian else "gaussian"
        place = {"folder": arguments.output / "fresh", "processes": arguments.processes}
        sample = traced(f"{name}_{slope:.4g}", plan, spectrum, slope, **place).limit
        judged.append(sample)
        smooth = spectrum is surfaces.gaussian
        e = 1.0 if smooth else occlusion(model, model.constants, [sample]).values.item()
        print(row(case if smooth else f"{case}, E = {e:.2f}", model, sample, e))
        print(row("  neighbouring facets", neighbours, sample, e))
        if smooth:
            print(fast_row(model, sample))
    if arguments.keep:
        keep(judged[: len(SLOPES)], arguments.keep)


if __name__ == "__main__":
    main()
