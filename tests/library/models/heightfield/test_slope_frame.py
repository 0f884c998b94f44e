"""Light and view as points of the slope plane: against angles, in random frames, next to where angles end."""

import math

import pytest
import torch
from helpers.heightfields import F64, f64, held, rotation, vectors
from torch.nn.functional import normalize
from torch.testing import assert_close

from torchbrdf import AnisotropicGaussianHeightfield, Cosines, FastGaussianHeightfield, GaussianHeightfield
from torchbrdf.models.heightfield.slope_frame import anisotropic_slope_frame, slope_frame, tangents

COUNT = 200


def angles(seed):
    """Polar angles up to 85 deg and azimuth differences up to 180 deg, down to 1e-6 rad."""
    generator = torch.Generator().manual_seed(seed)
    draws = torch.rand(3, COUNT, dtype=F64, generator=generator)
    small = 10 ** (-6 * torch.rand(3, COUNT, dtype=F64, generator=generator))
    theta_i, theta_r, dphi = draws * small * f64([[1.48], [1.48], [math.pi]])
    return theta_i, theta_r, dphi, rotation(generator)


@pytest.mark.parametrize("seed", [0, 1])
def test_fields_are_those_of_the_angles(seed):
    theta_i, theta_r, dphi, turn = angles(seed)
    slope = f64(0.7)
    # An error of 1e-16 in a vector's components is one of 1e-16 in an angle.
    rounding = 1e-15 / torch.minimum(theta_i, theta_r)
    c = Cosines.of(*vectors(theta_i, theta_r, dphi, turn), normalize=True)
    frame = slope_frame(c, slope)
    high, low = 0.7 * torch.maximum(theta_i, theta_r).tan(), 0.7 * torch.minimum(theta_i, theta_r).tan()
    assert ((frame.grazing / high - 1).abs() < 30 * rounding).all()
    assert ((frame.other / low - 1).abs() < 30 * rounding).all()
    assert ((frame.other_along / low - dphi.cos()).abs() < 30 * rounding).all()
    assert ((frame.other_across / low - dphi.sin()).abs() < 30 * rounding).all()
    assert ((frame.half_turn - (dphi / 2).sin()).abs() < 30 * rounding).all()
    for got, theta in zip(tangents(c), (theta_i, theta_r), strict=True):
        assert ((got / theta.tan() - 1).abs() < 30 * rounding).all()


def test_cosines_alone_say_the_same_with_half_the_digits():
    theta_i, theta_r, dphi, turn = angles(2)
    of_vectors = Cosines.of(*vectors(theta_i, theta_r, dphi, turn), normalize=True)
    known = torch.minimum(theta_i, theta_r) > 1e-2
    of_cosines = Cosines.from_products(of_vectors.light, of_vectors.view, of_vectors.phase)
    for one, other in zip(slope_frame(of_vectors, f64(0.7)), slope_frame(of_cosines, f64(0.7)), strict=True):
        if one.ndim:
            assert_close(one[known], other[known], rtol=1e-6, atol=1e-6)
    for one, other in zip(tangents(of_vectors), tangents(of_cosines), strict=True):
        assert_close(one, other, rtol=1e-6, atol=1e-7)


def test_stretched_fields_are_those_of_the_stretched_points():
    theta_i, theta_r, dphi, turn = angles(3)
    s = f64([0.3, 0.8])
    normal, light, view = vectors(theta_i, theta_r, dphi)
    around = f64([[math.cos(0.9), -math.sin(0.9), 0.0], [math.sin(0.9), math.cos(0.9), 0.0], [0.0, 0.0, 1.0]])
    light, view = light @ around.T, view @ around.T
    p, q = (s * v[:, :2] / v[:, 2:] for v in (light, view))
    swap = (q.norm(dim=-1) > p.norm(dim=-1))[:, None]
    a, b = torch.where(swap, q, p), torch.where(swap, p, q)
    tangent = f64([1.0, 0.0, 0.0])
    turned = [v @ turn.T for v in (normal, light, view, tangent)]
    frame = anisotropic_slope_frame(Cosines.of(*turned[:3], tangent=turned[3], normalize=True), s[0], s[1])
    # a and b again from the frame, up to which side the second axis points to
    size, error = b.norm(dim=-1), 1e-14 / torch.minimum(theta_i, theta_r)
    e = a / a.norm(dim=-1, keepdim=True)
    across = (e[:, 0] * b[:, 1] - e[:, 1] * b[:, 0]).abs()
    assert ((frame.grazing - a.norm(dim=-1)).abs() < error * a.norm(dim=-1)).all()
    assert ((frame.other - size).abs() < error * size).all()
    assert ((frame.other_along - (b * e).sum(-1)).abs() < error * size).all()
    assert ((frame.other_across - across).abs() < error * size).all()
    chord = (a / a.norm(dim=-1, keepdim=True) - b / b.norm(dim=-1, keepdim=True)).norm(dim=-1)
    assert ((frame.half_turn - chord / 2).abs() < error).all()
    # the squared steepness of a facet is a quadratic form with the squared widths as eigenvalues, s_e^2 along e
    assert_close(frame.along, (s * s * e * e).sum(-1), rtol=1e-12, atol=1e-8)
    assert_close(frame.along + frame.across, (s * s).sum().expand(COUNT), rtol=1e-12, atol=0)
    determinant = frame.along * frame.across - frame.mixed**2
    assert_close(determinant, (s * s).prod().expand(COUNT), rtol=1e-12, atol=0)


def test_a_mirrored_view_is_on_the_other_side_of_the_widths():
    # the sign of the mixed term: a facet at (x, y) of the frame is as steep as the point of the plane it stands for
    s = f64([0.3, 0.8])
    light, view = normalize(f64([0.9, 0.2, 0.5]), dim=0), f64([[0.1, 0.4, 0.8], [0.3, -0.4, 0.8]])
    c = Cosines.of(f64([0.0, 0.0, 1.0]), light, view, tangent=f64([1.0, 0.0, 0.0]), normalize=True)
    frame = anisotropic_slope_frame(c, s[0], s[1])
    e = s * light[:2] / light[2]
    e = e / e.norm()
    b = s * view[:, :2] / view[:, 2:]
    second = torch.stack((-e[1], e[0])) * (e[0] * b[:, 1] - e[1] * b[:, 0]).sign()[:, None]
    x, y = 0.7, 1.3
    point = s * (x * e + y * second)
    got = frame.along * x * x + 2 * frame.mixed * x * y + frame.across * y * y
    assert_close(got, (point * point).sum(-1), rtol=1e-12, atol=0)


MODELS = {
    "direct": lambda dtype: GaussianHeightfield(albedo=0.8, sigma=held(0.6), bounces=1),
    "bounces": lambda dtype: GaussianHeightfield(albedo=0.8, sigma=held(0.6), polar_nodes=6, table_orders=3),
    "fast": lambda dtype: FastGaussianHeightfield(albedo=0.8, sigma=held(0.6)),
}


@pytest.mark.parametrize("name", MODELS)
def test_float32_derivatives_by_the_directions(name):
    # against float64 in the same directions, the normal included: light there, view there, both, and next to it
    theta_i = f64([0, 0.8, 0, 1e-3, 1e-4, 0.7, 1.3, 0.5, 1.0])
    theta_r = f64([0.8, 0, 0, 0.8, 0.0, 0.7, 1.3, 1.1, 1.0])
    dphi = f64([0, 0, 0, 0.7, 0, math.pi, math.pi, 0, 1.2])
    turn = rotation(torch.Generator().manual_seed(4))
    rounded = [v.float() for v in vectors(theta_i, theta_r, dphi, turn)]

    def gradients(dtype):
        brdf = MODELS[name](dtype).to(dtype)
        directions = [v.to(dtype).requires_grad_() for v in rounded]
        f = brdf(*directions, normalize=True)
        return f.detach(), torch.stack(torch.autograd.grad(f.sum(), directions))

    f, expected = gradients(F64)
    single, got = gradients(torch.float32)
    assert_close(single.double(), f, rtol=2e-5, atol=0)
    scale = expected.norm(dim=-1).amax(0).maximum(f[:, 0])
    assert ((got - expected).norm(dim=-1) / scale < 2e-3).all()


def test_float32_derivatives_of_two_widths():
    turn = rotation(torch.Generator().manual_seed(5))
    rounded = [v.float() for v in vectors(f64([0, 0.8, 0, 1.3]), f64([0.8, 0, 0, 0.4]), f64([0, 0, 0, 2.0]), turn)]
    tangent = turn[:, 0].float()

    def gradients(dtype):
        brdf = AnisotropicGaussianHeightfield(albedo=0.8, sigma_x=held(0.3), sigma_y=held(0.7)).to(dtype)
        directions = [v.to(dtype).requires_grad_() for v in rounded]
        f = brdf(*directions, tangent=tangent.to(dtype), normalize=True)
        return torch.stack(torch.autograd.grad(f.sum(), directions))

    expected, got = gradients(F64), gradients(torch.float32)
    assert ((got - expected).norm(dim=-1) < 2e-3 * expected.norm(dim=-1).amax(0).clamp(min=0.1)).all()
