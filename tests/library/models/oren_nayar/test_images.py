"""Images of the geometry: means over cavities, small sigma, derivatives at the normal."""

import math

import pytest
import torch
from helpers.planes import f64

from torchbrdf import Cosines, gaussian_weights, shared_slopes
from torchbrdf.models.oren_nayar.cavity_modes import modes_of
from torchbrdf.models.oren_nayar.images import Bounces, cavity_images, mean_images
from torchbrdf.models.oren_nayar.slope_plane import slope_plane

F64 = torch.float64
CPU = torch.device("cpu")


def basis(cos_light, cos_view, cos_phase, *, nodes, order, modes=0, graded=False):
    angle = torch.tensor(shared_slopes(nodes), dtype=cos_light.dtype)
    return mean_images(
        slope_plane(Cosines.from_products(cos_light, cos_view, cos_phase)),
        cos_slope=angle.cos(),
        tan_slope=angle.tan(),
        bounces=Bounces(True, modes),
        order=order,
        graded=graded,
        modes=modes_of(shared_slopes(nodes), modes, cos_light.dtype, CPU) if modes else None,
    )


def cosines(theta_i, theta_r, delta):
    ci, cr, si, sr = math.cos(theta_i), math.cos(theta_r), math.sin(theta_i), math.sin(theta_r)
    return f64(ci, cr, ci * cr + si * sr * math.cos(delta))


@pytest.mark.parametrize("count", [31, 95])  # what `RoughSurface` takes for direct light with 16 and 48 slopes
def test_small_sigma_joins_lambert_smoothly(count):
    sigma = torch.tensor([0.0, 1e-12, 1e-4, 1e-3, 0.005, 0.01, 0.02, 0.03], dtype=F64, requires_grad=True)
    weights = gaussian_weights(sigma, nodes=count)
    torch.testing.assert_close(weights.sum(-1), torch.ones_like(sigma), rtol=1e-14, atol=0)
    assert weights[0, 0] == 1
    assert weights[0, 1:].abs().max() == 0
    images = basis(*cosines(1.0, 0.8, 0.5), nodes=count, order=12)
    direct = weights @ images.direct
    assert direct[0].item() == pytest.approx(1 / math.pi, rel=1e-15)
    # section 6: d = (1/pi)(1 - sigma^2 + sigma^2 p.q)
    dot = math.tan(1.0) * math.tan(0.8) * math.cos(0.5)
    expected = (1 + sigma**2 * (dot - 1)) / math.pi
    torch.testing.assert_close(direct[:5], expected[:5], rtol=3e-7, atol=0)
    torch.testing.assert_close((weights @ images.two_bounce)[:4], (sigma**2 / math.pi)[:4], rtol=0.2, atol=1e-16)
    (slope,) = torch.autograd.grad(direct.sum(), sigma)
    torch.testing.assert_close(slope[:5], (2 * sigma * (dot - 1) / math.pi).detach()[:5], rtol=2e-2, atol=1e-12)


def test_higher_azimuth_mean_is_the_mean_of_cavities():
    slopes = shared_slopes(6)
    modes = modes_of(slopes, 5, F64, CPU)
    theta_i, theta_r, delta = 1.2, 1.0, 0.8
    turn = 2 * math.pi * (torch.arange(20000, dtype=F64) + 0.5) / 20000
    tangent = torch.tensor(slopes, dtype=F64).tan()
    pair = cavity_images(
        (math.tan(theta_i) * turn.cos())[:, None] * tangent,
        (math.tan(theta_r) * (turn - delta).cos())[:, None] * tangent,
        cos_slope=torch.tensor(slopes, dtype=F64).cos(), bounces=Bounces(True, 5), modes=modes,
    )  # fmt: skip
    found = basis(*cosines(theta_i, theta_r, delta), nodes=6, order=24, modes=5, graded=True)
    for got, expected in zip(found, pair, strict=True):
        torch.testing.assert_close(got, expected.mean(0), rtol=1e-5, atol=2e-6)


def test_derivative_at_the_normal_is_the_limit():
    """Light along the normal: the derivative with respect to the light's direction, one-sided numerically."""
    sigma = f64(0.4)[0]

    def value(light):
        view = torch.tensor([math.sin(1.1), 0.0, math.cos(1.1)], dtype=F64)
        images = basis(light[2], view[2], light @ view, nodes=16, order=8)
        return (images.direct + images.two_bounce) @ gaussian_weights(sigma, nodes=16)

    light = torch.tensor([0.0, 0.0, 1.0], dtype=F64, requires_grad=True)
    (gradient,) = torch.autograd.grad(value(light), light)
    tilt = 1e-4
    ahead, behind = (value(torch.tensor([math.sin(t), 0.0, math.cos(t)], dtype=F64)) for t in (tilt, -tilt))
    assert gradient[0].item() == pytest.approx(((ahead - behind) / (2 * tilt)).item(), rel=1e-5)
