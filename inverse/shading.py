"""Radiance of a surface under lights. The only place where the cosine of the light enters."""

from collections.abc import Callable

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor

from inverse.geometry import Surface, pixel_average
from inverse.lights import Ambient, Distant, Light
from inverse.scene import Scene
from torchbrdf import BRDF, Cosines, is_per_texel

_AMBIENT_TABLE = 24
_TEXEL_NODES = 16


def cosines_to(light: Distant, surface: Surface) -> Cosines:
    """Cosines (point,) at the surface's masked points, in row-major order."""
    normals = surface.normals[surface.mask]
    view = surface.view if surface.view.ndim == 1 else surface.view[surface.mask]
    return Cosines.of(normals, light.direction.to(normals), view, normalize=True)


def received(cosines: Cosines, light: Distant) -> Tensor:
    """cos(light) irradiance (point, 1 or channel)."""
    irradiance = torch.atleast_1d(torch.as_tensor(light.irradiance)).to(cosines.light)
    return cosines.light[:, None] * irradiance


def reflected(model: BRDF, cosines: Cosines, light: Distant) -> Tensor:
    """f_r cos(light) irradiance (point, channel)."""
    return model.evaluate(cosines) * received(cosines, light)


def ambient_reflected(model: BRDF, surface: Surface, light: Ambient) -> Tensor:
    """Radiance (point, channel) under uniform light: the directional albedo times its radiance.

    The albedo is smooth in the view cosine, so it is computed at a few and interpolated by the
    polynomial through them (3e-4 for the Oren-Nayar models up to 85 degrees). A per-texel material has
    an albedo of its own at each point, which is integrated there, with fewer nodes.
    """
    normals = surface.normals[surface.mask]
    view = surface.view if surface.view.ndim == 1 else surface.view[surface.mask]
    cos_view = (normals * view).sum(-1).clamp(0, 1)
    if is_per_texel(model):
        return model.directional_albedo(cos_view, nodes=_TEXEL_NODES) * torch.as_tensor(light.radiance).to(cos_view)
    nodes = cos_view.new_tensor((1 + leggauss(_AMBIENT_TABLE)[0]) / 2)
    powers = torch.linalg.solve(torch.vander(2 * nodes - 1), model.directional_albedo(nodes))
    total = powers[0].expand(len(cos_view), -1)
    for coefficient in powers[1:]:
        total = total * (2 * cos_view[:, None] - 1) + coefficient
    return total * torch.as_tensor(light.radiance).to(cos_view)


def shader(surface: Surface, light: Light) -> Callable[[BRDF], Tensor]:
    """Function from a model to its radiance (point, channel) under one light; the geometry is done once."""
    if isinstance(light, Ambient):
        return lambda model: ambient_reflected(model, surface, light)
    cosines = cosines_to(light, surface)
    return lambda model: reflected(model, cosines, light)


def radiance(model: BRDF, surface: Surface, lights: tuple[Light, ...]) -> Tensor:
    """Radiance (point, channel) at the masked points under all the lights of one image.

    Per-texel parameters of the model run over the masked points, in row-major order.
    """
    first, *others = (shader(surface, light)(model) for light in lights)
    return sum(others, first)


def to_image(values: Tensor, surface: Surface) -> Tensor:
    """Values (point, channel) at the masked points as pixels (rows, columns, channel); 0 elsewhere.

    Raises ValueError for another number of points: a per-texel parameter of the wrong shape, mostly.
    """
    points = int(surface.mask.sum())
    if values.ndim != 2 or values.shape[0] != points:
        raise ValueError(
            f"the radiance must be (point, channel) with {points} points; found {tuple(values.shape)}. "
            f"Per-texel albedo is ({points}, channel), per-texel sigma ({points},)."
        )
    fine = values.new_zeros(*surface.mask.shape, values.shape[-1])
    return pixel_average(fine.masked_scatter(surface.mask[..., None], values), surface.samples)


def render(scene: Scene, model: BRDF) -> Tensor:
    """Radiance images (image, rows, columns, channel), averaged over each pixel, before the sensor."""
    return torch.stack([to_image(radiance(model, scene.surface, lights), scene.surface) for lights in scene.lights])
