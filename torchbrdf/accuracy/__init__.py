"""What accuracy costs: ladders of models against their references, in error, time and memory."""

from torchbrdf.accuracy.ladders import (
    RUNGS,
    Ladder,
    Row,
    Rung,
    cost,
    forward_ratios,
    interleaved_medians,
    ladder,
    reference,
    relative_errors,
    rungs_of,
)
from torchbrdf.accuracy.series import (
    SCHEMES,
    SeriesLadder,
    SeriesRow,
    expanded,
    series_ladder,
)

__all__ = [
    "RUNGS",
    "SCHEMES",
    "Ladder",
    "Row",
    "Rung",
    "SeriesLadder",
    "SeriesRow",
    "cost",
    "expanded",
    "forward_ratios",
    "interleaved_medians",
    "ladder",
    "reference",
    "relative_errors",
    "rungs_of",
    "series_ladder",
]
