"""Material parameters: a table in the class body; stored unconstrained, read constrained."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias, overload

import torch
from torch import Tensor, nn

from torchbrdf._numerics import SUPPORTED_DTYPES, holds, number, unit_tolerance
from torchbrdf.checks import checked, taken_on_trust


@dataclass(frozen=True)
class Interval:
    """Domain of a parameter: [low, high], or [low, inf).

    `unit` is "rad", or "" for a pure number. `even` says that reflectance depends on the square of the
    parameter near low = 0, so that its derivative vanishes there: sigma is told from 0 through sigma^2.
    `trailing` axes of the parameter are its own (channel, part); axes before them are pixels.
    `least`, where it is above low, is the smallest value that a formula can compute: no value below it is accepted.

    The closed interval is what a formula accepts. A trained value lives in the open one, through a
    logistic map (an exponential where high is infinite): it approaches a bound until rounding sees no
    difference, and its derivative fades on the way.
    """

    low: float
    high: float
    unit: str = ""
    even: bool = False
    trailing: int = 0
    least: float = -math.inf

    @property
    def angular(self) -> bool:
        """Whether the parameter is an angle: of a material, how steep its facets are."""
        return self.unit == "rad"

    def check(self, name: str, value: Tensor, *, open_ends: bool = False) -> None:
        """Raise ValueError unless every entry lies in the domain (strictly inside if `open_ends`).

        Not inside `torchbrdf.unchecked()`.
        """
        if taken_on_trust():
            return
        if not isinstance(value, Tensor):
            raise TypeError(f"{name} must be a torch.Tensor; found {type(value).__name__}.")
        if value.numel() == 0:
            return

        low = max(self.low, self.least)

        def inside_of(x: Tensor) -> Tensor:
            above = x > low if open_ends and low == self.low else x >= low
            return above & (x < self.high if open_ends else x <= self.high)

        # the extremes stand for all: those of what holds a NaN are NaN, which lies nowhere
        if holds(inside_of(torch.stack(torch.aminmax(value.detach())))):
            return
        inside = inside_of(value)
        finite = value[value.isfinite()]
        extent = f"min {finite.min():.6g}, max {finite.max():.6g}" if finite.numel() else "none is finite"
        opening = "(" if open_ends and low == self.low else "["
        closing = ")" if open_ends or math.isinf(self.high) else "]"
        unit = f" {self.unit}" if self.unit else ""
        remedy = " A trained value cannot sit on a bound: hold it there with fixed(...)." if open_ends else ""
        raise ValueError(
            f"{name} must lie in {opening}{low:.4g}, {self.high:.4g}{closing}{unit}; "
            f"{int((~inside).sum())} of {inside.numel()} entries do not ({extent}).{remedy}"
        )

    def to_raw(self, value: Tensor) -> Tensor:
        """Unconstrained coordinate of a value inside the domain."""
        if self.high == math.inf:
            return (value - self.low).log()
        return torch.logit((value - self.low) / (self.high - self.low))

    def from_raw(self, raw: Tensor) -> Tensor:
        """Value inside the domain for any real number."""
        inside = raw.exp() if self.high == math.inf else raw.sigmoid()
        width = 1.0 if self.high == math.inf else self.high - self.low
        # numbers as tensors: forward differentiation of "number * 0-d float32 tensor" yields float64
        scaled = inside if width == 1 else inside * number(width, raw)
        return scaled if self.low == 0 else scaled + number(self.low, raw)


@dataclass(frozen=True)
class Simplex:
    """Domain of shares: entries >= 0 that sum to 1 along the last axis.

    A trained value has all entries above 0. Its raw form (..., K - 1) is the logarithms of their ratios
    to the last entry, read back by softmax.
    """

    low: ClassVar[float] = 0.0
    high: ClassVar[float] = 1.0
    unit: ClassVar[str] = ""
    even: ClassVar[bool] = False
    trailing: ClassVar[int] = 1
    angular: ClassVar[bool] = False

    def check(self, name: str, value: Tensor, *, open_ends: bool = False) -> None:
        """Raise ValueError unless the entries are shares (all above 0 if `open_ends`).

        Not inside `torchbrdf.unchecked()`.
        """
        if taken_on_trust():
            return
        if value.ndim == 0:
            raise ValueError(f"{name} must hold shares along its last axis; found a single number.")
        total = value.sum(-1)
        sums_to_one = (total - 1).abs() <= unit_tolerance(value.dtype)
        inside = ((value > 0) if open_ends else (value >= 0)).all(-1) & sums_to_one
        if not holds(inside):
            remedy = " A trained share cannot be 0: hold it with fixed(...)." if open_ends else ""
            raise ValueError(
                f"{name} must hold shares {'above' if open_ends else 'of at least'} 0 that sum to 1; "
                f"found min {value.min():.6g}, sums from {total.min():.9g} to {total.max():.9g}.{remedy}"
            )

    def to_raw(self, value: Tensor) -> Tensor:
        """Unconstrained coordinate of a value inside the domain."""
        return (value[..., :-1] / value[..., -1:]).log()

    def from_raw(self, raw: Tensor) -> Tensor:
        """Value inside the domain for any real numbers."""
        return torch.cat((raw, torch.zeros_like(raw[..., :1])), -1).softmax(-1)


ALBEDO = Interval(0.0, 1.0, trailing=1)
ROUGHNESS = Interval(0.0, math.pi / 2, "rad", even=True)
WEIGHT = Interval(0.0, math.inf, trailing=1)
EXPONENT = Interval(0.0, math.inf)
# Below this microfacet width the lobe is narrower than float32 cosines resolve: use Mirror.
NARROWEST = 1e-3
WIDTH = Interval(NARROWEST, 1.0)
FACET_ROUGHNESS = Interval(0.0, math.pi / 2, "rad", even=True, least=NARROWEST)
REFRACTIVE_INDEX = Interval(1.0, math.inf, trailing=1)
ABSORPTION_INDEX = Interval(0.0, math.inf, trailing=1)


@dataclass(frozen=True)
class fixed:  # noqa: N801 - reads as a word in `OrenNayar(sigma=fixed(0.0))`
    """A parameter value that is not trained. It may sit on the bounds of its domain."""

    value: Tensor | float


# What a constructor takes for a parameter: a number or tensor is trained from there on, `fixed(...)` is held.
ParameterValue: TypeAlias = Tensor | float | fixed


class Constrained:
    """A parameter of a module, declared in the class body: `sigma = Constrained(ROUGHNESS)`.

    Assigning a number or tensor stores a trainable `raw_<name>` (or updates it in place); assigning
    `fixed(value)` stores the value as the buffer `fixed_<name>`. Reading gives the constrained value.
    """

    def __init__(self, domain: Interval | Simplex):
        self.domain = domain

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self._raw, self._fixed = f"raw_{name}", f"fixed_{name}"

    @overload
    def __get__(self, module: None, owner: type) -> "Constrained": ...
    @overload
    def __get__(self, module: nn.Module, owner: type) -> Tensor: ...
    def __get__(self, module, owner):
        if module is None:
            return self
        if self._fixed in module._buffers:
            return getattr(module, self._fixed)
        return self.domain.from_raw(getattr(module, self._raw))

    def __set__(self, module: nn.Module, value: ParameterValue) -> None:
        held = isinstance(value, fixed)
        name = f"{type(module).__name__}.{self.name}"
        given = value.value if held else value
        if isinstance(given, Tensor) and given.grad_fn is not None:
            raise ValueError(
                f"{name} is the result of a computation, and a module keeps a parameter of its own: its gradient would "
                "be lost. Pass .detach(), or differentiate through the model's function or torch.func.functional_call."
            )
        tensor = _as_float_tensor(given)
        if tensor.dtype not in SUPPORTED_DTYPES:
            raise TypeError(f"{name} must be float32 or float64; found {tensor.dtype}.")
        with checked():  # the value outlives any context
            self.domain.check(name, tensor, open_ends=not held)
        raw_name, fixed_name = self._raw, self._fixed
        if held:
            module._parameters.pop(raw_name, None)
            module.register_buffer(fixed_name, tensor.clone())
            return
        module._buffers.pop(fixed_name, None)
        raw = self.domain.to_raw(tensor)
        present = module._parameters.get(raw_name)
        if present is not None and present.shape == raw.shape:
            with torch.no_grad():  # in place, so that an optimizer that holds the parameter follows
                present.copy_(raw)
        else:
            module.register_parameter(raw_name, nn.Parameter(raw))


class Parametric(nn.Module):
    """A module whose class body declares constrained parameters."""

    def material(self) -> dict[str, Tensor]:
        """The constrained parameters by name."""
        return {entry.name: getattr(self, entry.name) for entry in declared(self)}

    def __setattr__(self, name: str, value: Any) -> None:
        # nn.Module would register an nn.Parameter under the name before the table sees it.
        entry = getattr(type(self), name, None)
        if isinstance(entry, Constrained):
            entry.__set__(self, value)
        else:
            super().__setattr__(name, value)


def _as_float_tensor(value: Tensor | float) -> Tensor:
    tensor = torch.as_tensor(value).detach()
    return tensor if tensor.is_floating_point() else tensor.to(torch.get_default_dtype())


def declared(module: nn.Module) -> Iterator[Constrained]:
    """The constrained parameters a module's class declares, base classes first."""
    for owner in reversed(type(module).__mro__):
        yield from (entry for entry in vars(owner).values() if isinstance(entry, Constrained))


def trainable(module: nn.Module) -> dict[str, tuple[str, Interval | Simplex]]:
    """Trained parameters of a module and its children: readable path -> (path of the raw one, domain)."""
    trained = {}
    for prefix, child in module.named_modules():
        dot = f"{prefix}." if prefix else ""
        for entry in declared(child):
            raw = child._parameters.get(f"raw_{entry.name}")
            if raw is not None and raw.requires_grad:
                trained[dot + entry.name] = (f"{dot}raw_{entry.name}", entry.domain)
    return trained


def paths(module: nn.Module) -> list[str]:
    """Readable paths ("parts.0.sigma") of the declared parameters of a module and its children, trained or held."""
    return [
        f"{prefix}.{entry.name}" if prefix else entry.name
        for prefix, child in module.named_modules()
        for entry in declared(child)
    ]


def kept(module: Parametric, name: str) -> Tensor | fixed:
    """A parameter's value for another module of the same material: held fixed where the given module holds it."""
    value = getattr(module, name).detach()
    return fixed(value) if f"fixed_{name}" in module._buffers else value


def is_per_texel(module: nn.Module) -> bool:
    """Whether any parameter has one entry for each pixel."""
    return any(
        getattr(child, entry.name).ndim > entry.domain.trailing
        for child in module.modules()
        for entry in declared(child)
    )


def sigma_from_degrees(degrees: Tensor | float) -> Tensor:
    """Roughness sigma [rad] from degrees."""
    return torch.deg2rad(_as_float_tensor(degrees))


def sigma_from_beckmann_alpha(alpha: Tensor | float) -> Tensor:
    """Roughness sigma [rad] of the Gaussian that matches a Beckmann width alpha: alpha/sqrt(2).

    Both describe the slopes of the surface; they agree to first order in alpha (small slopes). The
    tails differ: Beckmann is Gaussian in tan(theta), this library's sigma in theta.
    """
    return _as_float_tensor(alpha) / math.sqrt(2)


def sigma_from_mean_slope(mean_slope: Tensor | float) -> Tensor:
    """Roughness sigma [rad] from the mean slope angle of the facets [rad]: sigma = m sqrt(2/pi).

    The mean of theta under the slope-area distribution exp(-theta^2/2 sigma^2) sin(theta), to first
    order in sigma.
    """
    return _as_float_tensor(mean_slope) * math.sqrt(2 / math.pi)
