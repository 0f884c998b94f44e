"""Models that are linear in images of the geometry: f_r = sum_k coefficients_k(material) term_k(geometry)."""

from abc import abstractmethod
from collections.abc import Callable

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF, total
from torchbrdf.directions import Cosines

PIXELS_AT_A_TIME = 1024


class LinearBRDF(BRDF):
    """A model that is linear in images of the geometry: f_r = sum_k coefficients_k(material) term_k(geometry).

    The terms know nothing of the material and the coefficients nothing of the geometry, so a new
    material on known geometry costs K multiply-adds, and a fit needs the terms once.
    """

    @abstractmethod
    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """K functions of the geometry, each (...); finite, but arbitrary below the horizon."""

    @abstractmethod
    def component_coefficients(self) -> dict[str, Tensor]:
        """What each named part takes of each term: (..., channel, K) [1/sr]."""

    def basis(self, cosines: Cosines) -> Tensor:
        """The terms as one tensor (..., K), zero below the horizon."""
        return cosines.zero_below_horizon(torch.stack(torch.broadcast_tensors(*self.terms(cosines)), -1))

    def coefficients(self) -> Tensor:
        """(..., channel, K) [1/sr], such that f_r = (basis[..., None, :] * coefficients).sum(-1)."""
        return total(self.component_coefficients().values())

    def evaluate(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(_contract(self.coefficients(), self.terms(cosines)))

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        terms = self.terms(cosines)
        return {name: _contract(c, terms) for name, c in self.component_coefficients().items()}


class ImageBRDF(LinearBRDF):
    """A `LinearBRDF` of many terms, made and contracted as one tensor, some pixels at a time.

    A model states what its images read of the directions and what they are. Working memory without
    derivatives is that of `PIXELS_AT_A_TIME` pixels, plus K numbers a pixel where `basis` is asked for.
    """

    @abstractmethod
    def coordinates(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """What the images read of the directions, each (...)."""

    @abstractmethod
    def images(self, *coordinates: Tensor) -> Tensor:
        """The terms (..., K) at coordinates (...); finite, but arbitrary below the horizon."""

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return _in_pieces(self.images, self.coordinates(cosines)).unbind(-1)

    def basis(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(_in_pieces(self.images, self.coordinates(cosines)))

    def evaluate(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(self._seen_by(self.coefficients(), cosines))

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        coefficients = self.component_coefficients()
        together = torch.cat(list(coefficients.values()), -2)
        channels = [c.shape[-2] for c in coefficients.values()]
        parts = self._seen_by(together, cosines).split(channels, -1)
        return dict(zip(coefficients, parts, strict=True))

    def _seen_by(self, coefficients: Tensor, cosines: Cosines) -> Tensor:
        """Images times coefficients (..., channel, K), without keeping the images."""
        coordinates = self.coordinates(cosines)
        dtype = torch.promote_types(coefficients.dtype, cosines.light.dtype)
        coefficients = coefficients.to(dtype)
        if coefficients.ndim == 2:
            return _in_pieces(lambda *c: _times(self.images(*c).to(dtype), coefficients), coordinates)
        shape = torch.broadcast_shapes(coordinates[0].shape, coefficients.shape[:-2])
        rows = coefficients.expand(*shape, *coefficients.shape[-2:])
        wide = tuple(c.expand(shape) for c in coordinates)
        return _in_pieces(
            lambda row, *c: torch.einsum("...k,...ck->...c", self.images(*c).to(dtype), row), (rows, *wide)
        )


def _times(images: Tensor, coefficients: Tensor) -> Tensor:
    """Images (..., K) times coefficients (channel, K), from the left: pixels that are neighbours in memory stay so."""
    return coefficients @ images if images.ndim == 1 else (coefficients @ images.mT).mT


def _contract(coefficients: Tensor, terms: tuple[Tensor, ...]) -> Tensor:
    """sum_k coefficients[..., k] * terms[k] (..., channel), without stacking the terms."""
    return total([c * t[..., None] for c, t in zip(coefficients.unbind(-1), terms, strict=True)])


def _in_pieces(compute: Callable[..., Tensor], inputs: tuple[Tensor, ...]) -> Tensor:
    """compute(*inputs) over many pixels, some at a time; the last input's shape (...) leads in all of them."""
    shape = inputs[-1].shape
    if torch.compiler.is_compiling() or shape.numel() <= PIXELS_AT_A_TIME:
        return compute(*inputs)
    pieces = zip(*(t.flatten(0, len(shape) - 1).split(PIXELS_AT_A_TIME) for t in inputs), strict=True)
    return torch.cat([compute(*piece) for piece in pieces]).unflatten(0, shape)
