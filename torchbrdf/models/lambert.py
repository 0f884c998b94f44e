"""The perfectly diffuse surface."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf.directions import Cosines
from torchbrdf.linear import LinearBRDF
from torchbrdf.parameters import ALBEDO, Constrained, ParameterValue


@final
class Lambert(LinearBRDF):
    r"""Reflects the same radiance in every direction.

    .. math:: f_r = \rho / \pi

    Args:
        albedo: rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
    Source: Lambert 1760, Photometria; Fleet & Hertzmann 2006, "Computer Graphics Lecture Notes", University
        of Toronto, eq. (35).
    """

    albedo: Constrained = Constrained(ALBEDO)

    def __init__(self, *, albedo: ParameterValue = 0.5):
        super().__init__()
        self.albedo = albedo

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return (torch.ones_like(cosines.light),)

    def component_coefficients(self) -> dict[str, Tensor]:
        return {"direct": torch.atleast_1d(self.albedo)[..., None] / math.pi}
