"""What every BRDF is: a module from (normal, light, view) to reflectance, the sum of named parts."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence

import torch
from numpy.polynomial.legendre import leggauss
from torch import Tensor, nn

from torchbrdf._numerics import safe_divide, safe_sqrt
from torchbrdf.directions import Cosines, any_tangent, cross, orthonormal_tangent
from torchbrdf.parameters import WEIGHT, Constrained, Parametric
from torchbrdf.sampling import Sample, choose, cosine_hemisphere, uniform_hemisphere


class BRDF(Parametric, ABC):
    """Bidirectional reflectance distribution function f_r [1/sr], cosine not included.

    Subclasses implement `evaluate_components`, and `propose` with `density` where drawing from the cosine
    (and a `uniform_share` of the hemisphere, which bounds the weights at grazing views) is not good enough.
    Sums and multiples are BRDFs again: `0.7 * OrenNayar() + 0.3 * Lambert()` has two trainable weights.
    """

    anisotropic: bool = False
    uniform_share: float = 0.0

    def forward(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> Tensor:
        """f_r (..., channel) [1/sr] for unit vectors (..., 3) that leave the surface.

        Zero, with zero gradient, unless light and view are both above the horizon. Raises what
        `Cosines.of` raises; `normalize=True` scales the vectors to unit length first. Anisotropic models
        need the `tangent` (..., 3) along which the surface is aligned.
        """
        return self.evaluate(self.cosines(normal, light, view, tangent=tangent, normalize=normalize))

    def cosines(
        self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> Cosines:
        """What the model reads of the directions; raises ValueError where it misses a tangent."""
        if self.anisotropic and tangent is None:
            raise ValueError(f"{type(self).__name__} is anisotropic and needs a tangent: pass tangent=... (..., 3).")
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
        x, w = leggauss(nodes)
        # the nodes come first, so that per-texel parameters line up with cos_view
        column = (nodes, 1, *(1,) * cos_view.ndim)
        cos_light = cos_view.new_tensor((1 + x) / 2).reshape(column)
        dphi = cos_view.new_tensor((1 + x) / 2 * math.pi).reshape(column).transpose(0, 1)
        w_light, w_dphi = (cos_view.new_tensor(w).reshape(shape) for shape in (cos_light.shape, dphi.shape))
        # d(cos_light) d(dphi) over half the circle of azimuths, which the other half mirrors
        weight = cos_light * (w_light / 2) * (w_dphi / 2 * math.pi) * 2
        sin_view, sin_light = (safe_sqrt((1 - c) * (1 + c)) for c in (cos_view, cos_light))
        along = sin_light * dphi.cos()
        # the view lies in the plane of the tangent
        planar = (along, sin_light * dphi.sin(), sin_view, torch.zeros_like(sin_view)) if self.anisotropic else None
        cosines = Cosines.from_products(cos_light, cos_view, cos_light * cos_view + sin_view * along, in_plane=planar)
        return (self.evaluate(cosines) * weight[..., None]).sum((0, 1))

    def sample(self, normal: Tensor, view: Tensor, u: Tensor, *, tangent: Tensor | None = None) -> Sample:
        """Light directions drawn for unit normals and views (..., 3) from u (..., 2) uniform in [0, 1).

        The weight f_r cos/pdf is an unbiased estimate of the directional albedo; see `Sample`. Raises what
        `Cosines.of` raises.
        """
        with torch.no_grad():
            t = self._frame(normal, view, tangent)
            axes = torch.stack((t, cross(normal, t), normal.expand_as(t)), -1)
            local = (axes * view[..., :, None]).sum(-2)
            proposed, delta = self.propose(local, u)
            light = (axes * proposed[..., None, :]).sum(-1)
            light = light / light.norm(dim=-1, keepdim=True)
        cosines = Cosines.of(normal, light, view, tangent=t)
        with torch.no_grad():
            pdf = self.density(cosines).masked_fill(~cosines.above_horizon, 0.0)
        factor = safe_divide(cosines.light, pdf, where=pdf > 0).detach()
        weight = self.evaluate(cosines) * factor[..., None]
        mirror = self.delta_reflectance(cosines)
        if mirror is not None:
            delta = delta & cosines.above_horizon
            probability = self.delta_probability(cosines)
            mirror = safe_divide(mirror, probability[..., None], where=(probability > 0)[..., None])
            weight = torch.where(delta[..., None], mirror, weight)
            pdf = pdf.masked_fill(delta, math.inf)
        return Sample(light, pdf, weight)

    def pdf(self, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None) -> Tensor:
        """Density [1/sr] (...) with which `sample` draws the light; 0 below the horizon, delta lobes left out."""
        with torch.no_grad():
            cosines = Cosines.of(normal, light, view, tangent=self._frame(normal, view, tangent))
            return self.density(cosines).masked_fill(~cosines.above_horizon, 0.0)

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        """Light (..., 3) for a view (..., 3), both in the frame (tangent, bitangent, normal), and whether it is
        a mirror direction (...). Called without gradients."""
        uniform, u1 = choose(u[..., 0], torch.full_like(u[..., 0], self.uniform_share))
        u = torch.stack((u1, u[..., 1]), -1)
        light = torch.where(uniform[..., None], uniform_hemisphere(u), cosine_hemisphere(u))
        light = light.expand(torch.broadcast_shapes(light.shape, view.shape))
        return light, torch.zeros_like(light[..., 0], dtype=torch.bool)

    def density(self, cosines: Cosines) -> Tensor:
        """Density [1/sr] (...) of `propose`, delta lobes left out; the cosines carry a tangent."""
        return (self.uniform_share / 2 + (1 - self.uniform_share) * cosines.light) / math.pi

    def delta_reflectance(self, cosines: Cosines) -> Tensor | None:
        """Reflectance (..., channel) of the mirror lobe, which `forward` cannot show; None without one. [-]"""
        return None

    def delta_probability(self, cosines: Cosines) -> Tensor:
        """Probability (...) with which `propose` returns the mirror direction."""
        return torch.zeros_like(cosines.view)

    def _frame(self, normal: Tensor, view: Tensor, tangent: Tensor | None) -> Tensor:
        if tangent is not None:
            t = orthonormal_tangent(normal, tangent)
        elif self.anisotropic:
            raise ValueError(f"{type(self).__name__} is anisotropic and needs a tangent: pass tangent=... (..., 3).")
        else:
            t = any_tangent(normal)
        return t.expand(torch.broadcast_shapes(t.shape, view.shape))

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


class WeightedSum(BRDF):
    """Sum of BRDFs with trainable positive weights (part,). Components are named `Model.part`.

    Whether the sum reflects more than it receives is the weights' business: nothing bounds their sum.
    Raises ValueError for a weight that is not positive and finite, or counts that differ; TypeError
    for parts that are not BRDFs.
    """

    weights: Constrained = Constrained(WEIGHT)

    def __init__(self, parts: Sequence[BRDF], weights: Sequence[Tensor | float] | Tensor):
        super().__init__()
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
        self.weights = torch.stack(values)

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
        """Draws from one part, chosen in proportion to the weights."""
        parts, shares = self._brdfs(), self._shares()
        u1, start = u[..., 0], torch.zeros_like(shares[0])
        light, delta = torch.zeros_like(view), torch.zeros_like(view[..., 0], dtype=torch.bool)
        for part, share in zip(parts, shares, strict=True):
            # the part whose share of [0, 1) holds u1 draws from where in it u1 lies
            within = ((u1 - start) / share).clamp(0.0, 1 - torch.finfo(u.dtype).eps)
            here, is_delta = part.propose(view, torch.stack((within, u[..., 1]), -1))
            inside = (u1 >= start).expand(is_delta.shape)
            light, delta = torch.where(inside[..., None], here, light), torch.where(inside, is_delta, delta)
            start = start + share
        return light, delta

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
        return WeightedSum(list(self.parts), self.weights * weight)  # pyright: ignore[reportArgumentType]

    __rmul__ = __mul__

    def __add__(self, other: BRDF) -> "WeightedSum":
        parts, weights = [*self.parts], [*self.weights]
        if isinstance(other, WeightedSum):
            return WeightedSum([*parts, *other.parts], [*weights, *other.weights])  # pyright: ignore
        return WeightedSum([*parts, other], [*weights, 1.0])  # pyright: ignore[reportArgumentType]


def _contract(coefficients: Tensor, terms: tuple[Tensor, ...]) -> Tensor:
    """sum_k coefficients[..., k] * terms[k] (..., channel), without stacking the terms."""
    return _sum([c * t[..., None] for c, t in zip(coefficients.unbind(-1), terms, strict=True)])


def _sum(values) -> Tensor:
    total, *rest = values
    for value in rest:
        total = total + value
    return total


def _dtype_of(parts: Sequence[BRDF]) -> torch.dtype:
    stored = [t for part in parts for t in (*part.parameters(), *part.buffers())]
    return stored[0].dtype if stored else torch.get_default_dtype()
