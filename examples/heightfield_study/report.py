"""The study's tables, as text: meshes, constants, errors of the model, other spectra."""

from collections.abc import Sequence

import numpy as np
from calibration import Error, Fit, Model, constants, error, occlusion, turn
from runs import Study
from samples import Sample, chi_square, distinct

NAMES = ("a", "b", "K", "k")
PARTS = {
    "f1": (1.0,),
    "f2": (0.0, 1.0),
    "f3": (0.0, 0.0, 1.0),
    **{f"rho {rho:g}": tuple(rho ** np.arange(1, 25)) for rho in (0.25, 0.5, 0.9)},
}
BOUNCES = 24


def mesh_table(study: Study) -> list[str]:
    """What meshes of so many cells per tau do to f_1, f_2 and f_3, against the limit from the two finest."""
    limit = study.limit
    lines = [f"Meshes against the limit of vanishing cells, s = {limit.slope:g}, % (80/80: equal angles of 80 deg):"]
    lines.append("  cells/tau  bounce    rms  +- of an entry    80/80 at 180 deg      80/80 at 0 deg")
    for cells, sample in study.meshes.items():
        for n in range(min(3, len(limit.f))):
            each = (sample.each[:, n] - limit.each[:, n]) / limit.f[n]
            mean, se = 100 * each.mean(0), 100 * each.std(0, ddof=1) / np.sqrt(len(each))
            rms, noise = (np.sqrt(np.mean(distinct(values) ** 2)) for values in (mean, se))
            half = mean.shape[-1] // 2
            ends = "".join(f"    {mean[-1, -1, k]:7.2f} +- {se[-1, -1, k]:5.2f}" for k in (half, 0))
            lines.append(f"  {cells:9d}{n + 1:8d}{rms:9.2f}{noise:13.2f}    {ends}")
    return lines


def constants_line(fit: Fit) -> str:
    pairs = zip(NAMES, fit.values.tolist(), fit.errors.tolist(), strict=True)
    return "Constants: " + "   ".join(f"{name} {value:.4f} +- {se:.4f}" for name, value, se in pairs)


def error_table(model: Model, values: Sequence[float], cases: Sequence[tuple[str, Sample, float]]) -> list[str]:
    """Rows of (title, sample, occlusion)."""
    lines = [
        "Relative error of the model up to 80 deg, %: rms +- standard error (largest; noise of the data)",
        f"  {'':<16}" + "".join(f"{part:<29}" for part in PARTS),
    ]
    for title, sample, e in cases:
        predicted = model(sample.slope, e, values, BOUNCES)
        cells = (_cell(error(predicted, sample, weights)) for weights in PARTS.values())
        lines.append(f"  {title:<16}" + "".join(f"{cell:<29}" for cell in cells))
    return lines


def _cell(e: Error) -> str:
    return f"{100 * e.rms:.2f} +- {100 * e.rms_se:.2f} ({100 * e.largest:.1f}; {100 * e.noise:.2f})"


def turn_table(model: Model, values: Sequence[float], samples: Sequence[Sample]) -> list[str]:
    lines = ["Azimuth mode 1 of the bounces up to 60 deg, traced over the model's (damped as it is):"]
    for sample in samples:
        predicted = model(sample.slope, 1.0, values, BOUNCES)
        fits = (turn(predicted, sample, bounce) for bounce in (2, 3, 4))
        cells = "   ".join(f"f{n} {fit.values:.3f} +- {fit.errors:.3f}" for n, fit in enumerate(fits, 2))
        lines.append(f"  s = {sample.slope:<6g}{cells}")
    return lines


def agreement(one: Sample, other: Sample) -> str:
    values = "  ".join(f"f{n} {chi_square(one, other, n):.2f}" for n in (1, 2, 3, 4))
    return f"mean square of difference over standard error (1: as expected): {values}"


def full_report(
    model: Model, direct: Sequence[Sample], smooth: Sequence[Sample], others: dict[str, Sample]
) -> list[str]:
    """Constants from direct light, the errors left on other surfaces, and surfaces of other spectra.

    Errors are given for the constants found and for those that the library has.
    """
    fit = constants(model, direct)
    sets = {"found here": fit.values.tolist(), "of the library": list(model.constants)}
    lines = [constants_line(fit)]
    for title, values in sets.items():
        spectra = {name: occlusion(model, values, [sample]) for name, sample in others.items()}
        cases = [(f"s = {sample.slope:g}", sample, 1.0) for sample in smooth]
        cases += [(name, sample, spectra[name].values.item()) for name, sample in others.items()]
        lines += ["", f"With the constants {title}", *error_table(model, values, cases)]
        lines += [_occlusion_line(name, e, model.highest_occlusion) for name, e in spectra.items()]
        lines += turn_table(model, values, smooth)
    return lines


def _occlusion_line(name: str, e: Fit, highest: float) -> str:
    value, se = e.values.item(), e.errors.item()
    bound = value > 0.999 * highest
    return f"E of {name}: " + (f"{highest:g}, the most the model takes" if bound else f"{value:.3f} +- {se:.3f}")
