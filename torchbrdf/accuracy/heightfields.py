"""The ladder against the second truth: the rough diffuse models beside a random heightfield, not beside V-cavities."""

from dataclasses import replace

from torch import Tensor

from torchbrdf.accuracy.conversions import eon_roughness_from_sigma, fujii_roughness_from_sigma
from torchbrdf.accuracy.ladders import RUNGS, Rung
from torchbrdf.models.heightfield.fast import FastGaussianHeightfield
from torchbrdf.models.heightfield.surface import GaussianHeightfield
from torchbrdf.models.rough_diffuse import EON, FujiiOrenNayar
from torchbrdf.parameters import fixed

_OF_THE_CAVITIES = {rung.name: rung for rung in RUNGS}


def heightfield_reference(albedo: Tensor, sigma: Tensor) -> GaussianHeightfield:
    """The heightfield itself: 560 slopes in each direction, the finest table of bounces."""
    return GaussianHeightfield(albedo=albedo, sigma=sigma, nodes=560, polar_nodes=24)


def _trained(roughness: Tensor) -> Tensor | fixed:
    """Held where it is at the end of its domain: no trained parameter can sit there."""
    return roughness if bool((roughness < 1).all()) else fixed(roughness)


def _fujii(albedo: Tensor, sigma: Tensor) -> FujiiOrenNayar:
    return FujiiOrenNayar(albedo=albedo, roughness=_trained(fujii_roughness_from_sigma(sigma)))


def _eon(albedo: Tensor, sigma: Tensor) -> EON:
    return EON(albedo=albedo, roughness=_trained(eon_roughness_from_sigma(sigma)))


def _heightfield(nodes: int, occlusion: float = 1.0) -> Rung:
    def build(albedo: Tensor, sigma: Tensor) -> GaussianHeightfield:
        return GaussianHeightfield(albedo=albedo, sigma=sigma, occlusion=fixed(occlusion), nodes=nodes)

    return Rung(f"heightfield, {nodes} nodes" if occlusion else "Smith", build, points=1 << 12)


# Models of one albedo and one sigma, from the simple to the exact, on either surface.
DIFFUSE_RUNGS = (
    *(_OF_THE_CAVITIES[name] for name in ("Lambert", "qualitative (0.33)", "functional")),
    Rung("Fujii", _fujii),
    Rung("EON", _eon),
    replace(_OF_THE_CAVITIES["fast, all bounces"], name="fast V-cavities"),
    replace(_OF_THE_CAVITIES["exact, K = 16, all bounces"], name="exact V-cavities"),
    _heightfield(160, occlusion=0.0),
    Rung("fast heightfield", lambda albedo, sigma: FastGaussianHeightfield(albedo=albedo, sigma=sigma)),
    _heightfield(160),
    _heightfield(240),
)
