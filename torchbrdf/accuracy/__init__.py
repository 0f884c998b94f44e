"""What accuracy costs: ladders of models against their references, in error, time and memory."""

from torchbrdf.accuracy.conversions import (
    eon_roughness_from_sigma,
    fitted_roughness,
    fujii_roughness_from_sigma,
)
from torchbrdf.accuracy.heightfields import DIFFUSE_RUNGS, heightfield_reference
from torchbrdf.accuracy.ladders import (
    RUNGS,
    Ladder,
    Row,
    Rung,
    cost,
    forward_ratios,
    interleaved_medians,
    ladder,
    relative_errors,
    rungs_of,
)
from torchbrdf.accuracy.references import (
    converged,
    reference,
    reference_error,
)
from torchbrdf.accuracy.series import (
    SCHEMES,
    SeriesLadder,
    SeriesRow,
    expanded,
    series_ladder,
)

__all__ = [
    "DIFFUSE_RUNGS",
    "RUNGS",
    "SCHEMES",
    "Ladder",
    "Row",
    "Rung",
    "SeriesLadder",
    "SeriesRow",
    "converged",
    "cost",
    "eon_roughness_from_sigma",
    "expanded",
    "fitted_roughness",
    "forward_ratios",
    "fujii_roughness_from_sigma",
    "heightfield_reference",
    "interleaved_medians",
    "ladder",
    "reference",
    "reference_error",
    "relative_errors",
    "rungs_of",
    "series_ladder",
]
