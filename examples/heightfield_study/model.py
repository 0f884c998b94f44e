"""The library's heightfield at the directions of a sample."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
import torch
from surfaces import Array

from torchbrdf import Cosines, fixed
from torchbrdf.models.heightfield.surface import OCCLUSION, GaussianHeightfield
from torchbrdf.models.heightfield.transport import INDEPENDENT_FACETS, Transport
from torchbrdf.models.heightfield.visibility import SMOOTH_HEIGHTFIELD, HeightfieldConstants

NODES = 384  # 2e-5 of f_1


@dataclass(frozen=True)
class LibraryModel:
    """f_n (n, i, r, k) as a function of (slope, occlusion, constants, bounces)."""

    cosines: Cosines
    constants: tuple[float, ...] = astuple(SMOOTH_HEIGHTFIELD)
    highest_occlusion: float = OCCLUSION.high
    transport: Transport = INDEPENDENT_FACETS

    @classmethod
    def at(cls, polar: Array, azimuths: int) -> "LibraryModel":
        light = torch.as_tensor(polar)[:, None, None]
        view = torch.as_tensor(polar)[None, :, None]
        dphi = 2 * torch.pi * torch.arange(azimuths, dtype=torch.float64) / azimuths
        vectors = (
            torch.stack(torch.broadcast_tensors(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()), -1)
            for theta, phi in ((light, torch.zeros_like(dphi)), (view, dphi))
        )
        return cls(Cosines.of(torch.tensor([0.0, 0, 1], dtype=torch.float64), *torch.broadcast_tensors(*vectors)))

    def __call__(self, slope: float, occlusion: float, constants: Sequence[float], bounces: int) -> Array:
        brdf = GaussianHeightfield.from_rms_slope(
            fixed(torch.tensor(slope, dtype=torch.float64)),
            occlusion=fixed(torch.tensor(occlusion, dtype=torch.float64)),
            bounces=bounces,
            nodes=NODES,
            constants=HeightfieldConstants(*map(float, constants)),
            transport=self.transport,
        )
        with torch.no_grad():
            return np.moveaxis(brdf.fields(self.cosines).numpy(), -1, 0)
