"""Makes `fast_rough_surface.json`: the fit of the exact V-cavity rough surface that `fast.py` evaluates.

    python examples/fast_fit/fit_fast_rough_surface.py [--output FILE] [--validate]     # about a minute, deterministic

What is fitted: pi d, pi i and pi h (direct, two bounces, three and more) of Gaussian slopes, as sums of terms
    factor * A^i S^j Q^k * x^e * (Chebyshev series in sigma),    factor in {1, D, P, G},   see `ring.py`.
1. Terms are chosen by orthogonal matching pursuit: the next term is the one that lowers the squared relative error of
   the total BRDF most, summed over a few roughnesses, each with free coefficients.
2. Coefficients are a linear least-squares fit over all directions and roughnesses at once, reweighted a few times to
   pull the largest errors down.
Training, validation (--validate: what to look at while a choice is still open) and report points have different seeds;
nothing is chosen by the last. One thread, so that sums do not depend on the number of cores; another processor or
another torch may still change last digits.
"""

import argparse
import json
import math
import time
from pathlib import Path

import torch
from least_squares import pursue, solve
from reference import Angles, Sample, directions, exact
from report import ALBEDOS, print_values, report
from torch import Tensor

from torchbrdf.models.oren_nayar import fast
from torchbrdf.models.oren_nayar import ring as coordinates
from torchbrdf.models.oren_nayar.ring import Term

ROOT = Path(__file__).parents[2]
FILE = Path(fast.__file__).with_name("fast_rough_surface.json")
SEEDS = {"train": 11, "horizon": 12, "validate": 21, "report": 61}
DEGREES = (
    *(0.0, 0.25, 0.5, 1, 1.5, 2, 3, 4, 5, 6.5, 8, 10, 12, 14, 17, 20),
    *(23, 26, 30, 34, 38, 43, 48, 54, 60, 68, 78, 90),
)
SELECT_DEGREES = (3, 5, 10, 20, 30, 43, 60, 90)
SERIES = 6  # Chebyshev coefficients of each term
COUNTS = {"direct": 22, "two_bounce": 16, "higher": 13}  # terms
EDGE = math.radians(85.5)  # directions beyond are fitted loosely: sane, not accurate
RESONANCE = (0.94, 0.013, 0.5)  # lambda_0 = a sigma^4/(sigma^4 + b), lambda_1 = c lambda_0


def ring_of(angles: Angles, sigma: Tensor) -> coordinates.Ring:
    return coordinates.ring(angles.cosines(), sigma)


def candidates(factors: str, degree: int) -> list[Term]:
    """Monomials up to a degree (Q counts twice).

    D and P alone are left out: they would put a cone at normal incidence, which no rough surface has.
    """
    terms: list[Term] = []
    for factor in factors:
        top = degree if factor == "1" else degree - 1
        powers = [
            (i, j, k) for i in range(top + 1) for j in range(top + 1) for k in range(top + 1) if i + j + 2 * k <= top
        ]
        terms += [(factor, *p) for p in powers if any(p) or factor in "1G"]
    return terms


def columns(angles: Angles, sigma: Tensor, terms: list[Term]) -> Tensor:
    """Values of the terms (P, N)."""
    r = ring_of(angles, sigma)
    factors = {"1": torch.ones_like(r.along), "D": r.apart, "P": r.opposite, "G": r.common}
    return torch.stack([factors[f] * r.along**i * r.depth**j * r.both**k for f, i, j, k in terms], dim=-1)


def trust(sample: Sample, which: int) -> Tensor:
    """1/(total BRDF) at albedo 0.6 (P,): errors are relative to it.

    Less beyond EDGE, where the total can vanish, and beyond 60 degrees of sigma.
    """
    total = sample.direct[:, which] + 0.6 * sample.two_bounce[:, which] + 0.01
    beyond = (sample.angles.light > EDGE) | (sample.angles.view > EDGE)
    weight = torch.where(beyond, 0.25 / (total + 0.05), 1 / total)
    return weight * (0.6 if sample.sigmas[which] > math.radians(61) else 1.0)


def order_at_zero(term: Term, part: str) -> int:
    """Power e of x that the series of a term carries.

    So that sigma -> 0 gives d ~ 1 - sigma^2 + sigma^2 p.q, i ~ sigma^2, h ~ sigma^4.
    """
    plain = term[0] == "1"
    first = plain and sum(term[1:]) == 0
    if first:
        return 2
    if part == "direct":
        return int(term in (("1", 1, 0, 0), ("1", 0, 1, 0)))
    return 1


def known(sample: Sample, which: int, part: str) -> Tensor:
    """The small-sigma form that is not fitted (P,)."""
    sigma = sample.sigmas[which]
    lead = coordinates.KNEE**2 * coordinates.knee(sigma)
    if part == "direct":
        return 1 - lead + ring_of(sample.angles, sigma).along / coordinates.KAPPA**2
    return lead * torch.ones_like(sample.direct[:, 0])


def series_of(sigma: Tensor, terms: list[Term], part: str) -> Tensor:
    """x^e T_j for each term (N, SERIES)."""
    x = coordinates.knee(sigma)
    row = torch.stack(coordinates.chebyshev(x, SERIES))
    return torch.stack([x ** order_at_zero(t, part) * row for t in terms])


def resonances(sigma: Tensor) -> tuple[Tensor, Tensor]:
    """Effective eigenvalues of the exchange of light in a cavity: lambda_0, lambda_1 [-]"""
    a, b, c = RESONANCE
    first = a * sigma**4 / (sigma**4 + b)
    return first, c * first


def two_bounce_fit(sample: Sample, part: str, factors: str, degree: int) -> tuple[list[Term], Tensor]:
    values = {"direct": sample.direct, "two_bounce": sample.two_bounce}[part]
    emphasis = {"direct": 1.0, "two_bounce": 0.6}[part]

    def system(which: int, terms: list[Term]) -> tuple[Tensor, Tensor]:
        weight = emphasis * trust(sample, which)
        target = (values[:, which] - known(sample, which, part)) * weight
        return columns(sample.angles, sample.sigmas[which], terms) * weight[:, None], target

    pool = candidates(factors, degree)
    picks = [nearest(sample.sigmas, d) for d in SELECT_DEGREES]
    systems = [system(k, pool) for k in picks]
    chosen = pursue([s[0][::2] for s in systems], [s[1][::2] for s in systems], COUNTS[part])
    terms = sorted(pool[n] for n in chosen)
    used = [k for k in range(len(sample.sigmas)) if sample.sigmas[k] > 0]
    systems = [system(k, terms) for k in used]
    return terms, solve(
        [s[0] for s in systems], [s[1] for s in systems], [series_of(sample.sigmas[k], terms, part) for k in used]
    )


def higher_fit(sample: Sample) -> tuple[list[Term], list[Term], Tensor]:
    """Terms of g0 and of g1, and their coefficients one after the other.

    h = rho^3 [g0/(1 - rho lambda_0) + g1/(1 - rho lambda_1)]
    """
    rho = torch.tensor(ALBEDOS, dtype=torch.float64)
    emphasis = torch.tensor([1.0 if r <= 0.9 else 0.4 for r in ALBEDOS], dtype=torch.float64)

    def system(which: int, resonant: list[Term], plain: list[Term]) -> tuple[Tensor, Tensor]:
        first, second = (rho**3 / (1 - rho * kept) for kept in resonances(sample.sigmas[which]))
        total = (
            rho * sample.direct[:, which, None] + rho**2 * sample.two_bounce[:, which, None] + sample.higher[:, which]
        )
        weight = (
            emphasis
            * (trust(sample, which) * (sample.direct[:, which] + 0.6 * sample.two_bounce[:, which] + 0.01))[:, None]
            / (total + 0.01)
        )
        rows = torch.cat(
            (
                columns(sample.angles, sample.sigmas[which], resonant)[:, None] * first[:, None],
                columns(sample.angles, sample.sigmas[which], plain)[:, None] * second[:, None],
            ),
            dim=-1,
        )
        return (rows * weight[..., None]).flatten(0, 1), (sample.higher[:, which] * weight).flatten()

    pool = candidates("1DP", 3)
    picks = [nearest(sample.sigmas, d) for d in SELECT_DEGREES if d >= 10]
    thin = Sample(Angles(*(a[::5] for a in sample.angles)), sample.sigmas, *(v[::5] for v in sample[2:]))
    full, sample = sample, thin
    systems = [system(k, pool, pool) for k in picks]
    order = pursue([s[0] for s in systems], [s[1] for s in systems], COUNTS["higher"])
    sample = full
    resonant = sorted(pool[n] for n in order if n < len(pool))
    plain = sorted(pool[n - len(pool)] for n in order if n >= len(pool))
    terms = resonant + plain
    used = [k for k in range(len(sample.sigmas)) if sample.sigmas[k] > math.radians(2)]
    systems = [system(k, resonant, plain) for k in used]
    return (
        resonant,
        plain,
        solve(
            [s[0] for s in systems],
            [s[1] for s in systems],
            [series_of(sample.sigmas[k], terms, "higher") for k in used],
            pull=0.08,
        ),
    )


def nearest(sigmas: Tensor, degrees: float) -> int:
    return int((sigmas - math.radians(degrees)).abs().argmin())


def training_sample() -> Sample:
    sigmas = torch.deg2rad(torch.tensor(DEGREES, dtype=torch.float64))
    inner = directions(SEEDS["train"], 6000, 85.5, edges=True)
    outer = directions(SEEDS["horizon"], 900, 89.95, edges=True)
    return exact(Angles(*(torch.cat(pair) for pair in zip(inner, outer, strict=True))), sigmas, albedos=ALBEDOS)


def stored(terms: list[Term], coefficients: Tensor, part: str) -> list[dict]:
    rows = []
    for term, row in zip(terms, coefficients.tolist(), strict=True):
        rows.append(
            {
                "factor": term[0],
                "powers": list(term[1:]),
                "order": order_at_zero(term, part),
                "series": [float(f"{c:.8g}") for c in row],
            }
        )
    return rows


def dump(table: dict) -> str:
    """JSON with one term a line."""
    lines = []
    for key, value in table.items():
        if isinstance(value, list):
            inner = ",\n    ".join(json.dumps(v) for v in value)
            lines.append(f'  "{key}": [\n    {inner}\n  ]')
        else:
            lines.append(f'  "{key}": {json.dumps(value)}')
    return "{\n" + ",\n".join(lines) + "\n}\n"


def main(output: Path, *, validate: bool) -> None:
    began = time.perf_counter()
    sample = training_sample()
    print(f"reference: {time.perf_counter() - began:.1f} s")
    direct = two_bounce_fit(sample, "direct", "1DPG", 4)
    two = two_bounce_fit(sample, "two_bounce", "1DP", 4)
    resonant, plain, higher = higher_fit(sample)
    table = {
        "generator": Path(__file__).relative_to(ROOT).as_posix(),
        "seeds": SEEDS,
        "kappa": coordinates.KAPPA,
        "level": coordinates.LEVEL,
        "knee": coordinates.KNEE,
        "resonance": RESONANCE,
        "direct": stored(*direct, "direct"),
        "two_bounce": stored(*two, "two_bounce"),
        "resonant": stored(resonant, higher[: len(resonant)], "higher"),
        "plain": stored(plain, higher[len(resonant) :], "higher"),
    }
    output.write_text(dump(table))
    print(f"fit: {time.perf_counter() - began:.1f} s;", {k: len(v) for k, v in table.items() if isinstance(v, list)})
    fast._FIT = fast._read(output)  # judged is what was just written, not what was there at import
    if validate:
        print_values("validation, edges", SEEDS["validate"], edges=True)
    else:
        report(SEEDS["report"])
    print(f"\ntotal {time.perf_counter() - began:.1f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Fit FastRoughSurface to the exact rough surface.")
    parser.add_argument("--output", type=Path, default=FILE)
    parser.add_argument("--validate", action="store_true", help="validation points instead of the report")
    arguments = parser.parse_args()
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    main(arguments.output, validate=arguments.validate)
