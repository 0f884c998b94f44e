"""Lamps near and far, large and small, against the radiometry of the course notes and brute force."""

import json
import math
from pathlib import Path

import pytest
import torch
from helpers.surfaces import towards

from inverse import (
    Ambient,
    Disc,
    Distant,
    Environment,
    Group,
    Plane,
    Point,
    Scene,
    Sphere,
    from_normals,
    irradiance,
    plane,
    render,
    sphere,
    vase,
)
from inverse.scene.footprints import Footprints
from inverse.transport.rendering import radiance_of
from torchbrdf import Lambert, OrenNayar

D = torch.float64
GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "other_models.json").read_text())["radiometry"]
UP = torch.tensor([0.0, 0.0, 1.0], dtype=D)


def first_arrival(light, surface):
    return next(light.arrivals(surface.points[surface.mask]))


def vector(*values):
    return torch.tensor(values, dtype=D)


def number(value):
    return torch.tensor(value, dtype=D)


def rough():
    return OrenNayar(albedo=torch.tensor([0.7, 0.4, 0.2], dtype=D), sigma=number(0.5))


def lambert(albedo):
    return Lambert(albedo=number(albedo))


@pytest.fixture
def spot():
    """A plane of one pixel, at the origin, facing the camera."""
    return plane(1, 1, dtype=D)


def test_cone_of_light(spot):
    """A disc overhead gives pi L sin^2(a): the irradiance it is made from; tilted, the cosine times that."""
    radiant = GOLDEN["eq31 cone half-angle 0.4 L=2 lambert rho=.6"]
    light = Disc(UP, 0.4, 2 * math.pi * math.sin(0.4) ** 2)
    assert light.radiance.item() == pytest.approx(2, rel=1e-14)
    assert radiance_of(Footprints.of(spot), (light,))(lambert(0.6)).item() == pytest.approx(radiant, rel=1e-13)
    tilted = plane(1, 1, normal=(math.sin(0.5), 0, math.cos(0.5)), dtype=D)
    assert irradiance(tilted, (light,)).item() == pytest.approx(float(light.irradiance) * math.cos(0.5), rel=1e-13)


def test_uniform_light(spot):
    wanted = GOLDEN["eq31 uniform L=2 lambert rho=.6"]
    assert radiance_of(Footprints.of(spot), (Ambient(2.0),))(lambert(0.6)).item() == pytest.approx(wanted, rel=1e-6)
    everywhere = Environment(torch.full((64, 128, 1), 2.0, dtype=D))
    assert radiance_of(Footprints.of(spot), (everywhere,))(lambert(0.6)).item() == pytest.approx(wanted, rel=2e-3)
    assert irradiance(spot, (Ambient(2.0),)).item() == pytest.approx(2 * math.pi)


def test_a_far_point_is_a_distant_light():
    surface, direction = sphere(16, 16, dtype=D), vector(0.36, 0.48, 0.8)
    near, far = (Point(direction * r, r * r * 2.0) for r in (3.0, 1e5))
    wanted = render(Scene(surface, [Distant(direction, 2.0)]), rough())
    torch.testing.assert_close(render(Scene(surface, [far]), rough()), wanted, rtol=1e-3, atol=1e-5)
    assert (render(Scene(surface, [near]), rough()) - wanted).abs().max() > 0.05


def test_disc_is_the_integral_over_its_cone():
    """Against a midpoint rule on the sphere of directions; the second plane's horizon cuts the disc."""
    light = Disc(vector(0.6, 0, 0.8), 0.5, 1.0, rings=12)
    z = 1 - (torch.arange(400, dtype=D)[:, None] + 0.5) / 400
    azimuth = (torch.arange(800, dtype=D) + 0.5) * (2 * math.pi / 800)
    sine = (1 - z * z).sqrt()
    directions = torch.stack((sine * azimuth.cos(), sine * azimuth.sin(), z.expand(400, 800)), -1)
    inside = (directions @ light.direction) > math.cos(0.5)
    for tilt, tolerance in ((0.0, 2e-3), (-1.1, 2e-2)):
        surface = plane(1, 1, normal=(math.sin(tilt), 0, math.cos(tilt)), dtype=D)
        normal = surface.normals[0, 0]
        values = rough()(normal, directions, UP) * (directions @ normal).clamp(min=0)[..., None]
        wanted = (values * inside[..., None]).sum((0, 1)) * light.radiance * (2 * math.pi / 320000)
        torch.testing.assert_close(
            radiance_of(Footprints.of(surface), (light,))(rough())[0], wanted, rtol=tolerance, atol=0
        )


def test_environment_directions():
    """Up is the first row; the middle looks along -z, to its right is +x, the edges look along +z."""
    directions = Environment(torch.ones(90, 180, 1)).directions()
    for texel, wanted in (((0, 7), (0, 1, 0)), ((45, 90), (0, 0, -1)), ((45, 135), (1, 0, 0)), ((45, 0), (0, 0, 1))):
        assert torch.dot(directions[texel], vector(*wanted)) > math.cos(math.radians(3))


def test_environment_sees_its_own_texels():
    image = torch.rand(8, 12, 3, dtype=D)
    light = Environment(image)
    torch.testing.assert_close(light.seen(light.directions()), image)


def test_environment_of_one_bright_texel_is_a_distant_light():
    image = torch.zeros(32, 64, 3, dtype=D)
    image[10, 5] = vector(3.0, 2.0, 1.0)
    light, surface = Environment(image), sphere(12, 12, dtype=D)
    distant = Distant(light.directions()[10, 5], image[10, 5] * light.solid_angles()[10])
    torch.testing.assert_close(*(render(Scene(surface, [k]), rough()) for k in (light, distant)), rtol=1e-12, atol=0)


def test_reduced_environment_keeps_the_flux():
    light = Environment(torch.rand(12, 24, 3, dtype=D))
    total = [(k.radiance * k.solid_angles()[:, None, None]).sum((0, 1)) for k in (light, light.reduced(3))]
    torch.testing.assert_close(*total, rtol=1e-12, atol=0)
    assert light.reduced(3).radiance.shape == (3, 6, 3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Point(vector(0, 0)), r"Point\.position must be a finite vector \(3,\)"),
        (lambda: Point(UP, -1.0), r"Point\.intensity must be finite and not negative; found -1"),
        (lambda: Disc(UP, 0.0), r"Disc\.half_angle must lie in \(0, pi/2\] rad; found 0"),
        (lambda: Disc(UP, 0.1, rings=0), r"Disc\.rings must be a whole number"),
        (lambda: Environment(torch.ones(3, 4)), r"Environment\.radiance must be floating-point of shape"),
        (lambda: Environment(-torch.ones(3, 4, 1)), r"Environment\.radiance must be finite and not negative"),
        (lambda: Environment(torch.ones(6, 4, 1)).reduced(4), "rows must divide the map's 6 rows; found 4"),
        (
            lambda: first_arrival(Point(UP), from_normals(UP.expand(2, 2, 3))),
            "known positions away from the lamp",
        ),
        (
            lambda: first_arrival(Point(0 * UP), plane(1, 1, dtype=D)),
            "surface point at the lamp's position",
        ),
    ],
)
def test_bad_lights(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_reasons_for_no_shadow():
    solid = vase(8, 8).solid
    level, raised = Distant.from_angle(20), Distant(towards(20, 40))
    assert "convex" in raised.why_shadowless(Sphere()).reason
    assert "disc" in level.why_shadowless(solid).reason
    assert "unknown" in raised.why_shadowless(None).reason
    assert "sky_share" in Ambient().why_shadowless(solid).reason
    for light in (raised, Point(torch.tensor([2.0, 0, 2])), Disc(towards(20, 0), 0.1)):
        assert light.why_shadowless(solid) is None
    assert level.why_shadowless(Group((Sphere(), Plane(point=(0, 0, -2))))) is None


def test_angles_count_to_the_right_of_the_camera():
    for degrees in (-70, 0, 20, 90):
        x, y, z = Distant.from_angle(degrees).direction.tolist()
        assert (x, y, z) == pytest.approx((math.sin(math.radians(degrees)), 0, math.cos(math.radians(degrees))))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Distant(torch.zeros(3)), r"Distant\.direction must be a vector \(3,\) other than 0"),
        (lambda: Distant(torch.tensor([0.0, math.nan, 1.0])), r"Distant\.direction"),
        (lambda: Distant(torch.ones(2)), r"Distant\.direction"),
        (lambda: Distant.from_angle(0, -1.0), r"Distant\.irradiance must be finite and not negative; found -1\.0"),
        (lambda: Ambient(-0.5), r"Ambient\.radiance must be finite and not negative; found -0\.5"),
    ],
)
def test_bad_distant_and_ambient_lights(make, message):
    with pytest.raises(ValueError, match=message):
        make()
