"""The size of a difference between two simulations: in radiance, or in the sigma a fit would find."""

import math
from collections.abc import Mapping
from dataclasses import replace

import torch
from torch import Tensor

from inverse.fitting import predictor
from inverse.scene import Scene
from torchbrdf import BRDF, trainable

# Directions of the parameters that the photographs tell less of than this share of the best are told nothing of.
_BLIND = 1e-6


class RadianceDifference:
    """Largest difference over the pilot, as a share of the reference's peak."""

    def __init__(self, reference: Tensor, tolerance: float):
        self.peak = reference.abs().max()
        if not self.peak > 0:
            raise ValueError(
                "plan: the radiance is 0 everywhere: no light reaches the object, or the model is a mirror and no "
                "light has an extent."
            )
        self.reference = reference
        self.limit = tolerance

    def size(self, values: Tensor, scene: Scene, model: BRDF, names: Mapping[str, str]) -> float:
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
        self.root = (stands_for * filled).double().sqrt()[None, :, None].expand(reference.shape).reshape(-1, 1)
        sensor = scene.sensor
        well = 0.0 if sensor.full_well is None else float(reference.mean()) / (sensor.exposure * sensor.full_well)
        noise = math.sqrt((sensor.read_noise / sensor.exposure) ** 2 + well)
        if not noise > 0:
            raise ValueError(
                "plan(of='sigma') measures against the standard error of sigma: give the sensor its noise."
            )
        derivative, sigmas = self._derivative(scene, model)
        if not sigmas:
            raise ValueError(f"plan(of='sigma') needs a model with a trained sigma; found {type(model).__name__}.")
        self.values = {name: _physical(model, name) for name in sigmas}
        lengths = derivative.norm(dim=0)
        _, singular, rows = torch.linalg.svd(derivative / lengths.where(lengths > 0, 1.0), full_matrices=False)
        told = singular > _BLIND * singular[0]
        errors = []
        for places in sigmas.values():
            for place, slope in places:
                along = rows[:, place]
                if along[~told].square().sum() > _BLIND or not lengths[place] > 0:
                    raise ValueError("plan(of='sigma'): these photographs do not determine sigma; add lights.")
                variance = float((along[told] / singular[told]).square().sum())
                errors.append(noise * math.sqrt(variance) / float(lengths[place]) * abs(slope))
        self.limit = tolerance * min(errors)

    def size(self, values: Tensor, scene: Scene, model: BRDF, names: Mapping[str, str]) -> float:
        """The largest bias of any sigma; of one that the simpler model has no more, all is lost.

        `names` are those of the given model, of parameters that have another in the simpler one.
        """
        derivative, sigmas = self._derivative(scene, model)
        left = {names.get(name, name) for name in sigmas}
        lost = [value for name, value in self.values.items() if name not in left]
        if not sigmas:
            return max(lost)
        lengths = derivative.norm(dim=0)
        seen = lengths > 0
        residual = (self.reference - values).double().reshape(-1, 1) * self.root
        step = torch.linalg.lstsq(derivative[:, seen] / lengths[seen], residual, driver="gelsd").solution[:, 0]
        change = torch.zeros_like(lengths).masked_scatter(seen, step / lengths[seen])
        biases = [abs(float(change[place]) * slope) for places in sigmas.values() for place, slope in places]
        worst = max(biases + lost)
        return worst if math.isfinite(worst) else math.inf

    def _derivative(self, scene: Scene, model: BRDF) -> tuple[Tensor, dict[str, list[tuple[int, float]]]]:
        """Weighted d values/d raw parameters (sample, parameter) in float64; the sigmas' places, and d sigma/d raw."""
        entries = trainable(model)
        own = dict(model.named_parameters())
        raws = {raw: own[raw].detach() for raw, _ in entries.values()}
        if not raws:
            return self.root.new_zeros(len(self.root), 0), {}
        bare = replace(scene, sensor=type(scene.sensor)())
        jacobian = torch.func.jacfwd(predictor(bare, model, self.pixels, per_texel=False))(raws)
        columns, sigmas, place = [], {}, 0
        for name, (raw, domain) in entries.items():
            columns.append(jacobian[raw].expand(*self.reference.shape, *raws[raw].shape).reshape(len(self.root), -1))
            if domain.angular:
                slopes = torch.func.jacfwd(domain.from_raw)(raws[raw].flatten()).diagonal()
                sigmas[name] = [(place + k, float(v)) for k, v in enumerate(slopes)]
            place += columns[-1].shape[1]
        return torch.cat(columns, 1).double() * self.root, sigmas


def _physical(model: BRDF, name: str) -> float:
    *path, last = name.split(".")
    return float(getattr(model.get_submodule(".".join(path)), last).detach().max())
