"""Radiance of a surface under lights. The only place where the cosine of the light enters."""

import math
from collections.abc import Callable, Iterator

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor

from inverse.arriving import arriving
from inverse.footprints import Footprints
from inverse.lights import Ambient, Arrival, Directional, Disc, Environment, Light
from inverse.plan import Plan
from inverse.radiosity import bounced, sky_share
from inverse.scene import Scene
from torchbrdf import BRDF, Cosines, is_per_texel

_AMBIENT_TABLE = 24
_TEXEL_NODES = 16
_ALBEDO_NODES = 12


def cosines_to(arrival: Arrival, where: Footprints) -> Cosines:
    """Cosines (point,) of light that arrives at the points."""
    return Cosines.of(where.normals, arrival.direction, where.view, normalize=True)


def received(cosines: Cosines, arrival: Arrival) -> Tensor:
    """cos(light) irradiance (point, 1 or channel)."""
    return cosines.light[:, None] * arrival.irradiance


def arrivals(light: Directional, where: Footprints) -> Iterator[Arrival]:
    """The directions from which a light reaches the points, with no irradiance where the solid hides it."""
    return arriving(light, where.points, where.normals, where.solid)


def extended_reflected(model: BRDF, where: Footprints, light: Disc | Environment) -> Tensor:
    """Radiance (point, channel) under a source of finite size: f_r cos(light) summed over its directions, (31).

    A mirror lobe, which f_r cannot show, reads the source in the mirror direction instead.
    """
    total = where.normals.new_zeros(len(where.normals), 1)
    for arrival in arrivals(light, where):
        cosines = cosines_to(arrival, where)
        total = total + model.evaluate(cosines) * received(cosines, arrival)
    image = 2 * (where.normals * where.view).sum(-1, keepdim=True) * where.normals - where.view
    mirror = model.delta_reflectance(Cosines.of(where.normals, image, where.view, normalize=True))
    return total if mirror is None else total + mirror * light.seen(image)


def ambient_reflected(model: BRDF, where: Footprints, light: Ambient) -> Tensor:
    """Radiance (point, channel) under uniform light: the directional albedo times its radiance.

    The albedo is smooth in the view cosine, so it is computed at a few and interpolated by the
    polynomial through them (3e-4 for the Oren-Nayar models up to 85 degrees). A per-texel material has
    an albedo of its own at each point, which is integrated there, with fewer nodes.
    """
    cos_view = (where.normals * where.view).sum(-1).clamp(0, 1)
    if is_per_texel(model):
        return model.directional_albedo(cos_view, nodes=_TEXEL_NODES) * torch.as_tensor(light.radiance).to(cos_view)
    nodes = cos_view.new_tensor((1 + leggauss(_AMBIENT_TABLE)[0]) / 2)
    powers = torch.linalg.solve(torch.vander(2 * nodes - 1), model.directional_albedo(nodes))
    total = powers[0].expand(len(cos_view), -1)
    for coefficient in powers[1:]:
        total = total * (2 * cos_view[:, None] - 1) + coefficient
    return total * torch.as_tensor(light.radiance).to(cos_view)


def shader(where: Footprints, light: Light) -> Callable[[BRDF], Tensor]:
    """Function from a model to its radiance (point, channel) under one light.

    The geometry of a light with one direction is done once; of more there would be too much to keep.
    """
    if isinstance(light, Ambient):
        sky = None if where.partner is None else sky_share(where.partner, where.points, where.normals)[:, None]
        return lambda model: ambient_reflected(model, where, light) * (1 if sky is None else sky)
    if isinstance(light, Disc | Environment):
        return lambda model: extended_reflected(model, where, light)
    arrival = next(arrivals(light, where))
    cosines = cosines_to(arrival, where)
    return lambda model: model.evaluate(cosines) * received(cosines, arrival)


def exchanged(where: Footprints, lights: tuple[Light, ...]) -> Callable[[BRDF], Tensor]:
    """Function from a model to the radiance (point, channel) that parts of the solid send on to each other.

    Diffuse: the parts, and the point for this light, scatter as Lambert surfaces of the model's white-sky albedo.
    """
    assert where.partner is not None
    images = bounced(where.partner, lights, where.points, where.normals)
    return lambda model: passed_on(model, images)


def passed_on(model: BRDF, images: Tensor) -> Tensor:
    """sum_b rho^(b + 1) T_b/pi (point, channel) of irradiances T_b (bounce, point, channel) among white parts."""
    if is_per_texel(model):
        raise ValueError(
            "light between parts needs one material: the model has parameters per texel; set Scene.between_parts=False."
        )
    rho = white_sky_albedo(model, images)
    total, power = torch.zeros_like(images[0]), rho
    for image in images:
        power = power * rho
        total = total + power / math.pi * image
    return total


def white_sky_albedo(model: BRDF, like: Tensor) -> Tensor:
    """Share of uniform light that is reflected: 2 int E(mu) mu dmu (channel,), in the dtype of `like`. [-]"""
    nodes, weights = (like.new_tensor(k) for k in leggauss(_ALBEDO_NODES))
    cosines = (1 + nodes) / 2
    return (model.directional_albedo(cosines) * (cosines * weights)[:, None]).sum(0)


def radiance(model: BRDF, where: Footprints, lights: tuple[Light, ...]) -> Tensor:
    """Radiance (point, channel) at the points under all the lights of one image.

    Per-texel parameters of the model run over the points.
    """
    parts = [shader(where, light) for light in lights]
    if where.partner is not None:
        parts.append(exchanged(where, lights))
    first, *others = (part(model) for part in parts)
    return sum(others, first)


def render(scene: Scene, model: BRDF | Plan) -> Tensor:
    """Radiance images (image, rows, columns, channel), averaged over each pixel, before the sensor.

    Simulates what the scene has switched on, or what a plan keeps. ValueError for the plan of another scene.
    """
    if isinstance(model, Plan):
        scene, model = model.applied_to(scene)
    where = scene.footprints()
    images = [where.to_image(radiance(model, where, lights)) for lights in scene.lights]
    return torch.stack(torch.broadcast_tensors(*images))
