"""Rough diffuse models: a few fields of geometry and roughness, which the albedo enters last."""

from abc import abstractmethod

from torch import Tensor

from torchbrdf.brdf import BRDF, total
from torchbrdf.directions import Cosines
from torchbrdf.kernels import by_kernel


class FieldBRDF(BRDF):
    """A model whose light depends on the directions and the roughness through a few fields alone.

    Everything but the last step works on one number a pixel, whatever the number of channels; for a material per
    texel that takes half the time of coefficients by channel.
    """

    def forward(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> Tensor:
        """As `BRDF.forward`; by a compiled kernel where one is to be had (see `torchbrdf.native`)."""
        if tangent is None and not normalize:
            value = by_kernel(self, normal, light, view)
            if value is not None:
                return value
        return super().forward(normal, light, view, tangent=tangent, normalize=normalize)

    @abstractmethod
    def fields(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """Functions of geometry and roughness, each (...); finite, but arbitrary below the horizon. [1/sr]"""

    @abstractmethod
    def parts_of(self, *fields: Tensor) -> dict[str, Tensor]:
        """The named parts of f_r (..., channel) [1/sr] made of fields (..., 1): 0 where all fields are."""

    def sum_of(self, *fields: Tensor) -> Tensor:
        """The sum of `parts_of`; models override it where it takes fewer operations."""
        return total(self.parts_of(*fields).values())

    def evaluate(self, cosines: Cosines) -> Tensor:
        return self.sum_of(*((field * cosines.lit).unsqueeze(-1) for field in self.fields(cosines)))

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        return self.parts_of(*(field.unsqueeze(-1) for field in self.fields(cosines)))
