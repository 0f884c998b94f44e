"""Slopes of another width along and across: isotropic where they agree, and what they ask for."""

import math

import pytest
import torch
from helpers.planes import UP, f64, unit

from torchbrdf import AnisotropicRoughSurface, UnidirectionalVCavities, fixed
from torchbrdf.models.oren_nayar.converged import converged
from torchbrdf.models.oren_nayar.slope_plane import slope_plane_from_angles


def test_anisotropic_becomes_isotropic():
    sigma = f64(0.4)[0]
    surface = AnisotropicRoughSurface(albedo=fixed(f64(1.0)[0]), sigma_x=sigma, sigma_y=sigma, nodes=32, azimuths=48)
    found = surface.components(UP, unit(1.0, 0.4), unit(0.7, 2.4), tangent=unit(1.2, 0.3))
    expected = converged(slope_plane_from_angles(*f64(1.0, 0.7, 2.0)), sigma)
    torch.testing.assert_close(torch.cat(list(found.values())), torch.stack(expected[:2]), rtol=2e-3, atol=0)


def test_anisotropic_is_smooth_along_long_grooves():
    """Rough across the tangent only: light and view along the tangent meet what grooves across it show."""
    surface = AnisotropicRoughSurface(albedo=f64(0.5)[0], sigma_x=f64(0.06)[0], sigma_y=f64(0.8)[0])
    turned = AnisotropicRoughSurface(albedo=f64(0.5)[0], sigma_x=f64(0.8)[0], sigma_y=f64(0.06)[0])
    light, view = unit(1.0, 0.3), unit(0.8, 1.9)
    torch.testing.assert_close(
        surface(UP, light, view, tangent=unit(math.pi / 2, 0.0)),
        turned(UP, light, view, tangent=unit(math.pi / 2, math.pi / 2)),
    )


@pytest.mark.parametrize("model", [UnidirectionalVCavities(), AnisotropicRoughSurface(nodes=2, azimuths=2)])
def test_anisotropic_models_ask_for_a_tangent(model):
    with pytest.raises(ValueError, match="needs a tangent"):
        model(UP, UP, UP)
    with pytest.raises(ValueError, match="tangent must not be parallel to the normal"):
        model(UP, UP, UP, tangent=2 * UP)
    with pytest.raises(ValueError, match=r"tangent must have shape \(..., 3\)"):
        model(UP, UP, UP, tangent=UP[:2])
