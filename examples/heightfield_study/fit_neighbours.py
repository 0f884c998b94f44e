"""The constants of `NEIGHBOURING_FACETS`: least squares on the two-bounce light of three traced surfaces.

    python examples/heightfield_study/fit_neighbours.py

Reads `tests/data/heightfield_traced.npz` (another program's tracing). Fits the relative errors of f_2 on the surfaces
`own_*`, 6 cells a correlation length with the constants of such meshes; prints the error before and after on them and
on `t12_*`, which are not fitted to. `fresh.py` judges the result on surfaces of the study's own. Deterministic, about
a minute.
"""

import argparse
from collections.abc import Callable
from dataclasses import astuple, fields, replace
from pathlib import Path

import numpy as np
import torch
from model import LibraryModel
from runs import AZIMUTHS, POLAR
from samples import distinct
from scipy.optimize import least_squares
from surfaces import Array

from torchbrdf.models.heightfield.neighbours import NEIGHBOURING_FACETS, NeighbouringFacets
from torchbrdf.models.heightfield.transport import INDEPENDENT_FACETS, Transport
from torchbrdf.models.heightfield.visibility import MESHED_HEIGHTFIELD, SMOOTH_HEIGHTFIELD

DATA = Path(__file__).parents[2] / "tests" / "data" / "heightfield_traced.npz"
SURFACES = {
    f"{kind}_{slope}": constants
    for kind, constants in (("own", MESHED_HEIGHTFIELD), ("t12", SMOOTH_HEIGHTFIELD))
    for slope in ("0.3", "0.67", "1")
}
START = (0.5, 0.0, 0.5, 0.2)  # across, along, shared, same_side


def errors_of(name: str, data: dict[str, Array], model: LibraryModel) -> Callable[[Transport], Array]:
    """Relative errors of f_2 (entries) on one surface as a function of the transport."""
    half = data[f"{name}_f2"].astype(float)  # dphi in [0, pi]
    truth = distinct(np.concatenate([half, half[..., -2:0:-1]], -1))
    slope, constants = float(data[f"{name}_s"]), astuple(SURFACES[name])

    def errors(transport: Transport) -> Array:
        return distinct(replace(model, transport=transport)(slope, 1.0, constants, 2)[1]) / truth - 1

    return errors


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    torch.set_num_threads(1)
    model = LibraryModel.at(POLAR, AZIMUTHS)
    with np.load(DATA) as file:
        errors = {name: errors_of(name, dict(file), model) for name in SURFACES}
    fitted_to = [errors[name] for name in SURFACES if name.startswith("own")]

    def residuals(values: Array) -> Array:
        return np.concatenate([error(NeighbouringFacets(*values.tolist())) for error in fitted_to])

    best = least_squares(residuals, START, diff_step=1e-3, x_scale=(0.5, 0.05, 0.5, 0.2)).x.tolist()
    for field, value in zip(fields(NeighbouringFacets), best, strict=True):
        print(f"{field.name:<10} {value:.3f}")
    for name, error in errors.items():
        before, after, kept = (
            np.sqrt(np.mean(error(transport) ** 2))
            for transport in (INDEPENDENT_FACETS, NeighbouringFacets(*best), NEIGHBOURING_FACETS)
        )
        print(f"{name:<9} f2 {before:.2%} -> {after:.2%} rms, with the library's constants {kept:.2%}")


if __name__ == "__main__":
    main()
