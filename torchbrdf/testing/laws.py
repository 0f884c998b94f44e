"""The laws every BRDF obeys, as functions to run on your own model.

Each law raises AssertionError with what it found. Parameters of the model must be scalar or per
channel: the laws choose the shapes of the directions.

>>> import torch
>>> from torchbrdf import OrenNayar
>>> brdf = OrenNayar(albedo=torch.tensor([0.7, 0.5, 0.3]), sigma=0.4)
>>> directions = random_directions(100, generator=torch.Generator().manual_seed(0))
>>> assert_reciprocal(brdf, *directions)
>>> assert_energy(brdf)
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.autograd.gradcheck import GradcheckError
from torch.func import functional_call

from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.linear import LinearBRDF
from torchbrdf.mixture import WeightedSum
from torchbrdf.testing.quadrature import albedo_by_quadrature


@dataclass(frozen=True)
class Tolerance:
    """What counts as equal in one dtype.

    Attributes:
        rounding: error of a value after some hundred operations, relative to `magnitude`.
        derivative: step of a finite difference, and a bound of its error, relative and absolute.
        integral: error of a quadrature over a function with kinks.
    """

    rounding: float
    derivative: float
    integral: float


def _tolerance(dtype: torch.dtype) -> Tolerance:
    eps = torch.finfo(dtype).eps
    return Tolerance(rounding=256 * eps, derivative=eps ** (1 / 3), integral=eps ** (1 / 3))


TOLERANCE = {dtype: _tolerance(dtype) for dtype in (torch.float64, torch.float32)}


class Directions(NamedTuple):
    """Unit vectors (..., 3) that leave the surface, in the order every BRDF takes them."""

    normal: Tensor
    light: Tensor
    view: Tensor


def random_directions(
    n: int,
    *,
    dtype: torch.dtype = torch.float32,
    max_angle: float = math.radians(85),
    generator: torch.Generator | None = None,
) -> Directions:
    """n random normals, each with a light and a view (n, 3) no further than max_angle [rad] from it.

    Angles and azimuths are uniform, so grazing directions are as frequent as steep ones.
    """
    normal = torch.nn.functional.normalize(torch.randn(n, 3, dtype=torch.float64, generator=generator), dim=-1)
    vectors = [normal]
    for _ in range(2):
        across = torch.randn(n, 3, dtype=torch.float64, generator=generator)
        tangent = torch.nn.functional.normalize(torch.linalg.cross(normal, across), dim=-1)
        angle = max_angle * torch.rand(n, 1, dtype=torch.float64, generator=generator)
        vectors.append(torch.nn.functional.normalize(angle.cos() * normal + angle.sin() * tangent, dim=-1))
    return Directions(*(v.to(dtype) for v in vectors))


def hard_directions(dtype: torch.dtype = torch.float32) -> dict[str, Directions]:
    """Named configurations (3,) where formulas divide by zero, take roots of zero or have a kink.

    Each also with a tilted frame, where rounding moves cosines to either side of 0 and 1.
    """
    degrees = {
        "normal = light = view": (0, 0, 0),
        "light = normal": (0, 60, 0),
        "view = normal": (60, 0, 0),
        "retro": (50, 50, 0),
        "mirror": (50, 50, 180),
        "dphi = 0": (30, 60, 0),
        "dphi = 90": (30, 60, 90),
        "dphi = 180": (30, 60, 180),
        "light at 89.9 deg": (89.9, 30, 45),
        "retro at 89.9 deg": (89.9, 89.9, 0),
        "dphi = 90 at 89.9 deg": (89.9, 89.9, 90),
        "mirror at 89.9 deg": (89.9, 89.9, 180),
        "light at 90 deg": (90, 30, 0),
        "view at 90 deg": (30, 90, 180),
        "both at 90 deg": (90, 90, 180),
        "light below": (120, 30, 0),
        "view below": (30, 120, 90),
        "light opposite to normal": (180, 30, 0),
        "both below": (100, 100, 0),
    }
    upright = {
        name: Directions(_polar(0, 0), _polar(light, 0), _polar(view, dphi))
        for name, (light, view, dphi) in degrees.items()
    }
    tilt = _rotation(0.7, 0.4)
    tilted = {f"{name}, tilted": Directions(*(v @ tilt.T for v in d)) for name, d in upright.items()}
    return {name: Directions(*(v.to(dtype) for v in d)) for name, d in (upright | tilted).items()}


def magnitude(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor) -> Tensor:
    """Sum of the absolute terms of f_r (..., channel): what rounding errors are relative to.

    It is f_r itself where nothing cancels.
    """
    return _magnitude(brdf, brdf.cosines(normal, light, view)).detach()


def assert_reciprocal(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor) -> None:
    """f_r is the same with light and view exchanged (Helmholtz)."""
    forth, back = brdf(normal, light, view), brdf(normal, view, light)
    _assert_close(
        "not reciprocal", forth, back, TOLERANCE[normal.dtype].rounding * magnitude(brdf, normal, light, view)
    )


def assert_nonnegative(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor, *, least: float = 0.0) -> None:
    """f_r >= least; a model that is known to go below 0 states how far."""
    f = brdf(normal, light, view)
    if not bool((f >= least).all()):
        raise AssertionError(
            f"below {least:g} /sr in {int((~(f >= least)).sum())} of {f.numel()} values (min {f.min():.6g})"
        )


def assert_zero_below_horizon(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor) -> None:
    """f_r and its gradient are exactly 0 once light, view or both are mirrored below the surface."""
    down_light, down_view = (v - 2 * (normal * v).sum(-1, keepdim=True) * normal for v in (light, view))
    for what, s, v in (("light", down_light, view), ("view", light, down_view), ("both", down_light, down_view)):
        f, gradients = value_and_gradients(brdf, Directions(normal, s, v))
        for name, value in {"value": f, **gradients}.items():
            if not bool((value == 0).all()):
                raise AssertionError(f"{what} below the horizon: {name} is not 0 (largest {value.abs().max():.3g})")


def assert_energy(
    brdf: BRDF,
    *,
    limit: float = 1.0,
    view_angles: Sequence[float] = (0.0, 0.5, 1.0, 1.3, 1.48, 1.55),
    nodes: int = 24,
    tolerance: float = TOLERANCE[torch.float64].integral,
) -> None:
    """The directional albedo is at most `limit`, in float64, at each view angle [rad].

    Gauss-Legendre panels that end at the kinks of Oren-Nayar models; twice the nodes must agree, else it reports that.
    """
    exact = copy.deepcopy(brdf).double()
    for angle in view_angles:
        coarse, fine = (albedo_by_quadrature(exact, angle, n) for n in (nodes, 2 * nodes))
        _assert_close(f"quadrature at {angle:g} rad not converged, more nodes", coarse, fine, tolerance * limit)
        if not bool((fine <= limit + tolerance).all()):
            raise AssertionError(f"reflects {fine.max():.6f} of the light from {angle:g} rad; limit {limit:g}")


def assert_finite(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor) -> None:
    """f_r and its gradients with respect to directions and parameters are finite."""
    f, gradients = value_and_gradients(brdf, Directions(normal, light, view))
    for name, value in {"value": f, **gradients}.items():
        if not bool(value.isfinite().all()):
            raise AssertionError(f"{name} is not finite: {int((~value.isfinite()).sum())} of {value.numel()} entries")


def assert_keeps_dtype(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor) -> None:
    """A model and directions in one dtype give values, components and gradients in that dtype."""
    f, gradients = value_and_gradients(brdf, Directions(normal, light, view))
    for name, value in {"value": f, **gradients, **brdf.components(normal, light, view)}.items():
        if value.dtype != normal.dtype:
            raise AssertionError(f"{name} is {value.dtype} although directions are {normal.dtype}")


def assert_broadcasts_like_a_loop(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor) -> None:
    """Normals (a, 1, 3) with lights and views (b, 3) give (a, b, channel): what a double loop gives."""
    grid = brdf(normal[:, None], light, view)
    loop = torch.stack([torch.stack([brdf(n, s, v) for s, v in zip(light, view, strict=True)]) for n in normal])
    if grid.shape != loop.shape:
        raise AssertionError(f"broadcasting gives shape {tuple(grid.shape)}, a loop {tuple(loop.shape)}")
    scale = magnitude(brdf, normal[:, None], light, view)
    _assert_close("broadcasting differs from a loop", grid, loop, TOLERANCE[normal.dtype].rounding * scale)


def assert_float32_matches_float64(
    brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor, *, rtol: float = 8 * torch.finfo(torch.float32).eps
) -> None:
    """f_r in float32 against float64 for the same float32 directions, relative to `magnitude`."""
    rounded = [v.float() for v in (normal, light, view)]
    f = copy.deepcopy(brdf).float()(*rounded)
    upcast = [torch.nn.functional.normalize(v.double(), dim=-1) for v in rounded]
    exact = copy.deepcopy(brdf).float().double()
    allowed = rtol * magnitude(exact, *upcast) + torch.finfo(torch.float32).tiny
    _assert_close("float32 differs from float64", f.double(), exact(*upcast), allowed)


def assert_gradients(brdf: BRDF, normal: Tensor, light: Tensor, view: Tensor, *, second: bool = True) -> None:
    """Derivatives match finite differences, for every parameter and direction, in float64.

    First derivatives in reverse and forward mode, and second ones. Directions are normalised inside,
    so that a difference may leave the unit sphere; keep them some steps away from kinks.
    """
    exact = copy.deepcopy(brdf).double()
    names = [name for name, _ in exact.named_parameters()]
    inputs = [t.detach().double().requires_grad_() for t in (normal, light, view, *exact.parameters())]

    def f(n: Tensor, s: Tensor, v: Tensor, *parameters: Tensor) -> Tensor:
        return functional_call(exact, dict(zip(names, parameters, strict=True)), (n, s, v), {"normalize": True})

    h = TOLERANCE[torch.float64].derivative
    try:
        torch.autograd.gradcheck(f, inputs, eps=h, atol=h, rtol=h, check_forward_ad=True)
        if second and f(*inputs).requires_grad:
            torch.autograd.gradgradcheck(f, inputs, eps=h, atol=h, rtol=h)
    except GradcheckError as error:
        raise AssertionError(f"a derivative is wrong: {error}") from None


def value_and_gradients(brdf: BRDF, directions: Directions) -> tuple[Tensor, dict[str, Tensor]]:
    given = {name: v.detach().clone().requires_grad_() for name, v in directions._asdict().items()}
    inputs = given | {name: p for name, p in brdf.named_parameters() if p.requires_grad}
    f = brdf(**given)
    if not f.requires_grad:  # Lambert with a fixed albedo depends on nothing
        return f, {f"gradient to {name}": torch.zeros_like(t) for name, t in inputs.items()}
    gradients = torch.autograd.grad(f.sum(), list(inputs.values()), allow_unused=True, materialize_grads=True)
    return f.detach(), {f"gradient to {name}": g for name, g in zip(inputs, gradients, strict=True)}


def _magnitude(brdf: BRDF, cosines: Cosines) -> Tensor:
    if isinstance(brdf, LinearBRDF):
        return (brdf.basis(cosines).abs()[..., None, :] * brdf.coefficients().abs()).sum(-1)
    if isinstance(brdf, WeightedSum):
        scaled = [w * _magnitude(part, cosines) for w, part in zip(brdf.weights, brdf.parts, strict=True)]  # pyright: ignore
        return torch.stack(torch.broadcast_tensors(*scaled)).sum(0)
    parts = [cosines.zero_below_horizon(part).abs() for part in brdf.evaluate_components(cosines).values()]
    return torch.stack(torch.broadcast_tensors(*parts)).sum(0)


def _polar(theta_degrees: float, phi_degrees: float) -> Tensor:
    """Unit vector (3,) in float64, exact at multiples of 90 degrees."""
    sin, cos = (_exact(f, theta_degrees) for f in (math.sin, math.cos))
    return torch.tensor(
        [sin * _exact(math.cos, phi_degrees), sin * _exact(math.sin, phi_degrees), cos], dtype=torch.float64
    )


def _exact(function, degrees: float) -> float:
    value = function(math.radians(degrees))
    return float(round(value)) if degrees % 90 == 0 else value


def _rotation(about_z: float, about_x: float) -> Tensor:
    cz, sz, cx, sx = math.cos(about_z), math.sin(about_z), math.cos(about_x), math.sin(about_x)
    return torch.tensor([[cz, -sz * cx, sz * sx], [sz, cz * cx, -cz * sx], [0.0, sx, cx]], dtype=torch.float64)


def _assert_close(what: str, got: Tensor, expected: Tensor, allowed: Tensor | float) -> None:
    error, allowed = torch.broadcast_tensors((got - expected).abs(), torch.as_tensor(allowed, dtype=got.dtype))
    off = ~(error <= allowed)  # written so that NaN counts as off
    if bool(off.any()):
        excess = torch.where(off, error / allowed, 0.0).nan_to_num(math.inf).flatten()
        worst = int(excess.argmax())
        raise AssertionError(
            f"{what}: {int(off.sum())} of {off.numel()} values; worst {got.flatten()[worst]:.9g} against "
            f"{expected.flatten()[worst]:.9g}, {excess[worst]:.3g} times what is allowed"
        )
