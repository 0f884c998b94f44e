"""Directions at a surface point, reduced to the three cosines every isotropic model reads."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeVar

import torch
from torch import Tensor

from torchbrdf._numerics import (
    FEW,
    SUPPORTED_DTYPES,
    Components,
    angle_over_sine,
    components,
    cross,
    cross_of,
    dot,
    dot_of,
    holds,
    horizon,
    in_pieces,
    number,
    positive,
    root,
    safe_sqrt,
    sine,
    unit_tolerance,
)
from torchbrdf.checks import taken_on_trust


class TangentPlane(NamedTuple):
    """Components of light and view along the tangent t and the bitangent b = normal x t, each (...). [-]"""

    light_tangent: Tensor
    light_bitangent: Tensor
    view_tangent: Tensor
    view_bitangent: Tensor


class _computed_once:  # noqa: N801 - used as a decorator
    """`functools.cached_property` without the lock that torch.compile cannot enter.

    A value without the derivatives that a later reader may ask for is not kept.
    """

    def __init__(self, compute: "Callable[[Cosines], Any]"):
        self.compute = compute
        self.name = compute.__name__

    def __get__(self, instance: "Cosines", owner: type) -> Any:
        value = self.compute(instance)
        kept_without = torch.compiler.is_compiling() or not torch.is_inference_mode_enabled()
        if torch.is_grad_enabled() or (kept_without and not instance.differentiated):
            instance.__dict__[self.name] = value  # found before this descriptor from now on
        return value


@dataclass(frozen=True)
class Cosines:
    """The dot products of normal, light and view, and what models derive from them without angles.

    alpha is the larger and beta the smaller of the polar angles of light and view, dphi the azimuth
    between them. Below the horizon the cosines are replaced by those of normal incidence, so that
    every formula stays finite there and its masked gradient is exactly zero; `zero_below_horizon`
    puts the zeros in. The horizon itself is a cosine at or below one rounding error (2.2e-16 in
    float64, 1.2e-7 in float32).

    Attributes:
        light: normal . light (...). [-]
        view: normal . view (...). [-]
        phase: light . view (...). [-]
        above_horizon: where both light and view are above the horizon (...).
        vectors: normal, light and view (..., 3) themselves, if known: for what is computed on demand.
        tangent: of the surface (..., 3), if given; not orthonormalised yet.
    """

    light: Tensor
    view: Tensor
    phase: Tensor
    above_horizon: Tensor
    vectors: tuple[Tensor, Tensor, Tensor] | None = None
    tangent: Tensor | None = None

    @classmethod
    def of(
        cls, normal: Tensor, light: Tensor, view: Tensor, *, tangent: Tensor | None = None, normalize: bool = False
    ) -> "Cosines":
        """Cosines of directions (..., 3) that leave the surface; leading shapes broadcast.

        Args:
            normal, light, view: unit vectors (..., 3), float32 or float64, all of one dtype.
            tangent: vectors (..., 3) in no direction parallel to the normal, for anisotropic models: of each,
                the part along the surface counts, scaled to unit length. Isotropic models ignore it.
            normalize: scale the vectors to unit length instead of refusing others.
        Raises:
            TypeError: a dtype other than float32 and float64 (half types lose their digits at grazing
                angles), or dtypes that differ.
            ValueError: a trailing dimension other than 3, shapes that do not broadcast, entries that
                are not finite, or vectors that are not of unit length.
        """
        if not taken_on_trust():
            given = {"normal": normal, "light": light, "view": view}
            _check_shapes(given if tangent is None else given | {"tangent": tangent})
        if normalize:
            normal, light, view = _normalized("normal", normal), _normalized("light", light), _normalized("view", view)
        extremes: list[Tensor] | None = None if normalize or taken_on_trust() else []
        products = in_pieces(partial(_products, extremes=extremes), normal, light, view, own=1)
        if extremes and not holds((torch.stack(extremes) - 1).abs() <= unit_tolerance(normal.dtype)):
            _refuse_other_than_unit(normal=normal, light=light, view=view)  # NaN too: extremes pass it on
        result = cls.from_products(*products)
        # of a frozen instance that nobody has seen yet; `replace` would make another
        result.__dict__.update(vectors=(normal, light, view), tangent=tangent)
        return result

    @classmethod
    def of_components(cls, normal: Components, light: Components, view: Components) -> "Cosines":
        """What `of` makes of vectors, from their components x, y and z, each (...) in memory of its own.

        Where the components of an image lie side by side, each in its own array, processors read whole vectors of
        pixels at once; of (..., 3) only every third number belongs to one component. `vectors` are put together from
        them: in a compiled graph that costs nothing where no model reads them.

        Args:
            normal, light, view: three tensors (...) each, of unit vectors, float32 or float64, all of one dtype.
        Raises: what `of` raises, and ValueError for other than three components.

        >>> x, y = torch.tensor([0.0, 0.6]), torch.zeros(2)
        >>> z = torch.tensor([1.0, 0.8])
        >>> Cosines.of_components((y, y, 1 + y), (x, y, z), (y, y, 1 + y)).light
        tensor([1.0000, 0.8000])
        """
        given = {"normal": normal, "light": light, "view": view}
        for name, parts in given.items():
            if len(parts) != 3:
                raise ValueError(f"{name} must have three components x, y, z, each (...); found {len(parts)}.")
        vectors = {name: _put_together(name, parts) for name, parts in given.items()}
        if not taken_on_trust():
            _check_shapes(vectors)
            squares = [dot_of(v, v).detach() for v in given.values()]
            extremes = [limit for squared in squares if squared.numel() for limit in torch.aminmax(squared)]
            if extremes and not holds((torch.stack(extremes) - 1).abs() <= unit_tolerance(extremes[0].dtype)):
                _refuse_other_than_unit(**vectors)
        result = cls.from_products(dot_of(normal, light), dot_of(normal, view), dot_of(light, view))
        result.__dict__.update(vectors=tuple(vectors.values()))
        return result

    @classmethod
    def from_products(cls, light: Tensor, view: Tensor, phase: Tensor) -> "Cosines":
        """From the three dot products themselves (...), unchecked."""
        if not light.shape == view.shape == phase.shape:
            light, view, phase = torch.broadcast_tensors(light, view, phase)
        above = torch.minimum(light, view) > number(horizon(light.dtype), light)
        # multiplied and added, which takes a fifth of the time of a masked fill
        lit = above.to(light.dtype)
        below = number(1.0, lit) - lit
        light, view, phase = (torch.addcmul(below, product, lit) for product in (light, view, phase))
        result = cls(light, view, phase, above)
        result.__dict__["lit"] = lit
        return result

    @property
    def differentiated(self) -> bool:
        """Whether a derivative by any of the directions may be asked for: one that is held has none."""
        given = (self.light, self.view, self.phase, *(self.vectors or ()))
        return any(t.requires_grad for t in (given if self.tangent is None else (*given, self.tangent)))

    @_computed_once
    def lit(self) -> Tensor:
        """1 where light and view are above the horizon, else 0 (...)."""
        return self.above_horizon.to(self.light.dtype)

    def in_pieces(self, compute: "Callable[[Cosines], tuple[Tensor, ...]]") -> tuple[Tensor, ...]:
        """compute(self), functions of light, view and phase pixel by pixel: of an image some pixels at a time."""
        if torch.compiler.is_compiling() or self.light.numel() <= FEW:
            return compute(self)
        products = (self.light, self.view, self.phase, self.above_horizon)
        return in_pieces(lambda *piece: compute(Cosines(*piece)), *products)

    def zero_below_horizon(self, brdf: Tensor) -> Tensor:
        """brdf (..., channel), finite, where light and view are above the horizon, else 0 with zero gradient."""
        return brdf * self.lit.unsqueeze(-1)

    @_computed_once
    def half_phase(self) -> tuple[Tensor, Tensor]:
        """Sine and cosine of half the angle g between light and view, each (...); zero subgradient where 0. [-]

        |light - view|/2 and |light + view|/2 where the vectors are known: all digits, also of a small angle. The dot
        product alone has lost half of them.
        """
        if self.vectors is None:
            return safe_sqrt((1 - self.phase) / 2), safe_sqrt((1 + self.phase) / 2)
        away, toward = in_pieces(_half_lengths, *self.vectors[1:], own=1)
        return away * self.lit, torch.addcmul(number(1.0, self.lit) - self.lit, toward, self.lit)

    @_computed_once
    def azimuth_sine(self) -> Tensor:
        """sin(alpha) sin(beta) |sin(dphi)| (...): |normal . (light x view)|; zero subgradient where it is 0.

        From the vectors where they are known, else as the root of a determinant that loses half the
        digits where it is small.
        """
        if self.vectors is not None:
            n, s, v = self.vectors
            volume = dot(n, cross(s, v)).masked_fill(~self.above_horizon, 0.0)
            return volume.abs()
        squares = self.light * self.light + self.view * self.view + self.phase * self.phase
        return safe_sqrt(1 - squares + 2 * self.light * self.view * self.phase)

    @_computed_once
    def tangent_plane(self) -> TangentPlane:
        """Components of light and view along tangent and bitangent; 0 below the horizon.

        Raises ValueError where no tangent was given, or where it is parallel to the normal.
        """
        if self.vectors is None or self.tangent is None:
            raise ValueError(
                "an anisotropic model needs a tangent: pass tangent=(..., 3), a direction along the surface, "
                "to the model or to Cosines.of."
            )
        least: list[Tensor] | None = None if taken_on_trust() else []
        parts = in_pieces(partial(_in_tangent_plane, least=least), *self.vectors, self.tangent, own=1)
        if least and not holds(torch.stack(least) > unit_tolerance(self.light.dtype) ** 2):
            orthonormal_tangent(self.vectors[0], self.tangent)  # says what is wrong
        return TangentPlane(*(part * self.lit for part in parts))

    @_computed_once
    def alpha(self) -> Tensor:
        """Cosine of the larger polar angle (...)."""
        return torch.minimum(self.light, self.view)

    @_computed_once
    def beta(self) -> Tensor:
        """Cosine of the smaller polar angle (...)."""
        return torch.maximum(self.light, self.view)

    def _of_both(self, function: Callable[[Tensor], Tensor]) -> tuple[Tensor, Tensor]:
        """A function of a cosine at alpha and beta: in one go where calls cost more than numbers."""
        if torch.compiler.is_compiling() or self.light.numel() > FEW:
            return function(self.alpha), function(self.beta)
        of_alpha, of_beta = function(self._both).unbind(0)
        return of_alpha, of_beta

    @_computed_once
    def _both(self) -> Tensor:
        """Cosines of alpha and beta (2, ...)."""
        return torch.stack((self.alpha, self.beta))

    @_computed_once
    def sines(self) -> tuple[Tensor, Tensor]:
        """Sines of alpha and beta, each (...); zero gradient at normal incidence."""
        return self._of_both(sine)

    @property
    def sin_alpha(self) -> Tensor:
        """Sine of the larger polar angle (...); zero gradient at normal incidence."""
        return self.sines[0]

    @property
    def sin_beta(self) -> Tensor:
        """Sine of the smaller polar angle (...); zero gradient at normal incidence."""
        return self.sines[1]

    @_computed_once
    def tangents_squared(self) -> tuple[Tensor, Tensor]:
        """tan^2 of the polar angles of light and view, each (...)."""
        one = number(1.0, self.light)
        light, view = (((one - c) * (one + c)).relu() / (c * c) for c in (self.light, self.view))
        return light, view

    @_computed_once
    def in_plane(self) -> Tensor:
        """sin(alpha) sin(beta) cos(dphi) (...), smooth everywhere."""
        return self.phase - self.light * self.view

    @_computed_once
    def sine_product(self) -> Tensor:
        """sin(alpha) sin(beta) (...)."""
        return self.sin_alpha * self.sin_beta

    @_computed_once
    def across_plane(self) -> Tensor:
        """sin(alpha) sin(beta) (1 - |cos(dphi)|) (...); zero subgradient at dphi = 90 degrees."""
        # Rounding can leave the difference a hair below the zero that bounds it.
        return (self.sine_product - self.in_plane.abs()).relu()

    @_computed_once
    def sine_ratio(self) -> Tensor:
        """sin(beta)/sin(alpha) (...), in [0, 1]; 0 where both are 0."""
        return self.sin_beta / positive(self.sin_alpha)

    @_computed_once
    def angles_over_sines(self) -> tuple[Tensor, Tensor]:
        """alpha/sin(alpha) and beta/sin(beta), each (...), by a polynomial in the cosine."""
        return self._of_both(angle_over_sine)

    @property
    def alpha_over_sine(self) -> Tensor:
        """alpha/sin(alpha) (...)."""
        return self.angles_over_sines[0]

    @property
    def beta_over_sine(self) -> Tensor:
        """beta/sin(beta) (...)."""
        return self.angles_over_sines[1]


def _half_lengths(light: Tensor, view: Tensor) -> tuple[Tensor, Tensor]:
    """|light - view|/2 and |light + view|/2 (...)."""
    s, v = components(light), components(view)
    difference = s[0] - v[0], s[1] - v[1], s[2] - v[2]
    total = s[0] + v[0], s[1] + v[1], s[2] + v[2]
    return root(dot_of(difference, difference)) / 2, root(dot_of(total, total)) / 2


def _in_tangent_plane(
    normal: Tensor, light: Tensor, view: Tensor, tangent: Tensor, *, least: list[Tensor] | None
) -> tuple[Tensor, ...]:
    """The parts of a `TangentPlane`; appends the least squared sine between normal and tangent."""
    n, s, v, t = components(normal), components(light), components(view), components(tangent)
    # keeps the squares from overflowing; cancels in the result
    largest = torch.maximum(torch.maximum(t[0].abs(), t[1].abs()), t[2].abs()).detach()
    t = t[0] / largest, t[1] / largest, t[2] / largest
    bitangent = cross_of(n, t)
    squared = dot_of(bitangent, bitangent)
    if least is not None and squared.numel():
        with torch.no_grad():
            least.append((squared / dot_of(t, t)).amin())
    across = squared.rsqrt()
    tangent_along = cross_of(bitangent, n)
    # n x s is s turned by 90 degrees about the normal: exactly 0 where both are one
    turned = [cross_of(n, direction) for direction in (s, v)]
    return tuple(part * across for u in turned for part in (dot_of(bitangent, u), -dot_of(tangent_along, u)))


def orthonormal_tangent(normal: Tensor, tangent: Tensor) -> Tensor:
    """Unit vector (..., 3) along the part of `tangent` that is perpendicular to the unit normal.

    Raises: ValueError where the tangent is (within rounding) parallel to the normal, 0 or not finite.
    """
    bitangent = cross(normal, _normalized("tangent", tangent))
    squared = dot(bitangent, bitangent)
    parallel = squared <= unit_tolerance(squared.dtype) ** 2
    if not (taken_on_trust() or holds(~parallel)):
        raise ValueError(
            f"tangent must not be parallel to the normal; {int(parallel.sum())} of {parallel.numel()} are. "
            "Choose a direction along the surface."
        )
    return cross(bitangent / squared.sqrt()[..., None], normal)


def any_tangent(normal: Tensor) -> Tensor:
    """A unit vector (..., 3) perpendicular to the unit normal, smooth except where normal_z changes sign.

    Source: Duff, Burgess, Christensen, Hery, Kensler, Liani & Villemin 2017, "Building an orthonormal basis,
        revisited", Journal of Computer Graphics Techniques 6(1).
    """
    x, y, z = normal.unbind(-1)
    sign = torch.where(z < 0, -torch.ones_like(z), torch.ones_like(z))
    a = -1 / (sign + z)
    return torch.stack((1 + sign * x * x * a, sign * x * y * a, -sign * x), -1)


def _check_shapes(vectors: dict[str, Tensor]) -> None:
    for name, v in vectors.items():
        if not isinstance(v, Tensor):
            raise TypeError(f"{name} must be a torch.Tensor of shape (..., 3); found {type(v).__name__}.")
        if v.dtype not in SUPPORTED_DTYPES:
            raise TypeError(f"{name} must be float32 or float64; found {v.dtype}. Convert with .float() or .double().")
        if v.ndim == 0 or v.shape[-1] != 3:
            raise ValueError(f"{name} must have shape (..., 3); found {tuple(v.shape)}.")
    if len({v.dtype for v in vectors.values()}) > 1:
        dtypes = ", ".join(f"{name} {v.dtype}" for name, v in vectors.items())
        raise TypeError(f"{_listed(vectors)} must share one dtype; found {dtypes}.")
    shapes = [v.shape for v in vectors.values()]
    try:
        torch.broadcast_shapes(*shapes)
    except RuntimeError:
        given = ", ".join(f"{name} {tuple(v.shape)}" for name, v in vectors.items())
        raise ValueError(f"{_listed(vectors)} must broadcast; found {given}.") from None


def _put_together(name: str, parts: Components) -> Tensor:
    if not all(isinstance(part, Tensor) for part in parts):
        raise TypeError(
            f"{name} must be three tensors x, y, z; found {', '.join(type(part).__name__ for part in parts)}."
        )
    try:
        return torch.stack(torch.broadcast_tensors(*parts), -1)
    except RuntimeError:
        shapes = ", ".join(str(tuple(part.shape)) for part in parts)
        raise ValueError(f"{name} must be three tensors that broadcast; found {shapes}.") from None


def _listed(vectors: dict[str, Tensor]) -> str:
    *names, last = vectors
    return f"{', '.join(names)} and {last}"


def _products(normal: Tensor, light: Tensor, view: Tensor, *, extremes: list[Tensor] | None) -> tuple[Tensor, ...]:
    """The three dot products (...); appends the smallest and the largest squared length of each of the vectors."""
    # sums over an axis of three: as fast as they are slow for many, and never fused when compiled
    if torch.compiler.is_compiling() or light.numel() > FEW:
        return _dots(dot_of, components(normal), components(light), components(view), extremes)
    return _dots(_sum_of_products, normal, light, view, extremes)


_Vector = TypeVar("_Vector", Tensor, Components)


def _dots(
    product: Callable[[_Vector, _Vector], Tensor], n: _Vector, s: _Vector, v: _Vector, extremes: list[Tensor] | None
) -> tuple[Tensor, ...]:
    if extremes is not None:
        with torch.no_grad():
            squares = [product(c, c) for c in (n, s, v)]
            extremes += [limit for squared in squares if squared.numel() for limit in torch.aminmax(squared)]
    return product(n, s), product(n, v), product(s, v)


def _sum_of_products(a: Tensor, b: Tensor) -> Tensor:
    return (a * b).sum(-1)


def _refuse_other_than_unit(**vectors: Tensor) -> None:
    """Raise ValueError for the first of the vectors (..., 3) that are not all of unit length: a second, slower look."""
    for name, vector in vectors.items():
        squared = dot(vector, vector).detach()
        off = ~((squared - 1).abs() <= unit_tolerance(squared.dtype))
        if not off.any():
            continue
        lengths = squared[off].sqrt()
        broken = int((~lengths.isfinite()).sum())
        what = f"{broken} are not finite" if broken else f"lengths {lengths.min():.6g} to {lengths.max():.6g}"
        raise ValueError(
            f"{name} must hold finite unit vectors; {int(off.sum())} of {off.numel()} do not ({what}). "
            "Pass normalize=True to scale finite vectors to unit length."
        )


def _normalized(name: str, v: Tensor) -> Tensor:
    largest = v.abs().amax(-1, keepdim=True).detach()  # keeps the squares from overflowing; cancels in the result
    usable = largest.isfinite() & (largest > 0)
    if not (taken_on_trust() or holds(usable)):
        bad = int((~usable).sum())
        raise ValueError(f"{name} must hold finite vectors of non-zero length; {bad} of {usable.numel()} do not.")
    scaled = v / largest
    return scaled / dot(scaled, scaled).sqrt()[..., None]
