"""What the text of the paper says of its figures, asked of the exact model."""

import math

import pytest
import torch

from torchbrdf import Cosines, RoughSurface, fixed, sigma_from_degrees

DOUBLE = torch.float64


def radiance(sigma, rho, theta_i, theta_r, *, dphi=0.0, bounces=2):
    """Radiance for irradiance 1; angles in degrees, theta_r positive on the light's side."""
    model = RoughSurface(
        albedo=fixed(torch.tensor(rho, dtype=DOUBLE)),
        sigma=fixed(sigma_from_degrees(torch.tensor(sigma, dtype=DOUBLE))),
        nodes=48,
        order=8,
        bounces=bounces,
    )
    r, t, d = torch.deg2rad(torch.as_tensor(theta_r, dtype=DOUBLE)), math.radians(theta_i), math.radians(dphi)
    phase = math.cos(t) * r.cos() + math.sin(t) * r.sin() * math.cos(d)
    return math.cos(t) * model.evaluate(Cosines.from_products(torch.full_like(r, math.cos(t)), r.cos(), phase))[..., 0]


def test_landmarks_of_figure_8():
    found = radiance(30.0, 0.9, 75, [0.0, 75.0, 88.0, -75.0])
    for value, landmark in zip(found.tolist(), (0.0647, 0.1516, 0.155, 0.032), strict=True):
        assert value == pytest.approx(landmark, abs=0.6 * 10 ** -len(str(landmark).split(".")[1]))


def test_interreflection_is_about_half_of_the_forward_radiance():
    share = 1 - radiance(30.0, 0.9, 75, [-75.0], bounces=1) / radiance(30.0, 0.9, 75, [-75.0])
    assert share.item() == pytest.approx(0.47, abs=0.005)


@pytest.mark.parametrize("sigma", [10.0, 20.0, 40.0])
@pytest.mark.parametrize("theta_i", [60, 75])
def test_cut_off_sits_at_the_light_whatever_the_roughness(sigma, theta_i):
    step = 0.25
    angles = torch.arange(theta_i - 8, theta_i + 8, step, dtype=DOUBLE)
    slope_change = radiance(sigma, 0.9, theta_i, angles, bounces=1).diff().diff()
    kink = angles[1 + slope_change.argmin()].item()
    assert kink == pytest.approx(theta_i, abs=1.01 * step)
    # a kink, not a bend: as large in half the step, where a bend would be half as large
    at = torch.tensor([theta_i - 0.01, theta_i, theta_i + 0.01], dtype=DOUBLE)
    nearby = at + 2.0
    per_degree = [(radiance(sigma, 0.9, theta_i, x, bounces=1).diff() / 0.01).diff().item() for x in (at, nearby)]
    assert abs(per_degree[0]) > 20 * abs(per_degree[1])


def test_maximum_is_backwards_and_the_middle_is_linear_in_the_tangent():
    angles = torch.linspace(-85, 85, 341, dtype=DOUBLE)
    curve = radiance(30.0, 0.9, 75, angles)
    assert angles[curve.argmax()] >= 75
    # the direct part between the angles at which nothing is cut is linear in tan(theta_r) (5a)
    middle = torch.linspace(-5, 5, 11, dtype=DOUBLE)
    values, x = radiance(30.0, 0.9, 75, middle, bounces=1), torch.deg2rad(middle).tan()
    line = torch.linalg.lstsq(torch.stack((x, torch.ones_like(x)), -1), values[:, None])
    residual = values - torch.stack((x, torch.ones_like(x)), -1) @ line.solution[:, 0]
    assert residual.abs().max() < 1e-3 * values.mean()


def test_smooth_is_lambert_and_deviation_grows_with_roughness():
    angles = torch.linspace(-85, 85, 69, dtype=DOUBLE)
    lambert = 0.9 / math.pi * math.cos(math.radians(75))
    deviations = [(radiance(s, 0.9, 75, angles) - lambert).abs().max().item() for s in (0.0, 10.0, 20.0, 40.0)]
    assert deviations[0] < 1e-15
    assert deviations == sorted(deviations)


def test_light_along_the_normal_is_nearly_lambertian():
    angles = torch.linspace(0, 75, 31, dtype=DOUBLE)
    values = radiance(40.0, 0.9, 0, angles)
    assert (values / values[0] - 1).abs().max() < 0.04
    backscatter = [radiance(40.0, 0.9, t, [t]) / radiance(40.0, 0.9, t, [0.0]) for t in (0.0, 30.0, 60.0, 75.0)]
    assert backscatter == sorted(backscatter)


def test_across_the_plane_of_incidence_is_nearly_lambertian():
    angles = torch.linspace(0, 60, 31, dtype=DOUBLE)
    across = radiance(40.0, 0.9, 75, angles, dphi=90)
    along = radiance(40.0, 0.9, 75, angles)
    assert (across / across[0] - 1).abs().max() < 0.15
    assert along[-1] / along[0] > 1.6
