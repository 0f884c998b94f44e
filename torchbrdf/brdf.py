"""What every BRDF is: a module from (normal, light, view) to reflectance, the sum of named parts."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import torch
from torch import Tensor, nn

from torchbrdf._numerics import safe_sqrt
from torchbrdf.directions import Cosines
from torchbrdf.parameters import WEIGHT, Constrained, Parametric, fixed
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.sampled import Sampled, propose_from_parts

PIXELS_AT_A_TIME = 4096


class BRDF(Sampled, Parametric, ABC):
    """Bidirectional reflectance distribution function f_r [1/sr], cosine not included.

    Subclasses implement `evaluate_components`, and `propose` with `density` where the sampling of `Sampled` is not
    good enough. Sums and multiples are BRDFs again:
    `0.7 * OrenNayar() + 0.3 * Lambert()` has two trainable weights.
    """

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
            raise ValueError(self.missing_tangent())
        return Cosines.of(normal, light, view, tangent=tangent, normalize=normalize)

    def components(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> dict[str, Tensor]:
        """The named parts (..., channel) [1/sr] whose sum is `forward`."""
        cosines = self.cosines(normal, light, view, tangent=tangent, normalize=normalize)
        parts = self.evaluate_components(cosines)
        return {name: cosines.zero_below_horizon(part) for name, part in parts.items()}

    def evaluate(self, cosines: Cosines) -> Tensor:
        """f_r (..., channel) [1/sr] from cosines computed once (see `Cosines.of`)."""
        return cosines.zero_below_horizon(_sum(self.evaluate_components(cosines).values()))

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

    def __mul__(self, weight: Tensor | float) -> "WeightedSum":
        return WeightedSum([self], [weight])

    __rmul__ = __mul__

    def __add__(self, other: "BRDF") -> "WeightedSum":
        return WeightedSum([self], [1.0]) + other

    def __radd__(self, other: object) -> "BRDF":
        # sum([a, b]) starts from 0
        return self if other == 0 else NotImplemented


class LinearBRDF(BRDF):
    """A model that is linear in images of the geometry: f_r = sum_k coefficients_k(material) term_k(geometry).

    The terms know nothing of the material and the coefficients nothing of the geometry, so a new
    material on known geometry costs K multiply-adds, and a fit needs the terms once.
    """

    @abstractmethod
    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """K functions of the geometry, each (...); finite, but arbitrary below the horizon."""

    @abstractmethod
    def component_coefficients(self) -> dict[str, Tensor]:
        """What each named part takes of each term: (..., channel, K) [1/sr]."""

    def basis(self, cosines: Cosines) -> Tensor:
        """The terms as one tensor (..., K), zero below the horizon."""
        return cosines.zero_below_horizon(torch.stack(torch.broadcast_tensors(*self.terms(cosines)), -1))

    def coefficients(self) -> Tensor:
        """(..., channel, K) [1/sr], such that f_r = (basis[..., None, :] * coefficients).sum(-1)."""
        return _sum(self.component_coefficients().values())

    def evaluate(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(_contract(self.coefficients(), self.terms(cosines)))

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        terms = self.terms(cosines)
        return {name: _contract(c, terms) for name, c in self.component_coefficients().items()}


class ImageBRDF(LinearBRDF):
    """A `LinearBRDF` of many terms, made and contracted as one tensor, some pixels at a time.

    A model states what its images read of the directions and what they are. Working memory without
    derivatives is that of `PIXELS_AT_A_TIME` pixels, plus K numbers a pixel where `basis` is asked for.
    """

    @abstractmethod
    def coordinates(self, cosines: Cosines) -> tuple[Tensor, ...]:
        """What the images read of the directions, each (...)."""

    @abstractmethod
    def images(self, *coordinates: Tensor) -> Tensor:
        """The terms (..., K) at coordinates (...); finite, but arbitrary below the horizon."""

    def terms(self, cosines: Cosines) -> tuple[Tensor, ...]:
        return _in_pieces(self.images, self.coordinates(cosines)).unbind(-1)

    def basis(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(_in_pieces(self.images, self.coordinates(cosines)))

    def evaluate(self, cosines: Cosines) -> Tensor:
        return cosines.zero_below_horizon(self._seen_by(self.coefficients(), cosines))

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        coefficients = self.component_coefficients()
        together = torch.cat(list(coefficients.values()), -2)
        channels = [c.shape[-2] for c in coefficients.values()]
        parts = self._seen_by(together, cosines).split(channels, -1)
        return dict(zip(coefficients, parts, strict=True))

    def _seen_by(self, coefficients: Tensor, cosines: Cosines) -> Tensor:
        """Images times coefficients (..., channel, K), without keeping the images."""
        coordinates = self.coordinates(cosines)
        dtype = torch.promote_types(coefficients.dtype, cosines.light.dtype)
        coefficients = coefficients.to(dtype)
        if coefficients.ndim == 2:
            return _in_pieces(lambda *c: self.images(*c).to(dtype) @ coefficients.mT, coordinates)
        shape = torch.broadcast_shapes(coordinates[0].shape, coefficients.shape[:-2])
        rows = coefficients.expand(*shape, *coefficients.shape[-2:])
        wide = tuple(c.expand(shape) for c in coordinates)
        return _in_pieces(
            lambda row, *c: torch.einsum("...k,...ck->...c", self.images(*c).to(dtype), row), (rows, *wide)
        )


class WeightedSum(BRDF):
    """Sum of BRDFs with trainable positive weights (part,). Components are named `Model.part`.

    A weight and the albedo of its part say the same thing: hold one of them `fixed` before fitting. The
    weights of a sum made by + and * are trainable; `WeightedSum(parts, fixed([...]))` or `sum.weights = fixed(...)`
    holds them.
    Whether the sum reflects more than it receives is the weights' business: nothing bounds their sum.
    Raises ValueError for a weight that is not positive and finite, or counts that differ; TypeError
    for parts that are not BRDFs.
    """

    weights: Constrained = Constrained(WEIGHT)

    def __init__(self, parts: Sequence[BRDF], weights: Sequence[Tensor | float] | Tensor | fixed):
        super().__init__()
        held = isinstance(weights, fixed)
        if isinstance(weights, fixed):
            weights = torch.as_tensor(weights.value)
        if not parts or len(parts) != len(weights):
            raise ValueError(
                f"WeightedSum needs one weight for each of at least one part; found {len(parts)} parts "
                f"and {len(weights)} weights."
            )
        for part in parts:
            if not isinstance(part, BRDF):
                raise TypeError(f"WeightedSum adds BRDFs; found {type(part).__name__}.")
        self.parts = nn.ModuleList(parts)
        values = [torch.as_tensor(w, dtype=_dtype_of(parts)).detach() for w in weights]
        self.weights = fixed(torch.stack(values)) if held else torch.stack(values)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        found: dict[str, Tensor] = {}
        for position, (part, weight) in enumerate(zip(self.parts, self.weights, strict=True)):
            for name, value in part.evaluate_components(cosines).items():  # pyright: ignore[reportCallIssue]
                label = f"{type(part).__name__}.{name}"
                found[f"{label}#{position}" if label in found else label] = weight * value
        return found

    @property
    def anisotropic(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return any(part.anisotropic for part in self._brdfs())

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        return _sum(
            [w * p.directional_albedo(cos_view, nodes=nodes) for p, w in zip(self._brdfs(), self.weights, strict=True)]
        )

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        return propose_from_parts(self._brdfs(), self._shares(), view, u)

    def density(self, cosines: Cosines) -> Tensor:
        return _sum([p * part.density(cosines) for part, p in zip(self._brdfs(), self._shares(), strict=True)])

    def delta_reflectance(self, cosines: Cosines) -> Tensor | None:
        found = [(w, part.delta_reflectance(cosines)) for part, w in zip(self._brdfs(), self.weights, strict=True)]
        mirrors = [w * r for w, r in found if r is not None]
        return _sum(mirrors) if mirrors else None

    def delta_probability(self, cosines: Cosines) -> Tensor:
        return _sum(
            [p * part.delta_probability(cosines) for part, p in zip(self._brdfs(), self._shares(), strict=True)]
        )

    def _brdfs(self) -> list[BRDF]:
        return list(self.parts)  # pyright: ignore[reportReturnType]

    def _shares(self) -> Tensor:
        return (self.weights / self.weights.sum()).detach()

    def __mul__(self, weight: Tensor | float) -> "WeightedSum":
        return WeightedSum(list(self.parts), self.weights.detach() * weight)  # pyright: ignore[reportArgumentType]

    __rmul__ = __mul__

    def __add__(self, other: BRDF) -> "WeightedSum":
        parts, weights = [*self.parts], [*self.weights.detach()]
        if isinstance(other, WeightedSum):
            return WeightedSum([*parts, *other.parts], [*weights, *other.weights.detach()])  # pyright: ignore
        return WeightedSum([*parts, other], [*weights, 1.0])  # pyright: ignore[reportArgumentType]


def _contract(coefficients: Tensor, terms: tuple[Tensor, ...]) -> Tensor:
    """sum_k coefficients[..., k] * terms[k] (..., channel), without stacking the terms."""
    return _sum([c * t[..., None] for c, t in zip(coefficients.unbind(-1), terms, strict=True)])


def _in_pieces(compute: Callable[..., Tensor], inputs: tuple[Tensor, ...]) -> Tensor:
    """compute(*inputs) over many pixels, some at a time; the last input's shape (...) leads in all of them."""
    shape = inputs[-1].shape
    if torch.compiler.is_compiling() or shape.numel() <= PIXELS_AT_A_TIME:
        return compute(*inputs)
    pieces = zip(*(t.flatten(0, len(shape) - 1).split(PIXELS_AT_A_TIME) for t in inputs), strict=True)
    return torch.cat([compute(*piece) for piece in pieces]).unflatten(0, shape)


def _sum(values) -> Tensor:
    total, *rest = values
    for value in rest:
        total = total + value
    return total


def _dtype_of(parts: Sequence[BRDF]) -> torch.dtype:
    stored = [t for part in parts for t in (*part.parameters(), *part.buffers())]
    return stored[0].dtype if stored else torch.get_default_dtype()
