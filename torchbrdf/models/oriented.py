"""An anisotropic material whose grain follows one direction in space."""

from dataclasses import replace
from typing import final

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF, Option
from torchbrdf.directions import Cosines
from torchbrdf.parameters import paths
from torchbrdf.sampling import Sample


@final
class Oriented(BRDF):
    """Gives another BRDF its tangent: the projection of a fixed direction onto the surface, like the grain of wood.

    Args:
        brdf: the material.
        direction: (3,) of any length; nowhere parallel to a normal.
    Components: those of the material.
    Raises: what `Cosines.of` raises. A tangent given to `forward` takes precedence.
    """

    direction: Tensor

    def __init__(self, brdf: BRDF, direction: Tensor):
        super().__init__()
        self.brdf = brdf
        self.register_buffer("direction", torch.as_tensor(direction).detach().clone())

    @property
    def anisotropic(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.brdf.anisotropic

    def cosines(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> Cosines:
        tangent = self._grain(normal) if tangent is None else tangent
        return Cosines.of(normal, light, view, tangent=tangent, normalize=normalize)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        if cosines.tangent is None:  # made without the model: by a renderer, for all models alike
            cosines = replace(cosines, tangent=self._grain(cosines.light))
        return self.brdf.evaluate_components(cosines)

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        return self.brdf.directional_albedo(cos_view, nodes=nodes)

    def sample(self, normal: Tensor, view: Tensor, u: Tensor, *, tangent: Tensor | None = None) -> Sample:
        return self.brdf.sample(normal, view, u, tangent=self._grain(normal) if tangent is None else tangent)

    def pdf(self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None) -> Tensor:
        return self.brdf.pdf(normal, light, view, tangent=self._grain(normal) if tangent is None else tangent)

    def delta_reflectance(self, cosines: Cosines) -> Tensor | None:
        return self.brdf.delta_reflectance(cosines)

    def delta_probability(self, cosines: Cosines) -> Tensor:
        return self.brdf.delta_probability(cosines)

    def _grain(self, like: Tensor) -> Tensor:
        """The direction as a tangent beside other directions, whose dtype is theirs."""
        return self.direction.to(like.dtype)

    def stand_ins(self) -> dict[str, list[Option]]:
        """Those of the material, turned the same way; bare where they have no grain."""
        return {group: [self._of(option) for option in options] for group, options in self.brdf.stand_ins().items()}

    def _of(self, option: Option) -> Option:
        grain = option.model.anisotropic
        given = set(paths(self.brdf))
        renamed = {}
        for path in paths(option.model):
            before = option.renamed.get(path, path)
            if before in given and (path != before or not grain):
                renamed[f"brdf.{path}" if grain else path] = f"brdf.{before}"
        model = Oriented(option.model, self.direction) if grain else option.model
        return replace(option, model=model, renamed=renamed)
