"""Lamps near and far, large and small, against the radiometry of the course notes and brute force."""

import json
import math
from pathlib import Path

import pytest
import torch

from inverse import (
    Ambient,
    Disc,
    Distant,
    Environment,
    Point,
    Scene,
    exitance,
    fit,
    from_normals,
    irradiance,
    plane,
    render,
    solid_angle_of_band,
    solid_angle_of_cone,
    solid_angle_of_patch,
    sphere,
)  # fmt: skip
from inverse.scene.footprints import Footprints
from inverse.transport.rendering import radiance_of
from torchbrdf import Coupled, Lambert, Mirror, ModifiedPhong, OrenNayar, RoughSurface, Schlick

D = torch.float64
GOLDEN = json.loads((Path(__file__).parents[1] / "data" / "other_models.json").read_text())["radiometry"]
UP = torch.tensor([0.0, 0.0, 1.0], dtype=D)


def first_arrival(light, surface):
    return next(light.arrivals(surface.points[surface.mask]))


def vector(*values):
    return torch.tensor(values, dtype=D)


def number(value):
    return torch.tensor(value, dtype=D)


def rough():
    return OrenNayar(albedo=vector(0.7, 0.4, 0.2), sigma=number(0.5))


def lambert(albedo):
    return Lambert(albedo=number(albedo))


@pytest.fixture
def spot():
    """A plane of one pixel, at the origin, facing the camera."""
    return plane(1, 1, dtype=D)


def test_point_source(spot):
    found = irradiance(spot, (Point(vector(1, 2, 3), 5.0),))
    assert found.item() == pytest.approx(GOLDEN["point I=5 pos=(1,2,3) p=0 n=z"], rel=1e-14)
    assert irradiance(spot, (Point(vector(1, 2, -3), 5.0),)).item() == GOLDEN["point behind"] == 0


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


def test_solid_angles():
    band = solid_angle_of_band((0.2, 0.9), (-0.3, 1.1))
    assert band == pytest.approx(GOLDEN["solid angle (13) t 0.2..0.9 p -0.3..1.1"], rel=1e-14)
    assert solid_angle_of_band((0, 0.4), (0, 2 * math.pi)) == pytest.approx(solid_angle_of_cone(0.4), rel=1e-14)
    assert solid_angle_of_cone(1e-9) == pytest.approx(math.pi * 1e-18, rel=1e-12)
    # a ring of patches seen from the centre of their sphere fills the band
    assert solid_angle_of_patch(0.01, 0.5, 2.0) == pytest.approx(0.00125)
    assert Environment(torch.ones(6, 10, 1)).solid_angles().sum().item() * 10 == pytest.approx(4 * math.pi)


def test_lights_of_an_image_add(spot):
    """(28): the sum over sources of f I max(0, n.d)/r^2, written out."""
    model, places, strengths = rough(), [vector(1, 2, 3), vector(-2, 0, 1), vector(0, 1, -1)], [5.0, 3.0, 7.0]
    wanted = torch.zeros(3, dtype=D)
    for place, strength in zip(places, strengths, strict=True):
        r2 = (place * place).sum()
        direction = place / r2.sqrt()
        wanted += model(UP, direction, UP) * strength * direction[2].clamp(min=0) / r2
    lights = tuple(Point(place, strength) for place, strength in zip(places, strengths, strict=True))
    torch.testing.assert_close(radiance_of(Footprints.of(spot), lights)(model)[0], wanted, rtol=1e-13, atol=0)


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


def test_mirror_shows_its_environment():
    """Each point reflects the radiance of the direction 2 (n.v) n - v; a lamp is invisible in it."""
    image = torch.rand(16, 32, 3, dtype=D)
    surface = sphere(9, 9, dtype=D)
    mirror = Mirror(fresnel=Schlick(f0=number(0.2)))
    found = render(Scene(surface, [Environment(image), Distant.from_angle(0)]), mirror)
    assert (found[1] == 0).all()
    for row, column in ((3, 6), (2, 5), (6, 3)):
        n = surface.normals[row, column]
        looked = 2 * n[2] * n - UP
        polar, azimuth = math.acos(looked[1]), math.atan2(looked[0], -looked[2])
        texel = image[int(polar / math.pi * 16), int((azimuth / (2 * math.pi) + 0.5) * 32) % 32]
        wanted = (0.2 + 0.8 * (1 - n[2]) ** 5) * texel
        torch.testing.assert_close(found[0, row, column], wanted, rtol=1e-9, atol=0)


def test_polished_body_shows_body_and_mirror(spot):
    """Under a uniform map the layered model returns mirror and body together: F + rho (1 - F)."""
    model = Coupled(albedo=number(0.5), fresnel=Schlick(f0=number(0.1)))
    white = Environment(torch.ones(64, 128, 1, dtype=D))
    assert radiance_of(Footprints.of(spot), (white,))(model).item() == pytest.approx(0.1 + 0.5 * 0.9, rel=2e-3)
    disc = Disc(UP, 0.1, 1.0)
    lobe = radiance_of(Footprints.of(spot), (disc,))(Mirror()).item()
    assert lobe == pytest.approx(disc.radiance.item(), rel=1e-12)


def test_exitance_is_albedo_times_irradiance():
    surface = sphere(5, 5, dtype=D)
    lights = (Point(vector(2, 1, 3), 4.0), Distant.from_angle(20))
    torch.testing.assert_close(
        exitance(lambert(0.6), surface, lights), 0.6 * irradiance(surface, lights), rtol=1e-12, atol=0
    )
    model = ModifiedPhong(diffuse=number(0.3), specular=number(0.4), exponent=number(6.0))
    face = plane(1, 1, normal=(0.6, 0, 0.8), dtype=D)
    light = (Distant(vector(0, 0, 1)),)
    wanted = model.directional_albedo(number(0.8), nodes=48) * 0.8
    torch.testing.assert_close(exitance(model, face, light, nodes=48)[0], wanted, rtol=1e-4, atol=0)


def arrive(surface, lamp):
    return first_arrival(Point(lamp), surface)


@pytest.mark.parametrize("make", [OrenNayar, lambda **k: RoughSurface(**k, nodes=4)])
def test_fit_under_a_lamp_and_a_disc(make):
    lights = [Point(vector(1, 2, 4), 20.0), [Disc(vector(-0.6, 0, 0.8), 0.3), Point(vector(3, 0, 1), 3.0)]]
    scene = Scene(sphere(20, 20, dtype=D), lights)
    photographs = render(scene, make(albedo=number(0.7), sigma=number(0.5))).detach()
    result = fit(scene, photographs, make(albedo=number(0.4), sigma=number(0.3)))
    assert result.status == "converged"
    torch.testing.assert_close(result.parameters["sigma"], number(0.5), rtol=1e-6, atol=0)


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
