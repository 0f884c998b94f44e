"""Rough diffuse models: a few fields of geometry and roughness, which the albedo enters last."""

from abc import abstractmethod

from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines


class FieldBRDF(BRDF):
    """A model whose light depends on the directions and the roughness through a few fields alone.

    Everything but the last step works on one number a pixel, whatever the number of channels; for a material per
    texel that is half the time of coefficients by channel.
    """

    @abstractmethod
    def fields(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """Functions of geometry and roughness, each (...); finite, but arbitrary below the horizon. [1/sr]"""

    @abstractmethod
    def reflected(self, *fields: Tensor) -> Tensor:
        """f_r (..., channel) [1/sr] of fields (..., 1), of which it is a linear function."""

    def evaluate(self, cosines: Cosines) -> Tensor:
        return self.reflected(*((field * cosines.lit)[..., None] for field in self.fields(cosines)))
