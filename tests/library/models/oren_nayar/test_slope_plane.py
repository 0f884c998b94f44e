"""Light and view as points of the slope plane: all fields of one piece, whatever the frame."""

import math

import pytest
import torch
from torch.testing import assert_close

from torchbrdf import SingleSlopeVCavities, fixed
from torchbrdf.directions import Cosines
from torchbrdf.models.oren_nayar.slope_plane import slope_plane, slope_plane_from_angles
from torchbrdf.testing import random_directions

# polar angles of light and view, azimuth between them [deg]
ANGLES = [(1e-6, 40, 70), (0, 40, 70), (40, 40, 0), (40, 40, 180), (80, 30, 1e-6), (89.9, 89, 179.999), (70, 20, 90)]


def vectors(theta_light, theta_view, azimuth, frame):
    def polar(theta, phi):
        return torch.stack((theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())).to(frame)

    zero = torch.zeros((), dtype=torch.float64)
    upright = (polar(zero, zero), polar(theta_light, zero), polar(theta_view, azimuth))
    return [frame @ v for v in upright]


@pytest.mark.parametrize("angles", ANGLES)
def test_vectors_and_angles_give_the_same_plane(angles):
    generator = torch.Generator().manual_seed(1)
    theta_light, theta_view, azimuth = torch.deg2rad(torch.tensor(angles, dtype=torch.float64))
    larger, smaller = torch.maximum(theta_light, theta_view), torch.minimum(theta_light, theta_view)
    expected = slope_plane_from_angles(larger, smaller, azimuth)
    for _ in range(5):
        frame = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64, generator=generator))[0]
        plane = slope_plane(Cosines.of(*vectors(theta_light, theta_view, azimuth, frame), normalize=True))
        # A tangent near 90 degrees multiplies the rounding of a vector by its square.
        scale = 1 + float(expected.tan_light) ** 2
        for name in ("tan_light", "tan_view", "dot", "apart", "opposed"):
            assert_close(getattr(plane, name), getattr(expected, name), rtol=0, atol=4e-14 * scale)
        if smaller > 0:
            assert_close(plane.delta, expected.delta, rtol=0, atol=4e-14 * scale / float(expected.tan_view))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_fields_agree_with_each_other_to_rounding(dtype):
    # also where light or view is the normal but for rounding, and where both are one: |p|^2 |q|^2 = (p.q)^2 + |p x q|^2
    normal, light, view = random_directions(500, dtype=dtype, generator=torch.Generator().manual_seed(2))
    mirrored = 2 * (normal * light).sum(-1, keepdim=True) * normal - light
    for s, v in ((light, view), (normal, view), (light, light), (light, mirrored), (view, normal), (normal, normal)):
        plane = slope_plane(Cosines.of(normal, s, v, normalize=True))
        product = plane.tan_light * plane.tan_view
        eps = torch.finfo(dtype).eps
        assert (((product * plane.delta.cos() - plane.dot).abs()) <= 16 * eps * product).all()
        squares = plane.tan_light**2 + plane.tan_view**2
        assert ((plane.apart**2 - (squares - 2 * plane.dot)).abs() <= 64 * eps * squares).all()
        assert ((plane.opposed**2 - (squares + 2 * plane.dot)).abs() <= 64 * eps * squares).all()


def test_without_vectors_the_cosines_give_the_same_plane():
    cosines = Cosines.of(*random_directions(500, dtype=torch.float64, generator=torch.Generator().manual_seed(3)))
    alone = slope_plane(Cosines.from_products(cosines.light, cosines.view, cosines.phase))
    plane = slope_plane(cosines)
    for name in ("tan_light", "tan_view", "dot", "apart", "opposed"):
        assert_close(getattr(alone, name), getattr(plane, name), rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("offset", [0.0, 1e-7, 1e-3], ids=lambda x: f"{x:g} rad")
@pytest.mark.parametrize(("dtype", "rtol"), [(torch.float32, 1e-5), (torch.float64, 1e-12)], ids=str)
def test_gradient_by_the_light_next_to_the_normal(dtype, rtol, offset):
    # No facet is shadowed or masked here, so that f = (rho/pi) cos(theta_a) (1 + tan^2(theta_a) p.q / 2) exactly, and
    # the gradient by the light along the surface is (rho/pi) sin(theta_a) tan(theta_a) q / (2 (n.l)).
    slope, rho = 0.8, 0.7
    brdf = SingleSlopeVCavities(
        albedo=fixed(torch.tensor([rho], dtype=dtype)), slope=fixed(torch.tensor(slope, dtype=dtype)), bounces=1
    )
    generator = torch.Generator().manual_seed(4)
    normal, _, view = random_directions(200, dtype=dtype, max_angle=0.7, generator=generator)
    aside = torch.linalg.cross(normal, torch.randn(200, 3, dtype=dtype, generator=generator))
    light = torch.nn.functional.normalize(normal + offset * torch.nn.functional.normalize(aside, dim=-1), dim=-1)
    light.requires_grad_()
    (gradient,) = torch.autograd.grad(brdf(normal, light, view, normalize=True).sum(), light)
    n, v = normal.double(), view.double()
    cosine = (n * v).sum(-1, keepdim=True)
    expected = rho / math.pi * math.sin(slope) * math.tan(slope) / 2 * (v - cosine * n) / cosine
    # 1 / (n.l) and the turn of the tangent plane of the light are of the order of the offset
    assert (gradient - expected).abs().max() <= rtol + offset
