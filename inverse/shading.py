"""Radiance of a surface under lights. The only place where the cosine of the light enters."""

from collections.abc import Callable, Iterator

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor

from inverse.geometry import Surface, pixel_average
from inverse.lights import Ambient, Arrival, Directional, Disc, Environment, Light
from inverse.scene import Scene
from torchbrdf import BRDF, Cosines, is_per_texel

_AMBIENT_TABLE = 24
_TEXEL_NODES = 16


def cosines_to(arrival: Arrival, surface: Surface) -> Cosines:
    """Cosines (point,) at the surface's masked points, in row-major order."""
    normals, view = normals_and_view(surface)
    return Cosines.of(normals, arrival.direction, view, normalize=True)


def normals_and_view(surface: Surface) -> tuple[Tensor, Tensor]:
    """Normals (point, 3) and view, (3,) or (point, 3), of the masked points."""
    view = surface.view if surface.view.ndim == 1 else surface.view[surface.mask]
    return surface.normals[surface.mask], view


def received(cosines: Cosines, arrival: Arrival) -> Tensor:
    """cos(light) irradiance (point, 1 or channel)."""
    return cosines.light[:, None] * arrival.irradiance


def arrivals(light: Directional, surface: Surface) -> Iterator[Arrival]:
    """The directions from which a light reaches the masked points."""
    return light.arrivals(surface.points[surface.mask])


def extended_reflected(model: BRDF, surface: Surface, light: Disc | Environment) -> Tensor:
    """Radiance (point, channel) under a source of finite size: f_r cos(light) summed over its directions, (31).

    A mirror lobe, which f_r cannot show, reads the source in the mirror direction instead.
    """
    normals, view = normals_and_view(surface)
    total = normals.new_zeros(len(normals), 1)
    for arrival in arrivals(light, surface):
        cosines = cosines_to(arrival, surface)
        total = total + model.evaluate(cosines) * received(cosines, arrival)
    image = 2 * (normals * view).sum(-1, keepdim=True) * normals - view
    mirror = model.delta_reflectance(Cosines.of(normals, image, view, normalize=True))
    return total if mirror is None else total + mirror * light.seen(image)


def ambient_reflected(model: BRDF, surface: Surface, light: Ambient) -> Tensor:
    """Radiance (point, channel) under uniform light: the directional albedo times its radiance.

    The albedo is smooth in the view cosine, so it is computed at a few and interpolated by the
    polynomial through them (3e-4 for the Oren-Nayar models up to 85 degrees). A per-texel material has
    an albedo of its own at each point, which is integrated there, with fewer nodes.
    """
    normals, view = normals_and_view(surface)
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
    """Function from a model to its radiance (point, channel) under one light.

    The geometry of a light with one direction is done once; of more there would be too much to keep.
    """
    if isinstance(light, Ambient):
        return lambda model: ambient_reflected(model, surface, light)
    if isinstance(light, Disc | Environment):
        return lambda model: extended_reflected(model, surface, light)
    arrival = next(arrivals(light, surface))
    cosines = cosines_to(arrival, surface)
    return lambda model: model.evaluate(cosines) * received(cosines, arrival)


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
    images = [to_image(radiance(model, scene.surface, lights), scene.surface) for lights in scene.lights]
    return torch.stack(torch.broadcast_tensors(*images))
