"""The heightfield of two widths: its isotropic case, a dense grid, and the stretch it is made of."""

import math

import numpy as np
import pytest
import torch
from helpers.heightfields import F64, UNCORRELATED, f64, held, rotation, vectors
from torch.testing import assert_close

from torchbrdf import (
    SMOOTH_HEIGHTFIELD,
    AnisotropicGaussianHeightfield,
    Cosines,
    GaussianHeightfield,
    anisotropic_gaussian_heightfield,
    any_tangent,
    rms_slope_from_sigma,
    sigma_from_rms_slope,
)
from torchbrdf.models.heightfield.visibility import facet_masking, independence, joint_masking, ray
from torchbrdf.testing import random_directions


@pytest.mark.parametrize("sigma", [0.1, 0.5, 1.2])
def test_equal_widths_are_the_isotropic_surface(sigma):
    normal, light, view = random_directions(400, dtype=F64, max_angle=1.55, generator=torch.Generator().manual_seed(0))
    wide = AnisotropicGaussianHeightfield(albedo=held(0.8), sigma_x=held(sigma), sigma_y=held(sigma))
    round_ = GaussianHeightfield(albedo=held(0.8), sigma=held(sigma), bounces=1)
    for turn in (0.0, 0.7):
        tangent = any_tangent(normal) * math.cos(turn) + torch.linalg.cross(normal, any_tangent(normal)) * math.sin(
            turn
        )
        assert_close(wide(normal, light, view, tangent=tangent), round_(normal, light, view), rtol=1e-9, atol=1e-12)


def test_turning_everything_changes_nothing():
    generator = torch.Generator().manual_seed(1)
    normal, light, view = random_directions(100, dtype=F64, generator=generator)
    tangent, turn = any_tangent(normal), rotation(generator)
    brdf = AnisotropicGaussianHeightfield(albedo=held(0.8), sigma_x=held(0.2), sigma_y=held(0.8))
    f = brdf(normal, light, view, tangent=tangent)
    turned = brdf(*(v @ turn.T for v in (normal, light, view)), tangent=tangent @ turn.T, normalize=True)
    assert_close(turned, f, rtol=1e-9, atol=1e-13)
    assert_close(brdf(normal, light, view, tangent=-tangent), f, rtol=1e-12, atol=0)
    other = AnisotropicGaussianHeightfield(albedo=held(0.8), sigma_x=held(0.8), sigma_y=held(0.2))
    assert_close(other(normal, light, view, tangent=torch.linalg.cross(normal, tangent)), f, rtol=1e-9, atol=1e-13)


def smith_masking(t):
    nu = 1 / (math.sqrt(2) * t)
    return (math.exp(-nu * nu) / (nu * math.sqrt(math.pi)) - math.erfc(nu)) / 2


def direction(theta, phi):
    return f64([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def whole(light, view, slopes, occlusion, constants):
    x, _, z = torch.eye(3, dtype=F64)
    sigma_x, sigma_y = (sigma_from_rms_slope(f64(value)) for value in slopes)
    return anisotropic_gaussian_heightfield(
        Cosines.of(z, direction(*light), direction(*view), tangent=x, normalize=True),
        albedo=f64(1.0),
        sigma_x=sigma_x,
        sigma_y=sigma_y,
        occlusion=f64(occlusion),
        nodes=560,
        constants=constants,
    ).item()


@pytest.mark.parametrize(
    ("light", "view"), [((1.1, 0.4), (0.8, 2.9)), ((0.5, -1.0), (1.35, 0.3)), ((1.2, 1.5), (1.2, -1.5))]
)
def test_smith_by_a_dense_grid(light, view):
    # polar angle and azimuth of light and view from the tangent; slopes of two widths, heights correlated as Smith's
    s = np.array([0.25, 0.8])
    p = [math.tan(theta) * np.array([math.cos(phi), math.sin(phi)]) for theta, phi in (light, view)]
    xi = np.linspace(-7, 7, 4001)
    ux, uy = s[0] * xi[:, None], s[1] * xi[None, :]
    facing = [np.maximum(1 + ux * q[0] + uy * q[1], 0) for q in p]
    mass = np.exp(-(xi[:, None] ** 2 + xi[None, :] ** 2) / 2) / np.sqrt(1 + ux**2 + uy**2)
    mean = (mass * facing[0] * facing[1]).sum() * (xi[1] - xi[0]) ** 2 / (2 * math.pi)
    expected = mean / math.pi / (1 + sum(smith_masking(float(np.hypot(*(s * q)))) for q in p))

    assert whole(light, view, s, 0.0, UNCORRELATED) == pytest.approx(expected, rel=2e-5)


def test_azimuths_are_those_of_the_stretched_plane():
    # facet by facet on a grid; light and view at 0.3 of azimuth, which the stretch opens to 1.2
    light, view, slopes = (1.25, 0.15), (1.15, -0.15), (0.15, 0.9)
    p = [
        math.tan(theta) * torch.tensor([slopes[0] * math.cos(phi), slopes[1] * math.sin(phi)], dtype=F64)
        for theta, phi in (light, view)
    ]
    xi = torch.linspace(-6, 6, 1201, dtype=F64)
    x, y = xi[:, None], xi[None, :]
    rays = [ray(q.norm(), f64(1.0), SMOOTH_HEIGHTFIELD) for q in p]
    facing = [(1 + x * q[0] + y * q[1]).relu() for q in p]
    masks = [facet_masking(r.steepness * g, r) for r, g in zip(rays, facing, strict=True)]
    angle = math.acos(float(p[0] @ p[1] / (p[0].norm() * p[1].norm())))
    assert angle > 1.1
    apart = independence(rays[0], rays[1], f64(math.sin(angle / 2)), SMOOTH_HEIGHTFIELD)
    mass = torch.exp(-(x * x + y * y) / 2) / (1 + (slopes[0] * x) ** 2 + (slopes[1] * y) ** 2).sqrt()
    mean = (mass * facing[0] * facing[1] / (1 + joint_masking(*masks, apart))).sum() * (xi[1] - xi[0]) ** 2
    expected = mean.item() / (2 * math.pi) / math.pi
    assert whole(light, view, slopes, 1.0, SMOOTH_HEIGHTFIELD) == pytest.approx(expected, rel=2e-4)


def test_visibility_is_that_of_the_stretched_directions():
    # Facets whose tilt is the same seen either way differ by visibility alone. In the plane of the tangent a narrow
    # s_y leaves a surface of grooves, its directions those of an isotropic surface of s_x.
    normal, light, view = vectors(1.2, 1.0, f64([0.0, math.pi]))
    x = f64([1.0, 0.0, 0.0]).expand_as(normal)
    narrow = AnisotropicGaussianHeightfield(albedo=held(1.0), sigma_x=held(0.6), sigma_y=held(0.0))
    f = narrow(normal, light, view, tangent=x, normalize=True)[:, 0]
    assert (f > 0).all()
    # one-dimensional integral of the same facets: E[cos_a X+ Y+/(1 + D)] with D of the isotropic visibility
    s = rms_slope_from_sigma(f64(0.6)).item()
    grid = torch.linspace(-8, 8, 400_001, dtype=F64)
    mass = torch.exp(-grid * grid / 2) / math.sqrt(2 * math.pi) * (grid[1] - grid[0]) / (1 + s * s * grid * grid).sqrt()
    rays = [ray(f64(s * math.tan(a)), f64(1.0), SMOOTH_HEIGHTFIELD) for a in (1.2, 1.0)]
    for k, sign in enumerate((1.0, -1.0)):
        facing = [(1 + r.tangent * c * grid).relu() for r, c in zip(rays, (1.0, sign), strict=True)]
        masks = [facet_masking(r.steepness * g, r) for r, g in zip(rays, facing, strict=True)]
        apart = independence(*rays, f64(0.0 if sign > 0 else 1.0), SMOOTH_HEIGHTFIELD)
        expected = (mass * facing[0] * facing[1] / (1 + joint_masking(*masks, apart))).sum() / math.pi
        assert f[k].item() == pytest.approx(expected.item(), rel=3e-4)


def test_rms_slopes_are_another_name():
    brdf = AnisotropicGaussianHeightfield.from_rms_slopes(0.1807, 0.67, albedo=0.5)
    assert brdf.sigma_x.item() == pytest.approx(math.radians(10), rel=3e-4)
    assert brdf.sigma_y.item() == pytest.approx(math.radians(30), rel=3e-4)


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"from_rms_slopes: rms_slope_y must lie in \[0, 1\.482\]"):
        AnisotropicGaussianHeightfield.from_rms_slopes(0.2, 1.6)
    with pytest.raises(ValueError, match="AnisotropicGaussianHeightfield: nodes must be one of"):
        AnisotropicGaussianHeightfield(nodes=100)
    with pytest.raises(ValueError, match="AnisotropicGaussianHeightfield is anisotropic and needs a tangent"):
        AnisotropicGaussianHeightfield()(*random_directions(3))
