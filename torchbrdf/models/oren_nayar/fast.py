"""The exact V-cavity rough surface as a reciprocal fit without angles.

Two bounces, compiled, one trained sigma, a million pixels, float32, one core: 1.8 times (forward) and about 7 times
(forward and backward) the functional approximation.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, final

import torch
from torch import Tensor

from torchbrdf import effects
from torchbrdf.brdf import BRDF, Option
from torchbrdf.directions import Cosines
from torchbrdf.models.oren_nayar.functional import OrenNayar
from torchbrdf.models.oren_nayar.ring import KAPPA, KNEE, Ring, Term, chebyshev, chebyshev_slope, contract, knee, ring
from torchbrdf.models.rungs import Member, stand_ins
from torchbrdf.parameters import ALBEDO, ROUGHNESS, Constrained, ParameterValue, kept
from torchbrdf.sampling import CltcSampled, equivalent_roughness

Bounces = Literal[2, "all"]


class _Fit(NamedTuple):
    """Numbers of `fast_rough_surface.json` (made by `examples/fast_fit`)."""

    terms: dict[str, list[Term]]
    orders: dict[str, list[int]]  # power of x in front of each series
    series: dict[str, list[list[float]]]  # Chebyshev coefficients in 2x - 1
    table: Tensor  # (terms of all parts, 3 * length of a series): the same numbers against [T, x T, x^2 T]
    resonance: tuple[float, float, float]


_PARTS: dict[Bounces, tuple[str, ...]] = {
    2: ("direct", "two_bounce"),
    "all": ("direct", "two_bounce", "resonant", "plain"),
}


def _read(path: Path) -> _Fit:
    numbers = json.loads(path.read_text())
    names = _PARTS["all"]
    terms = {n: [(t["factor"], *t["powers"]) for t in numbers[n]] for n in names}
    orders = {n: [t["order"] for t in numbers[n]] for n in names}
    series = {n: [t["series"] for t in numbers[n]] for n in names}
    rows = []
    for name in names:
        for order, row in zip(orders[name], series[name], strict=True):
            rows.append([*[0.0] * (len(row) * order), *row, *[0.0] * (len(row) * (2 - order))])
    return _Fit(terms, orders, series, torch.tensor(rows, dtype=torch.float64), tuple(numbers["resonance"]))


_FIT = _read(Path(__file__).with_name("fast_rough_surface.json"))


def fast_rough_surface(cosines: Cosines, *, albedo: Tensor, sigma: Tensor, bounces: Bounces) -> Tensor:
    r"""Reflectance of isotropic V-cavities with Gaussian slopes, fitted to the exact integral over slopes and azimuths.

    .. math::
        \pi f_r &= \rho\, d + \rho^2\, i
                   + \rho^3 \Bigl[\frac{g_0}{1 - \rho\lambda} + \frac{g_1}{1 - \rho\lambda/2}\Bigr] \\
        d &= 1 - \frac{\sigma^2}{1 + \sigma^2/\epsilon^2} + \frac{A}{\kappa^2} + p_d, \quad
        i = \frac{\sigma^2}{1 + \sigma^2/\epsilon^2} + p_i

    d and i are what unit albedo returns after one and two bounces, g_0 and g_1 carry all the others, lambda(sigma)
    is an effective share of light that a cavity keeps for itself. p_d, p_i, g_0, g_1 are sums of terms
    (1, D, P or G) A^i S^j Q^k of the ring coordinates (`ring.py`) with coefficients that are series in
    sigma^2/(sigma^2 + epsilon^2).

    Args:
        cosines: of light, view and phase angle, each (...).
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-] in [0, 1]
        sigma: roughness, scalar or (...). [rad] in [0, pi/2]; 0 is Lambert exactly.
        bounces: 2, or "all".
    Returns: f_r (..., channel) [1/sr], zero unless light and view are above the horizon.
    Raises: ValueError when albedo or sigma leave their domains, or for other bounces.
    Deviations: a fit. Up to 85 degrees, sigma up to 60 degrees and rho 0.3 to 0.9, on directions it was not fitted
        to: rms 0.17 % (two bounces) and 0.22 % (all), 0.18 % and 0.25 % where half of them crowd in the plane of
        incidence, at light = view and at grazing; at most 2.8 % and 3.0 % of the total. Worst at sigma = 60 degrees
        and rho = 0.9: rms 0.39 % and 0.64 %. At rho = 1 with all bounces up to 14 % (rms 0.7 %, 1.5 % at 60 degrees),
        and the directional albedo is within 1.7 % of 1. The derivative by sigma errs by 1-4 % rms (two bounces) and
        1-9 % (all; worst at 60 degrees and rho = 0.9; 12-25 % at rho = 1 from 30 degrees on). Beyond 86 degrees:
        bounded f cos, no figures. At light = view, a cone of the exact reflectance, the subgradient is 0. Compiled
        with one trained sigma, first derivatives only: take second ones from the function as it is.
    Source: fitted here to the exact model (`examples/fast_fit`); small-sigma form from the expansion
        of the integral, d ~ 1 - sigma^2 + sigma^2 p.q, i ~ sigma^2 (`docs/equations/oren_nayar.md`, section 6).
    """
    ALBEDO.check("fast_rough_surface: albedo", albedo)
    ROUGHNESS.check("fast_rough_surface: sigma", sigma)
    _check_bounces("fast_rough_surface", bounces)
    parts = _components(cosines, albedo, sigma, bounces)
    total = parts["direct"] + parts["two_bounce"]
    return cosines.zero_below_horizon(total + parts["higher"] if bounces == "all" else total)


def _components(cosines: Cosines, albedo: Tensor, sigma: Tensor, bounces: Bounces) -> dict[str, Tensor]:
    """Named parts (..., channel) [1/sr]; finite below the horizon."""
    rho = torch.atleast_1d(albedo)
    # Spread over the pixels first: the derivative by a single sigma is then one sum over the image.
    spread = sigma.expand(torch.broadcast_shapes(sigma.shape, cosines.light.shape))
    r = ring(cosines, spread)
    lead = KNEE**2 * knee(spread)
    sums = _polynomials(r, sigma, bounces)
    parts = {
        # The bounds act within a degree of the horizon only, where forward reflectance itself tends to 0.
        "direct": rho * ((1 - lead + r.along / KAPPA**2 + sums["direct"]).clamp(min=0) / math.pi)[..., None],
        "two_bounce": rho * rho * ((lead + sums["two_bounce"]).clamp(min=0) / math.pi)[..., None],
    }
    if bounces == "all":
        top, half, ratio = _FIT.resonance
        s4 = spread * spread * spread * spread
        kept = rho * (top * s4 / (s4 + half))[..., None]
        first, second = 1 - kept, 1 - ratio * kept
        numerator = sums["resonant"][..., None] * second + sums["plain"][..., None] * first
        parts["higher"] = rho * rho * rho * numerator.clamp(min=0) / (math.pi * first * second)
    return parts


def _polynomials(r: Ring, sigma: Tensor, bounces: Bounces) -> dict[str, Tensor]:
    """p_d, p_i and, for all bounces, g_0, g_1, each (...)."""
    # At least 1-D: forward differentiation of "number * 0-d float32 tensor" yields float64.
    x = knee(torch.atleast_1d(sigma))
    length = len(_FIT.series["direct"][0])
    row = chebyshev(x, length)
    names = _PARTS[bounces]
    if torch.compiler.is_compiling() and sigma.numel() > 1:
        # A field of roughness: written out, the series stay inside the one fused loop over pixels.
        weights = {n: [_series(x, row, *k) for k in zip(_FIT.orders[n], _FIT.series[n], strict=True)] for n in names}
    elif torch.compiler.is_compiling() and torch.is_grad_enabled() and sigma.requires_grad:
        return _first_order(r, sigma, names)
    else:
        powers = torch.stack((*row, *(x * t for t in row), *(x * x * t for t in row)), dim=-1)
        weights = _weights(powers.reshape(*sigma.shape, -1), names)
    return {n: contract(r, _FIT.terms[n], weights[n]) for n in names}


def _weights(powers: Tensor, names: Sequence[str]) -> dict[str, list[Tensor]]:
    """Weights (...) of the terms of each part from [T, x T, x^2 T] (..., 3 * length), or from its derivative."""
    count = sum(len(_FIT.terms[n]) for n in names)
    columns = iter((powers @ _FIT.table[:count].to(powers).T).unbind(-1))
    return {n: [next(columns) for _ in _FIT.terms[n]] for n in names}


def _first_order(r: Ring, sigma: Tensor, names: Sequence[str]) -> dict[str, Tensor]:
    """The polynomials p with dp/dsigma attached as a number a pixel, for one compiled sigma: right to first order.

    The derivative of each weight would be a sum over the image of its own, some forty of them; so it is one.
    """
    s = torch.atleast_1d(sigma.detach())
    x, row_slope = knee(s), chebyshev_slope(knee(s), len(_FIT.series["direct"][0]))
    row = chebyshev(x, len(row_slope))
    powers = torch.stack((*row, *(x * t for t in row), *(x * x * t for t in row)), dim=-1)
    pairs = list(zip(row, row_slope, strict=True))
    slopes = (*row_slope, *(t + x * d for t, d in pairs), *(x * (2 * t + x * d) for t, d in pairs))
    by_sigma = torch.stack(slopes, dim=-1) * (2 * s * (KNEE / (s * s + KNEE**2)) ** 2)[..., None]
    value = _weights(powers.reshape(*sigma.shape, -1), names)
    slope = _weights(by_sigma.reshape(*sigma.shape, -1), names)
    step = sigma.expand(r.along.shape)
    step = step - step.detach()  # 0, with derivative 1
    still = Ring(*(t.detach() for t in r))
    return {n: contract(r, _FIT.terms[n], value[n]) + step * contract(still, _FIT.terms[n], slope[n]) for n in names}


def _series(x: Tensor, row: list[Tensor], order: int, coefficients: list[float]) -> Tensor:
    """x^order sum_j coefficients[j] row[j] (...)."""
    total = coefficients[0] * row[0]
    for c, t in zip(coefficients[1:], row[1:], strict=True):
        total = total + c * t
    for _ in range(order):
        total = total * x
    return total


def _check_bounces(name: str, bounces: object) -> None:
    if bounces not in _PARTS:
        raise ValueError(f'{name}: bounces must be 2 or "all"; found {bounces!r}.')


@final
class FastRoughSurface(CltcSampled, BRDF):
    """Fit of the exact V-cavity rough surface as a module; see `fast_rough_surface` for equation, units and deviations.

    Args:
        albedo: facet albedo rho, scalar, (channel,) or (..., channel). [-]
        sigma: roughness, scalar or (...). [rad]
        bounces: 2, or "all".
    Components: direct, two_bounce and, for all bounces, higher.
    Raises: ValueError outside the domains, or for other bounces.
    """

    albedo: Constrained = Constrained(ALBEDO)
    sigma: Constrained = Constrained(ROUGHNESS)

    def __init__(self, *, albedo: ParameterValue = 0.5, sigma: ParameterValue = 0.3, bounces: Bounces = "all"):
        super().__init__()
        _check_bounces("FastRoughSurface", bounces)
        self.albedo = albedo
        self.sigma = sigma
        self.bounces: Bounces = bounces

    def sampling_roughness(self) -> Tensor:
        return equivalent_roughness(self.sigma)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        return _components(cosines, self.albedo, self.sigma, self.bounces)

    def members(self) -> list[Member]:
        """The ladder up to this model."""
        material: dict[str, Any] = {name: kept(self, name) for name in ("albedo", "sigma")}
        two = (effects.ROUGHNESS, effects.INTERREFLECTION, effects.C3_TERM)
        simpler = OrenNayar(**material).members()
        if self.bounces == 2:
            return [*simpler, Member("fast, 2 bounces", two, self)]
        every = (effects.ROUGHNESS, effects.INTERREFLECTION, effects.LATER_BOUNCES, effects.C3_TERM)
        rough = FastRoughSurface(**material, bounces=2)
        return [*simpler, Member("fast, 2 bounces", two, rough), Member("fast, all bounces", every, self)]

    def stand_ins(self) -> dict[str, list[Option]]:
        return stand_ins(self.members())
