"""What the camera would have recorded, as a function of the model's parameters.

The part that does not depend on the parameters is done once: cosines for any model; for models
linear in geometry images the images themselves, pixel-averaged and blurred, so that an evaluation
is K multiply-adds a pixel.
"""

from collections.abc import Callable

import torch
from torch import Tensor, nn

from inverse.footprints import Footprints
from inverse.lights import Ambient, Light
from inverse.radiosity import bounced
from inverse.scene import Scene
from inverse.shading import arrivals, cosines_to, passed_on, received, shader
from torchbrdf import BRDF, Cosines, LinearBRDF

Predict = Callable[[dict[str, Tensor]], Tensor]


class _Call(nn.Module):
    """Lets torch.func.functional_call reach something else than `forward`."""

    def __init__(self, model: BRDF, compute: Callable[[BRDF], Tensor]):
        super().__init__()
        self.model = model
        self.compute = compute

    def forward(self) -> Tensor:
        return self.compute(self.model)


def predictor(scene: Scene, model: BRDF, pixels: Tensor, *, per_texel: bool) -> Predict:
    """Function from raw parameters (as in `model.named_parameters()`) to recorded values.

    Args:
        pixels: which pixels to predict, (rows, columns) bool with P true.
        per_texel: some parameters have one entry for each masked point. They cannot be mixed
            between pixels, so the surface must have one sample a pixel and the sensor no blur.
    Returns: function whose value is (image, P, channel), in the sensor's digital values.
    """
    if per_texel and (scene.surface.samples > 1 or scene.sensor.psf_sigma > 0):
        raise ValueError(
            "per-texel parameters need a surface with samples=1 and a sensor with psf_sigma=0; "
            f"found samples={scene.surface.samples}, psf_sigma={scene.sensor.psf_sigma} pixel."
        )
    ambient = any(isinstance(light, Ambient) for lights in scene.lights for light in lights)
    if isinstance(model, LinearBRDF) and not ambient:
        compute = _linear(scene, model, pixels)
    else:
        compute = _general(scene, pixels)
    if scene.between_parts:
        return _of_raw(model, _with_exchange(scene, pixels, compute))
    return _of_raw(model, compute)


def sample_predictor(cosines: Cosines, model: BRDF) -> Predict:
    """Function from raw parameters to f_r (sample, channel) [1/sr] in single pairs of directions."""
    if not isinstance(model, LinearBRDF):
        return _of_raw(model, lambda m: m.evaluate(cosines))
    with torch.no_grad():
        basis = model.basis(cosines)[:, None, :]

    def compute(model: BRDF) -> Tensor:
        assert isinstance(model, LinearBRDF)
        return (basis * model.coefficients()).sum(-1)

    return _of_raw(model, compute)


def _of_raw(model: BRDF, compute: Callable[[BRDF], Tensor]) -> Predict:
    call = _Call(model, compute)

    def predict(raw: dict[str, Tensor]) -> Tensor:
        return torch.func.functional_call(call, {f"model.{name}": value for name, value in raw.items()}, ())

    return predict


def _recorded(scene: Scene, where: Footprints, values: Tensor, pixels: Tensor) -> Tensor:
    """Values (point, channel) -> recorded at `pixels` (P, channel)."""
    if scene.surface.samples == 1 and scene.sensor.psf_sigma == 0:
        return values[pixels[scene.surface.mask]] * scene.sensor.exposure
    return scene.sensor.focus(where.to_image(values))[pixels] * scene.sensor.exposure


def _linear(scene: Scene, model: LinearBRDF, pixels: Tensor) -> Callable[[BRDF], Tensor]:
    with torch.no_grad():
        images, where = [], scene.footprints()
        for lights in scene.lights:
            first, *others = (_lit_basis(where, model, light) for light in lights)
            total = sum(others, first)  # (point, 1 or channel, K)
            images.append(_recorded(scene, where, total.flatten(1), pixels).unflatten(1, total.shape[1:]))
    basis = torch.stack(torch.broadcast_tensors(*images))  # (image, P, 1 or channel, K)
    inside = pixels[scene.surface.mask] if scene.surface.samples == 1 else None

    def compute(model: BRDF) -> Tensor:
        assert isinstance(model, LinearBRDF)
        coefficients = model.coefficients()  # (channel, K), or (masked point, channel, K) if per texel
        if coefficients.ndim > 2 and inside is not None:
            coefficients = coefficients[inside]
        return (basis * coefficients).sum(-1)

    return compute


def _with_exchange(scene: Scene, pixels: Tensor, alone: Callable[[BRDF], Tensor]) -> Callable[[BRDF], Tensor]:
    """Adds what the parts of the solid send on to each other: per image, irradiances recorded once."""
    where = scene.footprints()
    assert where.partner is not None
    recorded = []
    with torch.no_grad():
        for lights in scene.lights:
            images = bounced(where.partner, lights, where.points, where.normals)  # (bounce, point, channel)
            row = images.movedim(0, 1).flatten(1)
            kept = _recorded(scene, where, row, pixels).unflatten(1, (len(images), -1))
            recorded.append(kept.movedim(1, 0))

    def compute(model: BRDF) -> Tensor:
        passed = [passed_on(model, images) for images in recorded]
        return alone(model) + torch.stack(torch.broadcast_tensors(*passed))

    return compute


def _lit_basis(where: Footprints, model: LinearBRDF, light: Light) -> Tensor:
    """The model's geometry images times cosine and irradiance (point, 1 or channel, K)."""
    assert not isinstance(light, Ambient)
    total = torch.zeros(())
    for arrival in arrivals(light, where):
        cosines = cosines_to(arrival, where)
        total = total + received(cosines, arrival)[..., None] * model.basis(cosines)[:, None, :]
    return total


def _general(scene: Scene, pixels: Tensor) -> Callable[[BRDF], Tensor]:
    with torch.no_grad():
        where = scene.footprints()
        shaders = [[shader(where, light) for light in lights] for lights in scene.lights]

    def compute(model: BRDF) -> Tensor:
        images = []
        for parts in shaders:
            first, *others = (shade(model) for shade in parts)
            images.append(_recorded(scene, where, sum(others, first), pixels))
        return torch.stack(torch.broadcast_tensors(*images))

    return compute
