"""The size of a difference between two simulations: in radiance, or in the sigma a fit would find."""

import math
from dataclasses import replace

import torch
from torch import Tensor

from inverse.prediction import predictor
from inverse.scene import Scene
from torchbrdf import BRDF, trainable


class RadianceDifference:
    """Largest difference over the pilot, as a share of the reference's peak."""

    def __init__(self, reference: Tensor, tolerance: float):
        self.peak = reference.abs().max()
        if not self.peak > 0:
            raise ValueError("plan: no light reaches the object: its radiance is 0 everywhere.")
        self.reference = reference
        self.limit = tolerance

    def size(self, values: Tensor, scene: Scene, model: BRDF) -> float:
        """Of values (image, pixel, channel) against the reference."""
        return float((values - self.reference).abs().max() / self.peak)


class SigmaBias:
    """Bias of sigma [rad] when the reference is fitted by the simpler simulation: to first order, least squares.

    The limit is a share of the standard error of sigma that the sensor's noise leaves when all pixels are fitted, those
    the object fills. A pixel of the pilot counts as often as the pixels it stands for.
    """

    def __init__(
        self, reference: Tensor, tolerance: float, *, scene: Scene, model: BRDF, pixels: Tensor, stands_for: Tensor
    ):
        self.reference = reference
        self.pixels = pixels
        filled = scene.surface.coverage()[pixels] == 1
        self.root = (stands_for * filled).sqrt()[None, :, None].expand(reference.shape).reshape(-1, 1)
        sensor = scene.sensor
        well = 0.0 if sensor.full_well is None else float(reference.mean()) / (sensor.exposure * sensor.full_well)
        noise = math.sqrt((sensor.read_noise / sensor.exposure) ** 2 + well)
        if not noise > 0:
            raise ValueError(
                "plan(of='sigma') measures against the standard error of sigma: give the sensor its noise."
            )
        derivative, names, scale = self._derivative(scene, model)
        if not names:
            raise ValueError(f"plan(of='sigma') needs a model with a trained sigma; found {type(model).__name__}.")
        self.sigma = float(max(_physical(model, name) for name in names))
        covariance = torch.linalg.pinv(derivative.T @ derivative) * noise**2
        errors = [math.sqrt(float(covariance[place, place])) * abs(slope) for place, slope in scale]
        self.limit = tolerance * min(errors)

    def size(self, values: Tensor, scene: Scene, model: BRDF) -> float:
        """The largest bias of any sigma; where the simpler model has none, all of sigma is lost."""
        derivative, names, scale = self._derivative(scene, model)
        if not names:
            return self.sigma
        change = torch.linalg.lstsq(derivative, (self.reference - values).reshape(-1, 1) * self.root).solution[:, 0]
        return max(abs(float(change[place]) * slope) for place, slope in scale)

    def _derivative(self, scene: Scene, model: BRDF) -> tuple[Tensor, list[str], list[tuple[int, float]]]:
        """Weighted d values/d raw parameters (sample, parameter); the sigmas; their places, and d sigma/d raw."""
        entries = trainable(model)
        own = dict(model.named_parameters())
        raws = {raw: own[raw].detach() for raw, _ in entries.values()}
        bare = replace(scene, sensor=type(scene.sensor)())
        predict = predictor(bare, model, self.pixels, per_texel=False)
        jacobian = torch.func.jacfwd(predict)(raws)
        columns, scale, names, place = [], [], [], 0
        for name, (raw, domain) in entries.items():
            columns.append(jacobian[raw].reshape(self.reference.numel(), -1))
            if name.split(".")[-1].startswith("sigma"):
                slope = torch.func.jacfwd(domain.from_raw)(raws[raw].flatten()).diagonal()
                scale += [(place + k, float(v)) for k, v in enumerate(slope)]
                names.append(name)
            place += columns[-1].shape[1]
        found = torch.cat(columns, 1) if columns else self.reference.new_zeros(self.reference.numel(), 0)
        return found * self.root, names, scale


def _physical(model: BRDF, name: str) -> Tensor:
    *path, last = name.split(".")
    return getattr(model.get_submodule(".".join(path)), last).detach().max()
