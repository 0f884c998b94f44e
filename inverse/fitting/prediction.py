"""What the camera would have recorded, as a function of the model's parameters.

The part that does not depend on the parameters is done once: cosines for any model; for models
linear in geometry images the images themselves, pixel-averaged and blurred, so that an evaluation
is K multiply-adds a pixel.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from inverse.scene import Scene
from inverse.transport import Contraction, images_of
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


@dataclass(frozen=True)
class Prediction:
    """Function from raw parameters to recorded values (image, P, channel).

    Attributes:
        basis, coefficients: where the values are images (image, P, 1 or channel, K) times coefficients (channel, K) of
            raw parameters, and nothing else, those two.
    """

    values: Predict
    basis: Tensor | None = None
    coefficients: Predict | None = None

    def __call__(self, raw: dict[str, Tensor]) -> Tensor:
        return self.values(raw)

    def channels(self, raw: dict[str, Tensor]) -> int:
        """How many the recorded values have."""
        if self.basis is None or self.coefficients is None:
            return self.values(raw).shape[-1]
        return max(self.basis.shape[2], self.coefficients(raw).shape[-2])


def predictor(scene: Scene, model: BRDF, pixels: Tensor, *, per_texel: bool) -> Prediction:
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
    footprints = scene.footprints()
    linear = model if isinstance(model, LinearBRDF) else None
    texels = pixels[scene.surface.mask] if scene.surface.samples == 1 else None

    def record(values: Tensor) -> Tensor:  # (point, channel) -> (P, channel)
        if texels is not None and scene.sensor.psf_sigma == 0:
            return values[texels] * scene.sensor.exposure
        return scene.sensor.focus(footprints.to_image(values))[pixels] * scene.sensor.exposure

    with torch.no_grad():
        images = images_of(footprints, scene.lights, record, linear=linear, texels=texels)
    if linear is None or not isinstance(images, Contraction):
        return Prediction(_of_raw(model, images))
    return Prediction(_of_raw(model, images), images.basis, _of_raw(linear, coefficients_of))


def coefficients_of(model: BRDF) -> Tensor:
    """Those of a linear model."""
    assert isinstance(model, LinearBRDF)
    return model.coefficients()


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
