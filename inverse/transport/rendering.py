"""Radiance of a surface under lights, point by point and as images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor

from inverse.scene import Arrival, Footprints, Light, Scene, as_channels
from inverse.transport.common_geometry import CommonGeometry
from inverse.transport.exchange import passed_on, white_sky_albedo
from inverse.transport.radiosity import bounced, sky_share
from torchbrdf import BRDF, Cosines, LinearBRDF, is_per_texel

_AMBIENT_TABLE = 24
_TEXEL_NODES = 16

Values = Callable[[Tensor], Tensor]


def render(scene: Scene, model: BRDF) -> Tensor:
    """Radiance images (image, rows, columns, channel), averaged over each pixel, before the sensor.

    Simulates what the scene has switched on; `Plan.render` what a plan keeps.
    """
    footprints = scene.footprints()
    return images_of(footprints, scene.lights, footprints.to_image)(model)


def radiance_of(footprints: Footprints, lights: Sequence[Light]) -> Callable[[BRDF], Tensor]:
    """Function from a model to its radiance (point, channel) under lights that shine together."""
    images = images_of(footprints, [lights], lambda values: values)
    return lambda model: images(model)[0]


def images_of(
    footprints: Footprints,
    light_sets: Sequence[Sequence[Light]],
    record: Values,
    *,
    linear: LinearBRDF | None = None,
    texels: Tensor | None = None,
) -> Callable[[BRDF], Tensor]:
    """Function from a model to what is recorded (image, ..., channel) of its radiance under each set of lights.

    What does not depend on the model is done once, recording included.

    Args:
        record: linear function of values (point, channel), such as `footprints.to_image`.
        linear: for models of this kind alone: its geometry images are kept, so that each further material
            costs K multiply-adds. Used where no light has a uniform part.
        texels: which points are recorded, for linear models with parameters per texel.
    Per-texel parameters run over the points.
    """
    if linear is not None and not any(light.uniform is not None for lights in light_sets for light in lights):
        direct = _contraction(footprints, light_sets, record, linear, texels)
    else:
        direct = _reflection(footprints, light_sets, record)
    if footprints.partner is None:
        return direct
    bounces = [_recorded_bounces(footprints, lights, record) for lights in light_sets]
    return lambda model: direct(model) + _exchanged(model, bounces)


def _reflection(
    footprints: Footprints, light_sets: Sequence[Sequence[Light]], record: Values
) -> Callable[[BRDF], Tensor]:
    geometry = CommonGeometry(footprints)
    sets = [[reflected(footprints, geometry, light) for light in lights] for lights in light_sets]

    def images(model: BRDF) -> Tensor:
        sums = [sum((part(model) for part in parts[1:]), parts[0](model)) for parts in sets]
        return torch.stack(torch.broadcast_tensors(*(record(values) for values in sums)))

    return images


def _contraction(
    footprints: Footprints,
    light_sets: Sequence[Sequence[Light]],
    record: Values,
    linear: LinearBRDF,
    texels: Tensor | None,
) -> "Contraction":
    geometry, recorded = CommonGeometry(footprints), []
    for lights in light_sets:
        images = lit_basis(geometry, linear, lights)
        recorded.append(record(images.flatten(1)).unflatten(-1, images.shape[1:]))
    return Contraction(torch.stack(torch.broadcast_tensors(*recorded)), texels)


@dataclass(frozen=True)
class Contraction:
    """Function from a linear model to what is recorded of it (image, ..., channel): its images times its coefficients.

    Attributes:
        basis: the images as recorded (image, ..., 1 or channel, K).
        texels: which points are recorded, for parameters per texel.
    """

    basis: Tensor
    texels: Tensor | None = None

    def __call__(self, model: BRDF) -> Tensor:
        assert isinstance(model, LinearBRDF)
        coefficients = model.coefficients()  # (channel, K), or (point, channel, K) if per texel
        if coefficients.ndim > 2 and self.texels is not None:
            coefficients = coefficients[self.texels]
        return (self.basis * coefficients).sum(-1)


def _recorded_bounces(footprints: Footprints, lights: Sequence[Light], record: Values) -> Tensor:
    """Irradiances (bounce, ..., 1 or channel) that white parts of the solid send on to each other."""
    assert footprints.partner is not None
    bounces = bounced(footprints.partner, lights, footprints.points, footprints.normals)
    return torch.stack([record(bounce) for bounce in bounces])


def _exchanged(model: BRDF, bounces: Sequence[Tensor]) -> Tensor:
    rho = white_sky_albedo(model, bounces[0])
    return torch.stack(torch.broadcast_tensors(*(passed_on(rho, images) for images in bounces)))


def _lit(geometry: CommonGeometry, arrival: Arrival) -> tuple[Cosines, Tensor]:
    """Cosines (..., point), and cos(light) irradiance (..., point, 1 or channel).

    The only place where a camera's image takes the light's cosine.
    """
    cosines = geometry.cosines(arrival.direction)
    return cosines, cosines.light[..., None] * arrival.irradiance


def reflected(footprints: Footprints, geometry: CommonGeometry, light: Light) -> Callable[[BRDF], Tensor]:
    """Function from a model to the radiance (point, channel) that it reflects of one light.

    The geometry of a light with one direction is done once; of more there would be too much to keep.
    """
    sky = None
    if light.uniform is not None and footprints.partner is not None:
        sky = sky_share(footprints.partner, footprints.points, footprints.normals)[:, None]
    kept = [] if light.extended else [_lit(geometry, arrival) for arrival in geometry.arrivals(light)]

    def radiance(model: BRDF) -> Tensor:
        total = geometry.normals.new_zeros(len(geometry.normals), 1)
        if light.uniform is not None:
            uniform = _uniform_reflected(model, geometry, light.uniform)
            total = total + (uniform if sky is None else uniform * sky)
        for cosines, strength in kept:
            total = total + model.evaluate(cosines) * strength
        if light.extended:
            for arrivals in geometry.batches(light):
                cosines, strength = _lit(geometry, arrivals)
                total = total + (model.evaluate(cosines) * strength).sum(0)
            total = total + _mirrored(model, geometry, light)
        return total

    return radiance


def lit_basis(geometry: CommonGeometry, model: LinearBRDF, lights: Sequence[Light]) -> Tensor:
    """A linear model's geometry images times cosine and irradiance (point, 1 or channel, K), of lights without a
    uniform part."""
    total = geometry.normals.new_zeros(len(geometry.normals), 1, 1)
    for light in lights:
        for arrival in geometry.arrivals(light):
            cosines, strength = _lit(geometry, arrival)
            total = total + strength[..., None] * model.basis(cosines)[:, None, :]
    return total


def _mirrored(model: BRDF, geometry: CommonGeometry, light: Light) -> Tensor:
    """What a mirror lobe, which f_r cannot show, sends of an extended light: its radiance in the mirror direction."""
    image = 2 * geometry.cos_view[:, None] * geometry.normals - geometry.view
    mirror = model.delta_reflectance(geometry.cosines(image))
    return torch.zeros_like(geometry.normals[:, :1]) if mirror is None else mirror * light.seen(image)


def _uniform_reflected(model: BRDF, geometry: CommonGeometry, uniform: Tensor | float) -> Tensor:
    """Radiance (point, channel) under uniform light: the directional albedo times its radiance.

    The albedo is smooth in the view cosine, so it is computed at a few and interpolated by the
    polynomial through them (3e-4 for the Oren-Nayar models up to 85 degrees). A per-texel material has
    an albedo of its own at each point, which is integrated there, with fewer nodes.
    """
    cos_view = geometry.cos_view.clamp(0, 1)
    strength = as_channels(uniform, cos_view)
    if is_per_texel(model):
        return model.directional_albedo(cos_view, nodes=_TEXEL_NODES) * strength
    nodes = cos_view.new_tensor((1 + leggauss(_AMBIENT_TABLE)[0]) / 2)
    albedo = model.directional_albedo(nodes)
    powers = torch.linalg.solve(torch.vander(2 * nodes - 1).to(albedo), albedo)
    total = powers[0].expand(len(cos_view), -1)
    for coefficient in powers[1:]:
        total = total * (2 * cos_view[:, None] - 1) + coefficient
    return total * strength
