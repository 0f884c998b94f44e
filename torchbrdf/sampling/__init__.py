"""Directions drawn from densities over the hemisphere, and what every model offers of them."""

from torchbrdf.sampling.cltc import (
    CltcSampled,
    cltc_density,
    cltc_matrix,
    cltc_sample,
    cltc_uniform_share,
    equivalent_roughness,
)
from torchbrdf.sampling.draws import (
    Sample,
    along_view,
    choose,
    cosine_hemisphere,
    local_light,
    local_view,
    mirrored,
    power_cosine,
    towards,
    uniform_disc,
    uniform_hemisphere,
)
from torchbrdf.sampling.sampled import (
    Sampled,
    propose_from_parts,
)
from torchbrdf.sampling.visible_facets import (
    visible_beckmann_facet,
    visible_ggx_facet,
)

__all__ = [
    "CltcSampled",
    "Sample",
    "Sampled",
    "along_view",
    "choose",
    "cltc_density",
    "cltc_matrix",
    "cltc_sample",
    "cltc_uniform_share",
    "cosine_hemisphere",
    "equivalent_roughness",
    "local_light",
    "local_view",
    "mirrored",
    "power_cosine",
    "propose_from_parts",
    "towards",
    "uniform_disc",
    "uniform_hemisphere",
    "visible_beckmann_facet",
    "visible_ggx_facet",
]
