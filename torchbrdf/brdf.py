"""What every BRDF is: a module from (normal, light, view) to reflectance, the sum of named parts."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from torchbrdf._numerics import safe_sqrt
from torchbrdf.directions import Cosines, any_tangent, orthonormal_tangent
from torchbrdf.parameters import Parametric
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.sampling import Sampled

if TYPE_CHECKING:
    from torchbrdf.mixture import WeightedSum


class BRDF(Sampled, Parametric, ABC):
    """Bidirectional reflectance distribution function f_r [1/sr], cosine not included.

    Subclasses implement `evaluate_components`, and `propose` with `density` where the sampling of `Sampled` is not
    good enough. Sums and multiples are BRDFs again:
    `0.7 * OrenNayar() + 0.3 * Lambert()` has two trainable weights.

    Attributes:
        anisotropic: whether reflectance depends on a direction along the surface, the tangent, which is then needed.
    """

    anisotropic: bool = False

    def forward(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> Tensor:
        """f_r (..., channel) [1/sr] for unit vectors (..., 3) that leave the surface.

        Zero, with zero gradient, unless light and view are both above the horizon. Raises what
        `Cosines.of` raises; `normalize=True` scales the vectors to unit length first. Anisotropic
        models need a tangent (..., 3); the others ignore it.
        """
        return self.evaluate(self.cosines(normal, light, view, tangent=tangent, normalize=normalize))

    def cosines(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> Cosines:
        """What the model reads of the directions; raises ValueError where it misses a tangent."""
        if self.anisotropic and tangent is None:
            raise ValueError(self._missing_tangent())
        return Cosines.of(normal, light, view, tangent=tangent, normalize=normalize)

    def tangent_of(self, normal: Tensor, tangent: Tensor | None) -> Tensor:
        """Unit tangent (..., 3) across the normal: the given one's, or any for a model to which all are alike.

        Raises ValueError where an anisotropic model misses a tangent.
        """
        if tangent is not None:
            return orthonormal_tangent(normal, tangent)
        if self.anisotropic:
            raise ValueError(self._missing_tangent())
        return any_tangent(normal)

    def _missing_tangent(self) -> str:
        return f"{type(self).__name__} is anisotropic and needs a tangent: pass tangent=... (..., 3)."

    def components(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> dict[str, Tensor]:
        """The named parts (..., channel) [1/sr] whose sum is `forward`."""
        cosines = self.cosines(normal, light, view, tangent=tangent, normalize=normalize)
        parts = self.evaluate_components(cosines)
        return {name: cosines.zero_below_horizon(part) for name, part in parts.items()}

    def evaluate(self, cosines: Cosines) -> Tensor:
        """f_r (..., channel) [1/sr] from cosines computed once (see `Cosines.of`)."""
        return cosines.zero_below_horizon(total(self.evaluate_components(cosines).values()))

    @abstractmethod
    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        """The named parts, each (..., channel); values below the horizon are arbitrary but finite."""

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """Share of light from direction `cos_view` (...) that is reflected in all directions (..., channel).

        Quadrature over the hemisphere: `nodes` Gauss-Legendre cosines times as many azimuths. [-]
        By reciprocity also the radiance under uniform ambient light of radiance 1. At 32 nodes the
        Oren-Nayar models are good to 3e-4 up to 85 degrees; narrow lobes need more nodes than they have
        widths in the hemisphere. Anisotropic models: for a view in the plane of normal and tangent.
        """
        x, w = gauss_legendre(nodes, cos_view)
        # the nodes come first, so that per-texel parameters line up with cos_view
        column = (nodes, 1, *(1,) * cos_view.ndim)
        cos_light, w_light = (t.reshape(column) for t in (x, w))
        dphi, w_dphi = (math.pi * t.reshape(column).transpose(0, 1) for t in (x, w))
        # d(cos_light) d(dphi) over half the circle of azimuths, which the other half mirrors
        weight = cos_light * w_light * w_dphi * 2
        sin_view, sin_light = (safe_sqrt((1 - c) * (1 + c)) for c in (cos_view, cos_light))
        if self.anisotropic:  # the view lies in the plane of normal and tangent
            weight = torch.cat((weight, weight), 1) / 2
            turn = torch.cat((dphi, -dphi), 1)
            light = (sin_light * turn.cos(), sin_light * turn.sin(), cos_light)
            vectors = [
                torch.stack(torch.broadcast_tensors(*v), -1) for v in (light, (sin_view, 0 * sin_view, cos_view))
            ]
            x, _, z = torch.eye(3, dtype=cos_view.dtype, device=cos_view.device)
            cosines = Cosines.of(z, *vectors, tangent=x, normalize=True)
        else:
            phase = cos_light * cos_view + sin_view * sin_light * dphi.cos()
            cosines = Cosines.from_products(cos_light, cos_view, phase)
        return (self.evaluate(cosines) * weight[..., None]).sum((0, 1))

    def stand_ins(self) -> "dict[str, list[Option]]":
        """What could be left out of this model, and by which cheaper model: none, unless a model says so.

        By group: an option of a group replaces another of the same, and options of different groups add up. Of each
        group the cheapest comes first; groups that drop parts of a sum come last. `torchbrdf.effects` holds names of
        effects, and a model may add its own. Whether anything may be left out of a scene is measured there
        (`inverse.plan`), what it costs and errs by in `torchbrdf.accuracy`.
        """
        return {}

    def __mul__(self, weight: Tensor | float) -> "WeightedSum":
        from torchbrdf.mixture import WeightedSum  # deferred: a sum is a BRDF

        return WeightedSum([self], [weight])

    __rmul__ = __mul__

    def __add__(self, other: "BRDF") -> "WeightedSum":
        return self * 1.0 + other

    def __radd__(self, other: object) -> "BRDF":
        # sum([a, b]) starts from 0
        return self if other == 0 else NotImplemented


@dataclass(frozen=True)
class Option:
    """A material that simulates less than a given one.

    Attributes:
        choice: what is simulated instead.
        skips: the effects left out.
        model: the whole material with the stand-in in it; values, and what is held fixed, are the given model's.
        renamed: of parameters of `model` by path ("parts.0.sigma"), the path in the given model where it differs.
    """

    choice: str
    skips: tuple[str, ...]
    model: BRDF
    renamed: Mapping[str, str] = field(default_factory=dict)


def total(values: Iterable[Tensor]) -> Tensor:
    """Sum of at least one tensor."""
    first, *others = values
    return sum(others, first)
