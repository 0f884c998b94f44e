"""What models read from a table have in common: evaluation, images for fits, and sampling."""

import math
from abc import abstractmethod

import torch
from torch import Tensor

from torchbrdf.directions import Cosines
from torchbrdf.interpolation.geometry import GeometryCoordinates, geometry_coordinates
from torchbrdf.interpolation.images import ImageTable
from torchbrdf.interpolation.materials import albedo_coordinate, roughness_coordinate
from torchbrdf.interpolation.splines import SplineTable, interpolate
from torchbrdf.linear import LinearBRDF
from torchbrdf.sampling import CltcSampled, equivalent_roughness


class InterpolatedSurface(CltcSampled, LinearBRDF):
    """A rough surface of one roughness and one albedo a pixel that is read from a table, which subclasses have.

    Linear in 1 + R images of the geometry, the first of which is 1. Components: all_bounces.
    """

    @abstractmethod
    def roughness_and_albedo(self) -> tuple[Tensor, Tensor]:
        """sigma, scalar or (...) [rad], and rho, scalar, (channel,) or (..., channel) [-]."""

    @abstractmethod
    def table(self, like: Tensor) -> ImageTable:
        """The table in the dtype and on the device of `like`; built when it is first asked for."""

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.roughness_and_albedo()[0])

    def component_coefficients(self) -> dict[str, Tensor]:
        sigma, albedo = self.roughness_and_albedo()
        return {"all_bounces": _shares(self.table(sigma), sigma, albedo)}

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        images = self._images(cosines)
        return (torch.ones_like(images[..., 0]), *images.unbind(-1))

    def basis(self, cosines: Cosines) -> Tensor:
        images = self._images(cosines)
        return cosines.zero_below_horizon(torch.cat((torch.ones_like(images[..., :1]), images), -1))

    def evaluate(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(self.evaluate_components(cosines)["all_bounces"])

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        sigma, albedo = self.roughness_and_albedo()
        tables = self.table(cosines.light), self.table(sigma)
        return {"all_bounces": interpolated(cosines, *tables, albedo=albedo, sigma=sigma)}

    def _images(self, cosines: Cosines) -> Tensor:
        return _images(self.table(cosines.light).geometry, geometry_coordinates(cosines))


def interpolated(
    cosines: Cosines, of_geometry: ImageTable, of_material: ImageTable, *, albedo: Tensor, sigma: Tensor
) -> Tensor:
    """f_r (..., channel) [1/sr], finite below the horizon, of one table in the dtypes of cosines and of sigma.

    Where no derivatives are asked for, and the material is the same everywhere, the table is contracted first.
    """
    at = geometry_coordinates(cosines)
    coefficients = _shares(of_material, sigma, albedo)
    coefficients = coefficients.to(torch.promote_types(coefficients.dtype, at.depth.dtype))
    smooth, shares = coefficients[..., 0], coefficients[..., 1:]
    if coefficients.ndim == 2 and not torch.is_grad_enabled():
        return smooth + _images(of_geometry.geometry.times(shares.mT), at)
    images = _images(of_geometry.geometry, at).to(coefficients.dtype)
    if coefficients.ndim == 2:
        return smooth + images @ shares.mT
    return smooth + (shares * images[..., None, :]).sum(-1)


def _shares(table: ImageTable, sigma: Tensor, albedo: Tensor) -> Tensor:
    """What a material takes of each image (..., channel, 1 + R) [1/sr]."""
    rho = torch.atleast_1d(albedo)
    shares = interpolate(table.material, (roughness_coordinate(sigma[..., None]), albedo_coordinate(rho)))
    smooth = torch.full_like(shares[..., :1], 1 / math.pi)
    return rho[..., None] * torch.cat((smooth, shares), -1)


def _images(geometry: SplineTable, at: GeometryCoordinates) -> Tensor:
    """The images (..., column)."""
    return interpolate(geometry, at[:3]) / at.mean_cosine[..., None]
