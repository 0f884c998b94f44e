"""A user's own extended light and own concave solid, derived from the abstract bases, go through the whole pipeline."""

import math
from dataclasses import dataclass

import pytest
import torch

from inverse import (
    Ambient,
    Arrival,
    Body,
    Distant,
    Light,
    Patches,
    Rays,
    Scene,
    Sensor,
    SimplerLight,
    everything,
    fit,
    orthographic,
    plan,
    read_stack,
    render,
    write_stack,
)
from torchbrdf import Lambert, OrenNayar

D = torch.float64
TILT = torch.tensor([0.35, -0.2, 0.9], dtype=D) / torch.tensor([0.35, -0.2, 0.9], dtype=D).norm()


@dataclass(frozen=True)
class Crater(Body):
    """A plane z = 0 with a spherical bowl in it, of opening `rim` and depth `depth`."""

    rim: float = 0.7
    depth: float = 0.45

    @property
    def radius(self) -> float:
        return (self.rim**2 + self.depth**2) / (2 * self.depth)

    @property
    def height(self) -> float:
        """Of the ball's middle above the plane."""
        return self.radius - self.depth

    @property
    def share(self) -> float:
        """Form factor of the whole bowl from any of its points: its share of the ball."""
        return self.depth / (2 * self.radius)

    def hit(self, origin, direction):
        start, along = origin.double(), direction.double()
        down = -start[..., 2] / torch.where(along[..., 2] == 0, 1.0, along[..., 2])
        crossing = start + down[..., None] * along
        on_plane = (along[..., 2] < 0) & (start[..., 2] > 0) & (crossing[..., :2].norm(dim=-1) >= self.rim)
        middle = start - start.new_tensor((0.0, 0.0, self.height))
        b = (middle * along).sum(-1)
        room = b * b - (middle * middle).sum(-1) + self.radius**2
        leave = -b + room.clamp(min=0).sqrt()
        below = start[..., 2] + leave * along[..., 2] < 0
        in_bowl = (room > 0) & (leave > 0) & below & ~on_plane
        return torch.where(on_plane, down, torch.where(in_bowl, leave, torch.inf))

    def normal(self, points):
        inward = points.new_tensor((0.0, 0.0, self.height)) - points
        upward = points.new_tensor((0.0, 0.0, 1.0)).expand(points.shape)
        bowl = points[..., 2] < -1e-9
        return torch.where(bowl[..., None], inward / self.radius, upward)

    def patches(self, count):
        """Of the bowl alone: the plane around it sees nothing of the solid."""
        k = torch.arange(count, dtype=D) + 0.5
        z = -self.depth * k / count  # equal areas on a ball are equal heights
        across = (self.radius**2 - (z - self.height) ** 2).sqrt()
        turn = k * math.pi * (3 - math.sqrt(5))
        points = torch.stack((across * turn.cos(), across * turn.sin(), z), -1)
        area = 2 * math.pi * self.radius * self.depth / count
        return Patches(points, self.normal(points), torch.full_like(z, area))


@dataclass(frozen=True)
class Ring(Light):
    """Lamps at infinity in a ring about an axis: a round window's edge."""

    axis: torch.Tensor
    half_angle: float
    irradiance: float = 1.0
    lamps: int = 7

    extended = True

    def directions(self):
        across = torch.linalg.cross(self.axis, self.axis.new_tensor([0.0, 1.0, 0.0]))
        across = across / across.norm()
        other = torch.linalg.cross(self.axis, across)
        for k in range(self.lamps):
            a = 2 * math.pi * k / self.lamps
            yield math.cos(self.half_angle) * self.axis + math.sin(self.half_angle) * (
                math.cos(a) * across + math.sin(a) * other
            )

    def arrivals(self, points):
        for direction in self.directions():
            yield Arrival(direction.to(points), points.new_full((1, 1), self.irradiance / self.lamps))

    def simpler(self, middle):
        return (SimplerLight("ring of lamps", "one lamp in the middle", Distant(self.axis, self.irradiance)),)


CRATER, RING = Crater(), Ring(TILT, 0.3)


def seen(size=24, samples=1):
    return orthographic(CRATER, size, size, samples=samples, dtype=D)


def scalar(value):
    return torch.tensor(value, dtype=D)


def test_own_light_is_the_sum_of_its_lamps():
    surface, model = seen(), OrenNayar(albedo=scalar(0.6), sigma=scalar(0.5))
    lamps = [Distant(d, RING.irradiance / RING.lamps) for d in RING.directions()]
    images = render(Scene(surface, [RING, lamps]), model)
    torch.testing.assert_close(images[0], images[1], rtol=1e-12, atol=0)


def test_own_solid_shades_itself_where_the_ball_says():
    """A point p of the bowl sees the direction d when the ray leaves the ball above the plane."""
    surface = seen(48)
    towards = torch.tensor([0.8, 0.1, 0.35], dtype=D)
    towards = towards / towards.norm()
    beam = Distant(towards)
    lit = render(Scene(surface, [beam]), Lambert(albedo=scalar(0.5)))[0, ..., 0] > 0
    points = surface.points
    out = points - points.new_tensor((0.0, 0.0, CRATER.height))
    leaves = points + (-2 * (out @ towards))[..., None] * towards
    facing = (surface.normals @ towards) > 0
    clear = torch.where(points[..., 2] < -1e-9, leaves[..., 2] > 0, True)
    margin = leaves[..., 2].abs() > 1e-3
    assert (lit == (facing & clear))[margin].all()
    assert (facing & ~clear)[margin].any()


@pytest.mark.parametrize("lights", [(RING,), (Ambient(0.3),), (RING, Ambient(0.3))])
def test_own_solid_exchanges_light_as_a_ball_does(lights):
    """Inside a ball every patch lights every point alike: T_1 = F mean(E), T_b = F T_(b-1)."""
    rho = 0.8
    scene = Scene(seen(), [lights], between_parts=True)
    model = Lambert(albedo=scalar(rho))
    points, normals, _ = CRATER.patches(20000)
    mean = 0.0
    for light in lights:
        if light.uniform is not None:
            mean += math.pi * light.uniform * (1 - CRATER.share)
        for arrival in light.arrivals(points):
            out = points - points.new_tensor((0.0, 0.0, CRATER.height))
            d = arrival.direction
            clear = (points + (-2 * (out @ d))[:, None] * d)[:, 2] > 0
            mean += float(((normals @ d).clamp(min=0) * clear).mean() * arrival.irradiance)
    wanted = rho / math.pi * mean * rho * CRATER.share / (1 - rho * CRATER.share)
    alone = render(Scene(scene.surface, [lights]), model)
    if any(light.uniform is not None for light in lights):  # of which the bowl hides its own share
        sky = math.pi * 0.3 * rho / math.pi
        bowl = scene.surface.points[..., 2] < -1e-9
        alone = alone - (sky * CRATER.share * bowl)[None, ..., None]
    extra = (render(scene, model) - alone)[0, ..., 0]
    bowl = scene.surface.points[..., 2] < -1e-9
    torch.testing.assert_close(extra[bowl], torch.full_like(extra[bowl], wanted), rtol=1e-2, atol=0)
    assert extra[~bowl].abs().max() < 1e-6


def test_fit_of_own_light_and_solid_finds_the_truth():
    scene = Scene(seen(), [RING, Distant.from_angle(-30)], Sensor(exposure=2.0), between_parts=True)
    truth = OrenNayar(albedo=scalar(0.6), sigma=scalar(0.5))
    with torch.no_grad():
        photographs = scene.sensor.expose(render(scene, truth))
    result = fit(scene, photographs, OrenNayar(albedo=scalar(0.4), sigma=scalar(0.3)))
    assert result.status == "converged"
    assert float(result.parameters["sigma"]) == pytest.approx(0.5, rel=1e-6)
    assert float(result.parameters["albedo"]) == pytest.approx(0.6, rel=1e-6)


def test_plan_asks_own_light_and_solid():
    scene, model = Scene(seen(32, 2), [RING]), OrenNayar(albedo=scalar(0.6), sigma=scalar(0.5))
    fine, coarse = plan(scene, model, 1e-3), plan(scene, model, 0.9)
    assert fine.simulates("ring of lamps")
    assert fine.simulates("light between parts")
    assert fine.simulates("cast shadows")
    assert not coarse.simulates("ring of lamps")
    assert isinstance(coarse.scene.lights[0][0], Distant)
    full = render(everything(scene), model)
    assert float(((fine.render() - full).abs().max() / full.max()).detach()) < 1e-3


def test_a_folder_keeps_own_light_in_numbers_and_own_solid_as_its_normals(tmp_path):
    """The ring comes back as its seven rays; shadows aside, for which a folder has no solid."""
    scene = Scene(seen(), [RING, (RING, Ambient(0.1))], Sensor(exposure=2.0), shadows=False)
    model = OrenNayar(albedo=scalar(0.6), sigma=scalar(0.5))
    with torch.no_grad():
        images = render(scene, model)
        write_stack(tmp_path / "crater", scene.sensor.expose(images), scene)
        read = read_stack(tmp_path / "crater", dtype=D).scene
        again = render(read, model)
    ((rays,), (_, ambient)) = read.lights
    assert isinstance(rays, Rays)
    torch.testing.assert_close(rays.directions, torch.stack(list(RING.directions())), rtol=0, atol=0)
    assert isinstance(ambient, Ambient)
    torch.testing.assert_close(read.surface.normals, scene.surface.normals, rtol=0, atol=1e-15)
    torch.testing.assert_close(again, images, rtol=1e-12, atol=1e-14)  # numbers and maps are written in full
