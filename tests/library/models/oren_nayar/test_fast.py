"""FastRoughSurface against the exact model it was fitted to, and the laws it obeys by construction."""

import json
import math
from pathlib import Path

import pytest
import torch
from torch.testing import assert_close

from torchbrdf import Cosines, FastRoughSurface, Lambert, RoughSurface, fast_rough_surface, fixed
from torchbrdf.models.oren_nayar import coordinates, fast
from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles

SIGMAS = (1.3, 4.0, 9.0, 18.0, 31.0, 47.0, 60.0)  # degrees
ALBEDO = torch.tensor([0.3, 0.6, 0.9], dtype=torch.float64)
HARD = {  # polar angle of light, of view, azimuth between them (degrees)
    "normal": (0.0, 0.0, 0.0),
    "light on normal": (0.0, 50.0, 0.0),
    "retro": (60.0, 60.0, 0.0),
    "retro at the horizon": (89.9, 89.9, 0.0),
    "forward at the horizon": (89.9, 89.9, 180.0),
    "across at the horizon": (89.9, 20.0, 90.0),
    "mirror": (45.0, 45.0, 180.0),
}


def number(value: float, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    return torch.tensor(value, dtype=dtype)


def degrees(value: float, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    return number(math.radians(value), dtype)


def unit(polar: float, azimuth: float, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    polar, azimuth = math.radians(polar), math.radians(azimuth)
    x = (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar))
    return torch.tensor(x, dtype=dtype)


def cosines_at(light, view, azimuth, dtype: torch.dtype = torch.float64) -> Cosines:
    """From angles (...) in radians."""
    phase = light.cos() * view.cos() + light.sin() * view.sin() * azimuth.cos()
    return Cosines.from_products(light.cos().to(dtype), view.cos().to(dtype), phase.to(dtype))


def angles(seed: int, count: int, top: float, *, in_plane: bool = False) -> tuple[torch.Tensor, ...]:
    """Uniform in polar angle and azimuth; `in_plane` crowds them at dphi = 0 and 180 degrees, and at grazing light."""
    u = torch.rand(3, count, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    light, view, azimuth = math.radians(top) * u[0], math.radians(top) * u[1], math.pi * u[2]
    if in_plane:
        light = math.radians(top) * (1 - u[0] ** 2)
        azimuth = math.pi * torch.where(u[2] < 0.5, 4 * u[2] ** 3, 1 - 4 * (1 - u[2]) ** 3)
    return light, view, azimuth


def exact(cosines: Cosines, sigmas: torch.Tensor, bounces) -> torch.Tensor:
    """(S, P, R) [1/sr] of the exact model on 64 slopes: at 1.3 degrees within 1e-3, elsewhere much closer."""
    model = RoughSurface(albedo=fixed(ALBEDO), sigma=fixed(sigmas[0]), nodes=64, order=10, bounces=bounces, modes=8)
    images = model.basis(cosines)
    found = []
    for sigma in sigmas:
        model.sigma = fixed(sigma)
        found.append(images @ model.coefficients().mT)
    return torch.stack(found)


def fitted(cosines: Cosines, sigmas: torch.Tensor, bounces) -> torch.Tensor:
    return torch.stack([fast_rough_surface(cosines, albedo=ALBEDO, sigma=s, bounces=bounces) for s in sigmas])


@pytest.mark.parametrize("bounces", [2, "all"])
@pytest.mark.parametrize("in_plane", [False, True])
def test_bars_on_fresh_directions(in_plane, bounces):
    cosines = cosines_at(*angles(4711 + in_plane, 500, 85.0, in_plane=in_plane))
    sigmas = torch.deg2rad(torch.tensor(SIGMAS, dtype=torch.float64))
    found = fitted(cosines, sigmas, bounces)
    error = found / exact(cosines, sigmas, bounces) - 1
    assert (found > 0).all()
    assert error.abs().max() < 0.05
    assert error.square().mean().sqrt() < 0.003
    assert error.square().mean((1, 2)).sqrt().max() < 0.007  # the worst roughness, 60 degrees


def test_bars_next_to_the_horizon():
    # where quadratures with fixed slopes are off: the reference follows direction and roughness
    generator = torch.Generator().manual_seed(12)
    larger, other, azimuth, width = torch.rand(4, 150, generator=generator, dtype=torch.float64)
    light = torch.deg2rad(85 + 4 * larger)
    view, azimuth = light * other.sqrt(), math.pi * azimuth
    sigma = torch.deg2rad(2 + 58 * width)
    reference = converged(slope_plane_from_angles(light, view, azimuth), sigma, panel_order=6, order=12, chunk=50)
    expected = ALBEDO * reference.direct[:, None] + ALBEDO**2 * reference.two_bounce[:, None]
    f = fast_rough_surface(cosines_at(light, view, azimuth), albedo=ALBEDO, sigma=sigma, bounces=2)
    error = f / expected - 1
    assert error.square().mean().sqrt() < 0.004
    assert error.abs().max() < 0.03


def test_positive_and_bounded_up_to_the_horizon(dtype):
    grazing = torch.tensor([85.0, 89.0, 89.9, 89.99, 89.9999], dtype=torch.float64).deg2rad()
    light, view, azimuth, sigma = torch.meshgrid(
        grazing,
        torch.cat((torch.tensor([0.0, 0.7], dtype=torch.float64), grazing)),
        torch.tensor([0.0, 0.3, 2.0, math.pi], dtype=torch.float64),
        torch.tensor([0.01, 0.4, 1.0, 1.57], dtype=torch.float64),
        indexing="ij",
    )
    cosines = cosines_at(light, view, azimuth, dtype)
    one = torch.ones((), dtype=dtype)
    for bounces in (2, "all"):
        f = fast_rough_surface(cosines, albedo=one, sigma=sigma.to(dtype), bounces=bounces)[..., 0]
        assert (f > 0).all()
        assert (f * torch.minimum(cosines.light, cosines.view) < 0.6).all()


def test_float32_gradient_next_to_retro_reflection():
    # The cone at light = view: cosines alone know its slope there by a few digits or none.
    normal, view = unit(0, 0), unit(63, 20)
    for apart in (1.0, 0.1, 0.01):
        slopes = []
        for dtype in (torch.float64, torch.float32):
            light = unit(63, 20 + apart).to(torch.float32).to(dtype).requires_grad_()
            given = [v.to(torch.float32).to(dtype) for v in (normal, view)]
            model = FastRoughSurface(albedo=fixed(number(0.8, dtype)), sigma=fixed(number(0.6, dtype)))
            f = model(given[0], light, given[1], normalize=True)
            slopes.append(torch.autograd.grad(f.sum(), light)[0].double())
        assert (slopes[1] - slopes[0]).norm() < 0.01 * slopes[0].norm(), apart


@pytest.mark.parametrize(("bounces", "bar"), [(2, 0.04), ("all", 0.08)])
def test_derivative_by_sigma(bounces, bar):
    cosines, step = cosines_at(*angles(99, 300, 85.0)), 1e-4
    for degree in (10.0, 30.0, 50.0):
        sigma = degrees(degree)
        low, high = exact(cosines, torch.stack((sigma - step, sigma + step)), bounces)
        expected = (high - low) / (2 * step)
        _, found = torch.func.jvp(
            lambda s: fast_rough_surface(cosines, albedo=ALBEDO, sigma=s, bounces=bounces),
            (sigma,),
            (torch.ones_like(sigma),),
        )
        assert (found - expected).square().mean().sqrt() < bar * expected.square().mean().sqrt()


@pytest.mark.parametrize("bounces", [2, "all"])
@pytest.mark.parametrize("degree", [0.5, 8.0, 35.0, 85.0])
def test_reciprocal_up_to_the_horizon(bounces, degree):
    light, view, azimuth = angles(5, 2000, 89.9, in_plane=True)
    there, back = (
        fast_rough_surface(cosines_at(*pair, azimuth), albedo=number(0.8), sigma=degrees(degree), bounces=bounces)
        for pair in ((light, view), (view, light))
    )
    assert_close(there, back, rtol=1e-12, atol=1e-13)


def test_sigma_zero_is_lambert_with_zero_slope(dtype):
    cosines = cosines_at(*angles(6, 500, 89.9, in_plane=True), dtype)
    sigma = torch.zeros((), dtype=dtype, requires_grad=True)
    albedo = torch.tensor([0.4, 0.9], dtype=dtype)
    found = fast_rough_surface(cosines, albedo=albedo, sigma=sigma, bounces="all")
    lambert = Lambert(albedo=fixed(albedo)).evaluate(cosines).expand(500, 2)
    assert_close(found, lambert, rtol=2 * torch.finfo(dtype).eps, atol=0)
    found.sum().backward()
    assert sigma.grad == 0


def test_small_sigma_expansion():
    light, view, azimuth = angles(7, 200, 60.0)
    sigma, rho = number(2e-3), number(0.5)
    along = light.tan() * view.tan() * azimuth.cos()
    expected = rho * (along - 1) + rho**2  # by sigma^2
    found = math.pi * fast_rough_surface(cosines_at(light, view, azimuth), albedo=rho, sigma=sigma, bounces="all")[:, 0]
    # The terms of the next order, sigma times D, P and G, are still some per cent of sigma^2 here.
    assert_close((found - rho) / sigma**2, expected, rtol=0, atol=0.05)


@pytest.mark.parametrize("bounces", [2, "all"])
def test_sigma_per_pixel_is_the_scalar_one_by_one(bounces):
    cosines = cosines_at(*angles(8, 6, 80.0))
    sigma = torch.linspace(0, 1.5, 6, dtype=torch.float64)
    rho = torch.linspace(0.1, 1.0, 18, dtype=torch.float64).reshape(6, 3)
    found = fast_rough_surface(cosines, albedo=rho, sigma=sigma, bounces=bounces)
    for k in range(6):
        one = Cosines.from_products(cosines.light[k], cosines.view[k], cosines.phase[k])
        alone = fast_rough_surface(one, albedo=rho[k], sigma=sigma[k], bounces=bounces)
        assert_close(found[k], alone, rtol=1e-12, atol=0)


@pytest.mark.parametrize("radians", [0.0, 0.7])
def test_one_trained_sigma_is_captured_with_its_derivatives(radians):
    light, view, azimuth = angles(10, 16, 80.0)
    light.requires_grad_()
    sigma = number(radians).requires_grad_()

    def value(light, sigma):
        return fast_rough_surface(cosines_at(light, view, azimuth), albedo=number(0.6), sigma=sigma, bounces="all")

    torch.compiler.reset()
    found = torch.compile(value, fullgraph=True, backend="eager")(light, sigma)
    expected = value(light, sigma)
    assert_close(found, expected, rtol=1e-12, atol=0)
    for got, right in zip(*(torch.autograd.grad(f.sum(), (light, sigma)) for f in (found, expected)), strict=True):
        assert_close(got, right, rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("bounces", [2, "all"])
@pytest.mark.parametrize("sigma", [0.0, 0.4, 1.3])
def test_first_and_second_derivatives(bounces, sigma):
    normal, light, view = unit(0, 0), unit(50, 10), unit(35, 130)
    albedo = torch.tensor([0.3, 0.8], dtype=torch.float64)
    inputs = [t.clone().requires_grad_() for t in (normal, light, view, albedo, number(sigma))]

    def value(n, light, view, albedo, sigma):
        cosines = Cosines.from_products((n * light).sum(-1), (n * view).sum(-1), (light * view).sum(-1))
        return fast_rough_surface(cosines, albedo=albedo, sigma=sigma.abs(), bounces=bounces)

    if sigma == 0:  # a minimum of the domain: differentiate in the others
        inputs[-1] = inputs[-1].detach()
    assert torch.autograd.gradcheck(value, inputs)
    assert torch.autograd.gradgradcheck(value, inputs)


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("degree", [0.01, 3.0, 40.0, 90.0])
def test_finite_in_hard_directions(dtype, name, degree):
    light, view, azimuth = HARD[name]
    vectors = [v.requires_grad_() for v in (unit(0, 0, dtype), unit(light, 0, dtype), unit(view, azimuth, dtype))]
    sigma = degrees(degree, dtype).requires_grad_()
    cosines = Cosines.of(*vectors, normalize=True)
    found = fast_rough_surface(cosines, albedo=number(0.7, dtype), sigma=sigma, bounces="all")
    assert found.isfinite().all()
    assert (found >= 0).all()
    assert (found * torch.minimum(cosines.light, cosines.view)[..., None] < 0.4).all()
    found.sum().backward()
    for tensor in (*vectors, sigma):
        assert tensor.grad is not None
        assert tensor.grad.isfinite().all()


def test_module_forwards_and_names_its_parts():
    normal, light, view = unit(0, 0), unit(50, 0), unit(30, 70)
    model = FastRoughSurface(albedo=fixed(number(0.6)), sigma=fixed(number(0.5)))
    parts = model.components(normal, light, view)
    assert list(parts) == ["direct", "two_bounce", "higher"]
    whole = fast_rough_surface(Cosines.of(normal, light, view), albedo=number(0.6), sigma=number(0.5), bounces="all")
    assert_close(sum(parts.values()), whole)
    assert_close(model(normal, light, view), whole)
    two = FastRoughSurface(albedo=fixed(number(0.6)), sigma=fixed(number(0.5)), bounces=2)
    assert_close(two(normal, light, view), parts["direct"] + parts["two_bounce"])


@pytest.mark.parametrize("bounces", [1, 3, "two"])
def test_refuses_other_bounces(bounces):
    with pytest.raises(ValueError, match="bounces must be 2"):
        FastRoughSurface(bounces=bounces)


def test_refuses_values_outside_the_domains():
    cosines = cosines_at(*angles(1, 4, 60.0))
    with pytest.raises(ValueError, match="fast_rough_surface: albedo"):
        fast_rough_surface(cosines, albedo=number(1.2), sigma=number(0.3), bounces=2)
    with pytest.raises(ValueError, match="fast_rough_surface: sigma"):
        fast_rough_surface(cosines, albedo=number(0.5), sigma=number(-0.1), bounces=2)


def test_the_numbers_are_those_of_these_coordinates():
    # Whoever changes a coordinate has to run the generator again.
    stored = json.loads(Path(fast.__file__).with_name("fast_rough_surface.json").read_text())
    for name in ("KAPPA", "LEVEL", "RETURN"):
        assert stored[name.lower()] == getattr(coordinates, name)
    assert (Path(__file__).parents[4] / stored["generator"]).is_file()
    assert len(set(stored["seeds"].values())) == len(stored["seeds"])
