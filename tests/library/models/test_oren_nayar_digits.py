"""Where angles lose their digits and their derivatives, and Oren-Nayar without angles does not."""

import math

import mpmath
import pytest
import torch
from paper_form import NORMAL, PI, by_angles, direction
from torch.testing import assert_close

from torchbrdf import OrenNayar, fixed
from torchbrdf.testing import magnitude, random_directions


def angle_form(normal, light, view, rho, sigma, *, clamp):
    """What people write today: acos of clamped dot products, azimuth from projected vectors."""
    cosine = [(normal * v).sum(-1) for v in (light, view)]
    theta_i, theta_r = (c.clamp(-1 + clamp, 1 - clamp).acos() for c in cosine)
    flat = [v - c[..., None] * normal for v, c in zip((light, view), cosine, strict=True)]
    c = (flat[0] * flat[1]).sum(-1) / (flat[0].norm(dim=-1) * flat[1].norm(dim=-1) + 1e-8)
    alpha, beta = torch.maximum(theta_i, theta_r), torch.minimum(theta_i, theta_r)
    s2 = sigma**2
    c2 = 0.45 * s2 / (s2 + 0.09) * torch.where(c >= 0, alpha.sin(), alpha.sin() - (2 * beta / PI) ** 3)
    c3 = 0.125 * s2 / (s2 + 0.09) * (4 * alpha * beta / PI**2) ** 2
    direct = 1 - 0.5 * s2 / (s2 + 0.33) + c * c2 * beta.tan() + (1 - c.abs()) * c3 * ((alpha + beta) / 2).tan()
    return rho / PI * direct + 0.17 * rho**2 / PI * s2 / (s2 + 0.13) * (1 - c * (2 * beta / PI) ** 2)


def tilted_normal_value(x, y, theta_view, rho, sigma):
    """f by (27)-(29) with 50 digits, light (0,0,1), normal proportional to (x, y, 1)."""
    length = mpmath.sqrt(1 + x * x + y * y)
    n = [x / length, y / length, 1 / length]
    v = [mpmath.sin(theta_view), mpmath.mpf(0), mpmath.cos(theta_view)]
    light_flat = [-n[2] * n[0], -n[2] * n[1], 1 - n[2] * n[2]]
    n_view = sum(a * b for a, b in zip(n, v, strict=True))
    view_flat = [a - n_view * b for a, b in zip(v, n, strict=True)]
    sin_light, sin_view = (mpmath.sqrt(sum(a * a for a in w)) for w in (light_flat, view_flat))
    c = sum(a * b for a, b in zip(light_flat, view_flat, strict=True)) / (sin_light * sin_view)
    theta_i, theta_r = mpmath.atan2(sin_light, n[2]), mpmath.atan2(sin_view, n_view)
    return sum(by_angles(theta_i, theta_r, mpmath.acos(max(-1, min(1, c))), rho, sigma, m=mpmath))


def test_gradient_to_the_normal_where_light_is_normal():
    # f is smooth there: cos(dphi) tan(beta) is linear in the tilt, the rest of higher order.
    rho, sigma, theta_view = 0.7, 0.7, math.radians(60)
    with mpmath.workdps(50):
        h = mpmath.mpf(10) ** -12
        args = (mpmath.mpf(theta_view), mpmath.mpf(rho), mpmath.mpf(sigma))
        truth = [
            float(
                (
                    tilted_normal_value(*(h * e for e in axis), *args)
                    - tilted_normal_value(*(-h * e for e in axis), *args)
                )
                / (2 * h)
            )
            for axis in ((1, 0), (0, 1))
        ]
    # by hand: -(rho/pi) 0.45 sigma^2/(sigma^2 + 0.09) sin(alpha), straight towards the viewer
    assert_close(truth[0], -rho / PI * 0.45 * 0.49 / 0.58 * math.sin(theta_view), rtol=1e-9, atol=0)
    assert abs(truth[1]) < 1e-9
    for dtype, rtol in ((torch.float64, 1e-9), (torch.float32, 1e-6)):
        light = NORMAL.to(dtype)
        view = torch.tensor(direction(theta_view), dtype=dtype)
        normal = light.clone().requires_grad_()
        brdf = OrenNayar(albedo=torch.tensor(rho, dtype=dtype), sigma=torch.tensor(sigma, dtype=dtype))
        (ours,) = torch.autograd.grad(brdf(normal, light, view, normalize=True).sum(), normal)
        assert_close(ours, torch.tensor([truth[0], 0.0, 0.0], dtype=dtype), rtol=rtol, atol=rtol * 0.1)
        # The angle form: hundreds instead of 0.073 with the usual clamps, NaN with none.
        for clamp in (1e-6, 1e-7):
            (theirs,) = torch.autograd.grad(angle_form(normal, light, view, rho, sigma, clamp=clamp).sum(), normal)
            assert theirs.norm() > 100
        (theirs,) = torch.autograd.grad(angle_form(normal, light, view, rho, sigma, clamp=0.0).sum(), normal)
        assert theirs.isnan().all()


def test_gradient_where_light_is_a_tilted_normal():
    # Rounding leaves the cosine on either side of 1; the gradient stays the hand-derived one.
    generator = torch.Generator().manual_seed(6)
    for dtype, atol in ((torch.float64, 1e-8), (torch.float32, 1e-5)):
        normal, _, view = random_directions(2000, dtype=torch.float64, generator=generator)
        across = view - (normal * view).sum(-1, keepdim=True) * normal
        expected = -0.7 / PI * 0.45 * 0.49 / 0.58 * across
        n = normal.to(dtype, copy=True).requires_grad_()
        brdf = OrenNayar(albedo=torch.tensor(0.7, dtype=dtype), sigma=torch.tensor(0.7, dtype=dtype))
        (ours,) = torch.autograd.grad(brdf(n, normal.to(dtype), view.to(dtype), normalize=True).sum(), n)
        assert_close(ours, expected.to(dtype), rtol=0, atol=atol)


@pytest.mark.parametrize("sigma", [0.1, 0.5, 1.0, 1.2])
def test_float32_error(sigma):
    # Below 1e-6 of the sum of the absolute terms (see test_laws for the rare exceptions at sigma >= 1.2), which is
    # the value itself where nothing cancels. Forward grazing cancels at large sigma: the plain relative error reaches
    # 2e-5 at sigma = 1.2 and rho = 0.7, and has no bound at small rho, where f crosses 0.
    directions = random_directions(50_000, generator=torch.Generator().manual_seed(7))
    rho, s = torch.tensor([0.05, 0.95]), torch.tensor(sigma)
    got = OrenNayar(albedo=fixed(rho), sigma=fixed(s))(*directions).double()
    exact = OrenNayar(albedo=fixed(rho.double()), sigma=fixed(s.double()))
    upcast = [torch.nn.functional.normalize(v.double(), dim=-1) for v in directions]
    error = (got - exact(*upcast)).abs()
    assert (error <= 1e-6 * magnitude(exact, *upcast)).all()
    backward = (upcast[1] * upcast[2]).sum(-1) >= (upcast[0] * upcast[1]).sum(-1) * (upcast[0] * upcast[2]).sum(-1)
    assert (error <= 1e-6 * exact(*upcast).abs())[backward].all()  # nothing cancels on the side of the light
