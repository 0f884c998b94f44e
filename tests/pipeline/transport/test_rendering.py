"""Radiance of known surfaces against closed forms and brute-force quadrature."""

import math
from itertools import pairwise

import pytest
import torch

from inverse import Ambient, Disc, Distant, Environment, Point, Scene, plane, render, sphere
from inverse.scene.footprints import Footprints
from inverse.scene.maps import from_depth
from inverse.scene.surface import cylinder
from inverse.transport.rendering import radiance_of
from torchbrdf import Coupled, Lambert, Mirror, OrenNayar, QualitativeOrenNayar, Schlick

D = torch.float64

UP = torch.tensor([0.0, 0.0, 1.0], dtype=D)


def vector(*values):
    return torch.tensor(values, dtype=D)


def number(value):
    return torch.tensor(value, dtype=D)


def rough():
    return OrenNayar(albedo=torch.tensor([0.7, 0.4, 0.2], dtype=D), sigma=number(0.5))


@pytest.fixture
def spot():
    """A plane of one pixel, at the origin, facing the camera."""
    return plane(1, 1, dtype=D)


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


def lambert(albedo=0.6):
    return Lambert(albedo=torch.tensor(albedo, dtype=D))


def test_lambert_sphere_is_rho_over_pi_times_cosine():
    """The cosine enters once: rho/pi max(n.l, 0) E, with n from the circle itself."""
    surface = sphere(31, 31, radius=0.9, dtype=D)
    light = Distant(torch.tensor([0.3, 0.5, 0.6], dtype=D), 2.0)
    image = render(Scene(surface, [light]), lambert())[0, ..., 0]
    direction = [k / math.sqrt(0.7) for k in (0.3, 0.5, 0.6)]
    for row, column in ((15, 15), (10, 20), (4, 15), (20, 6), (26, 20), (22, 25)):
        x, y = 2 / 31 * (column - 15) / 0.9, 2 / 31 * (15 - row) / 0.9
        cosine = x * direction[0] + y * direction[1] + math.sqrt(1 - x * x - y * y) * direction[2]
        assert image[row, column].item() == pytest.approx(0.6 / math.pi * 2.0 * max(cosine, 0), rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 89.0])
def test_cosine_enters_once_for_a_rough_plane(degrees):
    surface = plane(2, 2, dtype=D)
    image = render(Scene(surface, [Distant.from_angle(degrees, 3.0)]), rough())
    angle = math.radians(degrees)
    light = torch.tensor([math.sin(angle), 0, math.cos(angle)], dtype=D)
    f = rough()(torch.tensor([0, 0, 1.0], dtype=D), light, torch.tensor([0, 0, 1.0], dtype=D))
    torch.testing.assert_close(image, (f * math.cos(angle) * 3.0).expand(1, 2, 2, 3), rtol=1e-9, atol=0)


@pytest.mark.parametrize("model", [lambert(), rough()], ids=["lambert", "rough"])
def test_light_from_the_right_brightens_the_right(model):
    image = render(Scene(cylinder(32, 32, dtype=D), [Distant.from_angle(40)]), model)[0, ..., 0]
    left, right = image[:, :16].sum(), image[:, 16:].sum()
    assert right > 1.5 * left
    brightest = image[16].argmax().item()
    assert brightest > 16


def test_light_from_above_brightens_the_top():
    scene = Scene(sphere(32, 32, dtype=D), [Distant(torch.tensor([0, 0.6, 0.8], dtype=D))])
    image = render(scene, lambert())[0, ..., 0]
    assert image[:16].sum() > 1.5 * image[16:].sum()


def test_mirrored_light_gives_the_mirrored_image():
    surface = sphere(24, 24, dtype=D)
    right, left = render(Scene(surface, [Distant.from_angle(35), Distant.from_angle(-35)]), rough())
    torch.testing.assert_close(right, left.flip(1))


def test_shadow_and_background_are_exactly_zero():
    surface = sphere(24, 24, dtype=D)
    image = render(Scene(surface, [Distant.from_angle(120)]), rough())[0]
    direction = torch.tensor([math.sin(math.radians(120)), 0, math.cos(math.radians(120))], dtype=D)
    dark = ~surface.mask | (surface.normals @ direction <= 0)
    assert (image[dark] == 0).all()
    assert (image[~dark] > 0).any()
    assert (~surface.mask).any()


def test_several_lights_add():
    surface = sphere(16, 16, dtype=D)
    lights = [Distant.from_angle(-30, 0.5), Distant.from_angle(50, 2.0), Ambient(0.3)]
    together = render(Scene(surface, [lights]), rough())[0]
    apart = render(Scene(surface, [[light] for light in lights]), rough())
    torch.testing.assert_close(together, apart.sum(0))


def test_irradiance_scales_by_channel():
    surface = sphere(16, 16, dtype=D)
    colour = torch.tensor([1.0, 0.5, 0.25], dtype=D)
    coloured, white = render(Scene(surface, [Distant.from_angle(10, colour), Distant.from_angle(10)]), rough())
    torch.testing.assert_close(coloured, white * colour)


@pytest.mark.parametrize(
    ("model", "tolerance"),
    [
        (lambert(), 1e-4),
        (rough(), 1e-3),
        (QualitativeOrenNayar(albedo=number(0.5), sigma=number(0.4)), 1e-3),
    ],
    ids=["lambert", "functional", "qualitative"],
)
def test_ambient_is_the_integral_over_the_hemisphere(model, tolerance):
    """Midpoint rule over the whole sphere of light directions, 200 x 400, in the camera's frame."""
    surface = sphere(15, 15, dtype=D)
    keep = surface.normals[surface.mask][:, 2] > math.cos(math.radians(85))
    found = radiance_of(Footprints.of(surface), (Ambient(0.7),))(model)[keep]
    z = (torch.arange(200, dtype=D) + 0.5) / 100 - 1
    azimuth = (torch.arange(400, dtype=D) + 0.5) * (2 * math.pi / 400)
    sine = (1 - z * z).sqrt()[:, None]
    lights = torch.stack((sine * azimuth.cos(), sine * azimuth.sin(), z[:, None].expand(200, 400)), -1).reshape(-1, 3)
    view = torch.tensor([0.0, 0, 1], dtype=D)
    with torch.no_grad():
        for index in range(0, int(keep.sum()), 20):
            normal = surface.normals[surface.mask][keep][index]
            f = model(normal, lights, view, normalize=True)
            brute = (f * (lights @ normal).clamp(min=0)[:, None]).mean(0) * (4 * math.pi) * 0.7
            torch.testing.assert_close(found[index], brute, rtol=tolerance, atol=0)


def test_supersampling_converges():
    """Second order in the pitch inside the object: errors fall by about 4 when the samples double."""

    def middle(samples):
        surface = sphere(12, 12, radius=0.95, samples=samples, dtype=D)
        return render(Scene(surface, [Distant.from_angle(20)]), rough())[0, 4:8, 4:8]

    truth = middle(64)
    errors = [(middle(s) - truth).abs().max().item() for s in (1, 2, 4, 8)]
    for coarse, fine in pairwise(errors):
        assert 3.5 < coarse / fine < 4.6


def test_perspective_view_directions_are_used():
    """A rough plane at z = -5 seen by a pinhole, each pixel by its own ray."""
    depth = torch.full((9, 9), 5.0, dtype=D)
    matrix = torch.tensor([[6.0, 0, 4], [0, 6, 4], [0, 0, 1]], dtype=D)
    surface = from_depth(depth, matrix)
    light = Distant.from_angle(50)
    image = render(Scene(surface, [light]), rough())[0]
    for row, column in ((1, 1), (4, 7), (7, 2)):
        ray = torch.tensor([(column - 4) / 6, (4 - row) / 6, -1.0], dtype=D)
        view = -ray / ray.norm()
        f = rough()(torch.tensor([0.0, 0, 1], dtype=D), light.direction, view)
        torch.testing.assert_close(image[row, column], f * math.cos(math.radians(50)), rtol=1e-6, atol=0)


def test_texel_parameters_run_over_the_masked_points():
    surface = sphere(8, 8, dtype=D)
    count = int(surface.mask.sum())
    albedo = torch.linspace(0.1, 0.9, count, dtype=D)[:, None]
    image = render(Scene(surface, [Distant.from_angle(0)]), Lambert(albedo=albedo))[0]
    expected = albedo[:, 0] / math.pi * surface.normals[surface.mask][:, 2]
    torch.testing.assert_close(image[surface.mask][:, 0], expected)


def test_render_is_differentiable():
    surface = sphere(6, 6, dtype=D)
    scene = Scene(surface, [Distant.from_angle(20), Ambient(0.2)])

    def total(raw_albedo, raw_sigma):
        model = rough()
        return torch.func.functional_call(
            _Render(model, scene), {"model.raw_albedo": raw_albedo, "model.raw_sigma": raw_sigma}, ()
        )

    start = rough()
    raw = (start.raw_albedo.detach().clone().requires_grad_(), start.raw_sigma.detach().clone().requires_grad_())
    assert torch.autograd.gradcheck(total, raw)


class _Render(torch.nn.Module):
    def __init__(self, model, scene):
        super().__init__()
        self.model, self.scene = model, scene

    def forward(self):
        return render(self.scene, self.model)


def test_per_texel_albedo_under_ambient_light():
    surface = sphere(16, 16, dtype=D)
    points = int(surface.mask.sum())
    albedo = torch.linspace(0.2, 0.9, points, dtype=D)[:, None]
    image = render(Scene(surface, [Ambient(2.0)]), Lambert(albedo=albedo))[0]
    torch.testing.assert_close(image[surface.mask], 2 * albedo, rtol=1e-12, atol=0)
