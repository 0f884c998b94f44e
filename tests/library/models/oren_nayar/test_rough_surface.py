"""The exact rough surface: a tabulated Gaussian, a white furnace, what is refused, what is known to be wrong."""

import math

import pytest
import torch
from helpers.planes import UP, f64, unit

from torchbrdf import (
    RoughSurface,
    TabulatedRoughSurface,
    fixed,
    gaussian_weights,
)
from torchbrdf import testing as laws
from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles

DOUBLE = torch.float64


def test_tabulated_gaussian_is_the_gaussian():
    sigma = f64(0.6)[0]
    weights = gaussian_weights(sigma, nodes=12)
    directions = UP, unit(1.0, 0.0), unit(0.9, 2.0)
    table = TabulatedRoughSurface(albedo=f64(0.5)[0], weights=fixed(weights.clamp(min=0) / weights.clamp(min=0).sum()))
    torch.testing.assert_close(table(*directions), RoughSurface(albedo=f64(0.5)[0], sigma=sigma, nodes=12)(*directions),
                               rtol=1e-3, atol=0)  # fmt: skip
    with pytest.raises(ValueError, match="weights must hold shares above 0 that sum to 1"):
        TabulatedRoughSurface(weights=torch.tensor([0.5, 0.5, 0.0]))


@pytest.mark.parametrize("arguments", [{"nodes": 2}, {"order": 0}, {"bounces": 3}, {"bounces": "all", "modes": 21}])
def test_refused(arguments):
    with pytest.raises(ValueError, match=next(reversed(arguments))):
        RoughSurface(**arguments)


# polar angles and azimuth [deg] and sigma [rad] at which earlier quadratures turned negative, or missed by half
GRAZING = [
    (89.9, 89.9, 180.0, 0.01),
    (89.0, 89.0, 180.0, 0.02),
    (89.99, 77.19, 179.6, 0.7),
    (89.9, 89.9, 180.0, 0.002),
    (89.9, 60.0, 90.0, 0.05),
    (89.9, 89.9, 180.0, 0.001),
]


@pytest.mark.parametrize("case", GRAZING)
def test_grazing_light_on_any_roughness_is_that_of_the_integral(case):
    *degrees, roughness = case
    light, view, azimuth = (math.radians(angle) for angle in degrees)
    albedo, sigma = f64(0.9, roughness)
    expected = converged(slope_plane_from_angles(*f64(light, view, azimuth)), sigma)
    for count, tolerance in ((16, 2e-2), (48, 5e-3)):
        model = RoughSurface(albedo=albedo, sigma=sigma, nodes=count).double()
        value = model(UP, unit(light, 0.0), unit(view, azimuth), normalize=True)
        integral = albedo * expected.direct + albedo**2 * expected.two_bounce
        assert value.item() == pytest.approx(integral.item(), rel=tolerance)


@pytest.mark.parametrize("count", [16, 48])
def test_defaults_meet_the_integral(count):
    """Relative errors up to 85 and to 89.9 deg, for few directions."""
    generator = torch.Generator().manual_seed(4)
    theta = torch.deg2rad(
        torch.tensor([85.0] * 6 + [89.9] * 6, dtype=DOUBLE)
        * torch.rand(2, 12, generator=generator, dtype=DOUBLE) ** 0.25
    )
    azimuth = torch.tensor([0.0, math.pi, 1.0] * 4, dtype=DOUBLE)
    plane = slope_plane_from_angles(theta[0], theta[1], azimuth)
    (albedo,) = f64(0.9)
    bars = torch.tensor([1.6e-3] * 6 + [2e-2] * 6 if count == 16 else [1e-3] * 6 + [5e-3] * 6, dtype=DOUBLE)
    for sigma in f64(0.03, 0.2, 0.9):
        exact = converged(plane, sigma, panel_order=8, order=16)
        model = RoughSurface(albedo=albedo, sigma=sigma, nodes=count).double()
        value = model.images(*plane) @ model.coefficients()[0]
        integral = albedo * exact.direct + albedo**2 * exact.two_bounce
        assert ((value / integral - 1).abs() < bars).all()


@pytest.mark.parametrize("bounces", [1, 2, "all"])
def test_never_negative_down_to_the_horizon(bounces):
    generator = torch.Generator().manual_seed(7)
    cosine = 10 ** (-6 * torch.rand(2, 600, generator=generator, dtype=DOUBLE))
    azimuth = math.pi * torch.rand(600, generator=generator, dtype=DOUBLE)
    azimuth[::4], azimuth[1::4] = math.pi, 0.0
    plane = slope_plane_from_angles(cosine[0].acos(), cosine[1].acos(), azimuth)
    for sigma in (1e-3, 0.01, 0.1, 0.5, 1.5):
        model = RoughSurface(albedo=0.9, sigma=sigma, bounces=bounces).double()
        value = model.images(*plane) @ model.coefficients()[0]
        assert (value >= 0).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sigma", "degrees", "tolerance"),
    [
        (0.3, 0, 1e-6),
        (0.3, 60, 1e-6),
        (0.3, 85, 2e-6),  # the cubature itself: 8e-6 with half the nodes
        (0.9, 60, 3e-4),  # 1.6e-4 measured; likely slopes near 90 degrees, which want more modes than keep digits
    ],
)
def test_isotropic_white_surface_reflects_everything(sigma, degrees, tolerance):
    # of one set of slopes: each conserves energy, so their sum does, however few they are
    one, weights = fixed(f64(1.0)[0]), fixed(gaussian_weights(f64(sigma)[0], nodes=12))
    model = TabulatedRoughSurface(albedo=one, weights=weights, order=8, graded=True, bounces="all", modes=12)
    reflected = laws.albedo_by_quadrature(model, math.radians(degrees), 48)
    assert abs(reflected.item() - 1) < tolerance


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0, 60, 85])
def test_light_returned_by_the_default_slopes(degrees):
    """Direct light has more slopes than what bounces: 1e-3 of the light is lost between them, or won."""
    for sigma in (0.2, 0.5, 0.9):
        white = RoughSurface(albedo=fixed(f64(1.0)[0]), sigma=fixed(f64(sigma)[0]), bounces="all")
        assert abs(laws.albedo_by_quadrature(white, math.radians(degrees), 24).item() - 1) < 1.5e-3


@pytest.mark.parametrize("sigma", [0.01, 0.5])
def test_float32_at_grazing_angles(sigma):
    generator = torch.Generator().manual_seed(11)
    theta = math.radians(89.9) * torch.rand(2, 2000, generator=generator, dtype=DOUBLE) ** 0.2
    azimuth = math.pi * torch.rand(2000, generator=generator, dtype=DOUBLE)
    azimuth[::2] = math.pi
    zero = torch.zeros_like(azimuth)
    light = torch.stack((theta[0].sin(), zero, theta[0].cos()), -1).float()
    view = torch.stack((theta[1].sin() * azimuth.cos(), theta[1].sin() * azimuth.sin(), theta[1].cos()), -1).float()
    model = RoughSurface(albedo=0.9, sigma=sigma, bounces="all")
    value = model(UP.float(), light, view, normalize=True)
    exact = model.double()(UP, light.double(), view.double(), normalize=True)
    assert (value >= 0).all()
    torch.testing.assert_close(value.double(), exact, rtol=1e-2, atol=0)
