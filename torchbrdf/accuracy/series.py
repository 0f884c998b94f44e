"""What accuracy costs in the He-Torrance series: ways to sum it, in error by roughness and in time.

g is log-uniform from 1e-3 to 1e5, t/max(g, 1) from 1e-3 to 10: mirrors to facets, peak to far tail of the lobe.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import torch
from torch import Tensor

from torchbrdf.accuracy.ladders import interleaved_medians
from torchbrdf.directions import Cosines
from torchbrdf.models.he_torrance.expansion import expansion
from torchbrdf.models.he_torrance.series import first_terms_over_g, series_over_g
from torchbrdf.models.lambert import Lambert

Scheme = Callable[[Tensor, Tensor], Tensor]

_POWERS_OF_G, _POWERS_OF_T = (-3.0, 5.0), (-3.0, 1.0)
_BINS_A_DECADE = 2
# Ends of the columns of the table, as powers of 10 of g.
_COLUMNS = (-3, 0, 1, 2, 3, 5)
# What a single point may be off by before it counts as wrong. [-]
_WRONG = 1e-5
# S/g below this has no relative error in float32 that anyone would see. [-]
_SEEN = 1e-30


def expanded(g: Tensor, t: Tensor) -> Tensor:
    """S/g from the saddle-point expansion alone, to the fifth power of 1/m."""
    return expansion(g, t, [(0, 0)], degree=5)[0]


SCHEMES: Mapping[str, Scheme] = {
    **{f"first {n} terms": partial(first_terms_over_g, terms=n) for n in (10, 40, 200)},
    "expansion alone": expanded,
    "as shipped": series_over_g,
}


@dataclass(frozen=True)
class SeriesRow:
    """One scheme, measured.

    Attributes:
        largest: relative error, at most, in each bin of log g.
        wrong: share of all points that are off by more than 1e-5.
        forward: time relative to Lambert on as many points.
    """

    name: str
    largest: tuple[float, ...]
    wrong: float
    forward: float


@dataclass(frozen=True)
class SeriesLadder:
    """Rows of `series_ladder`; `edges` are those of the bins of g."""

    rows: tuple[SeriesRow, ...]
    edges: tuple[float, ...]

    def to_markdown(self) -> str:
        """The rows as a table, errors by range of g."""
        ranges = list(pairwise(_COLUMNS))
        heads = " | ".join(f"g {10.0**low:g} to {10.0**high:g}" for low, high in ranges)
        lines = [f"| scheme | {heads} | off by > 1e-5 | time |", "|---" * (len(ranges) + 3) + "|"]
        for row in self.rows:
            cells = []
            for low, high in ranges:
                first, last = ((power - _COLUMNS[0]) * _BINS_A_DECADE for power in (low, high))
                error = max(row.largest[first:last])
                cells.append("> 1" if error > 1 else f"{error:.1e}")
            lines.append(f"| {row.name} | {' | '.join(cells)} | {row.wrong:.2%} | {row.forward:.0f} x |")
        return "\n".join(lines)


def series_ladder(
    *, points: int = 1 << 17, schemes: Mapping[str, Scheme] = SCHEMES, repeats: int = 5, seed: int = 0
) -> SeriesLadder:
    """Error and time of every scheme in float32, eager, on the CPU.

    Args:
        points: pairs (g, t) to judge by and to time on, drawn with `seed`.
        schemes: by name, functions of g and t (point,) to S/g.
        repeats: timings of each, interleaved; the median counts. Processor time, all threads together.
    Errors are relative to `series_over_g` in float64, good to 1e-11; a result that is not finite counts as infinite.
    """
    u, v = torch.rand(2, points, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    power = _POWERS_OF_G[0] + (_POWERS_OF_G[1] - _POWERS_OF_G[0]) * u
    g = (10**power).float()
    t = (10 ** (_POWERS_OF_T[0] + (_POWERS_OF_T[1] - _POWERS_OF_T[0]) * v)).float() * g.clamp(min=1)
    exact = series_over_g(g.double(), t.double())
    seen = exact > _SEEN
    bins = int((_POWERS_OF_G[1] - _POWERS_OF_G[0]) * _BINS_A_DECADE)
    place = ((power - _POWERS_OF_G[0]) * _BINS_A_DECADE).long().clamp(max=bins - 1)[seen]
    cosines = Cosines.from_products(*torch.full((3, points), 0.5))
    calls: dict[str, tuple[Callable[[], object], int]] = {"Lambert": (partial(Lambert().evaluate, cosines), points)}
    calls |= {name: (partial(scheme, g, t), points) for name, scheme in schemes.items()}
    with torch.no_grad():
        seconds = interleaved_medians(calls, repeats, time.process_time)
        errors = {name: (scheme(g, t).double() / exact - 1).abs()[seen] for name, scheme in schemes.items()}
    rows = []
    for name, scheme_errors in errors.items():
        error = scheme_errors.nan_to_num(nan=torch.inf)
        largest = error.new_zeros(bins).scatter_reduce(0, place, error, "amax")
        wrong = (error > _WRONG).double().mean().item()
        rows.append(SeriesRow(name, tuple(largest.tolist()), wrong, seconds[name] / seconds["Lambert"]))
    edges = (10 ** torch.linspace(*_POWERS_OF_G, bins + 1)).tolist()
    return SeriesLadder(tuple(rows), tuple(edges))
