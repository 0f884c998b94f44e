"""Light between the parts of an object, against closed forms, laws, and a path tracer that knows the profile alone."""

import itertools
import math

import numpy as np
import pytest
import torch

from inverse import Ambient, Distant, Group, Plane, Point, Sphere, vase
from inverse.scene.surface import vase_profile
from inverse.shapes.height_field import HeightField
from inverse.transport.radiosity import bounced, sky_share, why_no_interreflection

D = torch.float64


def on_vase(heights, turns):
    """Points of the vase's wall at heights and azimuths, and normals."""
    solid = vase(8, 8).solid
    y, turn = torch.tensor(heights, dtype=D), torch.tensor(turns, dtype=D)
    r = torch.from_numpy(vase_profile()(y.numpy()))
    points = torch.stack((r * turn.sin(), y, r * turn.cos()), -1)
    return solid, points, solid.normal(points)


RADIUS, ABOVE = 0.3, 0.5
SCENE = Group((Sphere(RADIUS, (0.0, ABOVE, 0.0)), Plane((0.0, 1.0, 0.0))))


def ground(distances):
    x = torch.tensor(distances, dtype=D)
    points = torch.stack((x, 0 * x, 0.3 * x), -1)
    return points, torch.tensor([0.0, 1.0, 0.0], dtype=D).expand(points.shape)


def ball(heights):
    y = torch.tensor(heights, dtype=D)
    normals = torch.stack((0.6 * (1 - y * y).sqrt(), y, 0.8 * (1 - y * y).sqrt()), -1)
    return torch.tensor([0.0, ABOVE, 0.0], dtype=D) + RADIUS * normals, normals


@pytest.mark.parametrize("count", [600, 2400])
def test_sky_that_a_sphere_and_a_plane_take_from_each_other(count):
    """From the plane the sphere takes (R/d)^2 cos; from the sphere the plane takes (1 - cos of its tilt)/2."""
    points, normals = ground([0.0, 0.1, 0.4, 1.0, 3.0])
    away = points - torch.tensor([0.0, ABOVE, 0.0], dtype=D)
    expected = RADIUS**2 * ABOVE / away.norm(dim=-1) ** 3
    taken = 1 - sky_share(SCENE, points, normals, patches=count)
    torch.testing.assert_close(taken, expected, atol=0, rtol=12 / count)
    points, normals = ball([-0.999, -0.6, 0.0, 0.5, 0.9])
    taken = 1 - sky_share(SCENE, points, normals, patches=count)
    torch.testing.assert_close(taken, (1 - normals[:, 1]) / 2, atol=36 / count, rtol=0)


def test_a_third_body_hides_what_is_behind_it():
    """Of two spheres in line, a point sees the nearer one alone."""
    both = Group((SCENE.solids[1], Sphere(0.2, (0.0, 0.5, 0.0)), Sphere(0.2, (0.0, 1.0, 0.0))))
    points, normals = ground([0.0])
    assert 1 - sky_share(both, points, normals).item() == pytest.approx((0.2 / 0.5) ** 2, rel=0.02)


def test_first_bounce_between_sphere_and_plane():
    """Against an independent sum: directions over a point's sky, each to the sphere or the floor in closed form."""
    light = torch.tensor([0.48, 0.6, 0.64], dtype=D)
    points, normals = ground([0.5, 0.9])
    got = bounced(SCENE, [Distant(light)], points, normals)[0, :, 0]
    share = (torch.arange(400, dtype=D) + 0.5) / 400
    radius, turn = torch.meshgrid(share.sqrt(), 2 * math.pi * share, indexing="ij")
    up = (1 - radius * radius).sqrt()
    direction = torch.stack((radius * turn.cos(), up, radius * turn.sin()), -1)  # equal shares of cos/pi
    for k in range(2):
        start = points[k] - torch.tensor([0.0, ABOVE, 0.0], dtype=D)
        b = direction @ start
        root = b * b - start @ start + RADIUS**2
        normal = (start + (-b - root.clamp(min=0).sqrt())[..., None] * direction) / RADIUS
        expected = ((normal @ light).clamp(min=0) * (root > 0)).mean()  # the floor shadows nothing
        assert got[k].item() == pytest.approx(expected.item(), rel=0.03)


def test_white_objects_are_invisible_in_uniform_light():
    """At albedo 1 every point of an object in uniform light L has pi L, whatever its shape."""
    solid, points, normals = on_vase([-0.85, -0.7, 0.0, 0.5, 0.68, 0.88], [0.0, 1.0, 2.0, 3.0, -1.0, -2.0])
    terms = bounced(solid, [Ambient(2.0)], points, normals, tolerance=1e-6)
    total = 2 * math.pi * sky_share(solid, points, normals) + terms.sum(0)[:, 0]
    torch.testing.assert_close(total, torch.full_like(total, 2 * math.pi), atol=0.01, rtol=0)
    points, normals = (torch.cat(k) for k in zip(ground([0.05, 0.7]), ball([-0.8, 0.3]), strict=True))
    terms = bounced(SCENE, [Ambient()], points, normals, tolerance=1e-6)
    total = math.pi * sky_share(SCENE, points, normals) + terms.sum(0)[:, 0]
    torch.testing.assert_close(total, torch.full_like(total, math.pi), atol=0.03, rtol=0)


def test_convex_solids_take_no_work():
    points, normals = ball([0.1])
    assert torch.equal(bounced(Sphere(), [Ambient()], points, normals), torch.zeros(1, 1, 1, dtype=D))
    assert torch.equal(sky_share(Sphere(), points.float(), normals.float()), torch.ones(1))
    assert "convex" in why_no_interreflection(Sphere()).reason
    assert "unknown" in why_no_interreflection(None).reason
    assert why_no_interreflection(vase(8, 8).solid) is None


def test_bounces_left_out_stay_below_the_tolerance():
    solid, points, normals = on_vase([0.88, 0.68, -0.75], [0.0, 0.5, -0.5])
    light = [Distant.from_angle(10)]
    everything = bounced(solid, light, points, normals, tolerance=1e-9).sum(0)
    counts = []
    for tolerance in (0.1, 1e-2, 1e-3, 1e-5):
        terms = bounced(solid, light, points, normals, tolerance=tolerance)
        assert (everything - terms.sum(0)).abs().max() < tolerance
        counts.append(len(terms))
    assert counts == sorted(set(counts))


def test_points_where_nothing_bounces():
    """The belly sees no part of the vase, and the flat ends see none."""
    solid, points, normals = on_vase([-0.2, -0.1, -0.9, 0.88], [0.0, 1.0, 0.0, 0.0])
    points[2], normals[2] = points.new_tensor([0.1, 0.92, 0.0]), points.new_tensor([0.0, 1.0, 0.0])
    share = sky_share(solid, points, normals)
    assert share[:3].tolist() == [1, 1, 1]
    assert share[3] < 0.9
    terms = bounced(solid, [Ambient()], points, normals)
    assert (terms[:, :3] == 0).all()


def test_colours_dtypes_and_gradients():
    solid, points, normals = on_vase([0.88, 0.68], [0.0, 0.5])
    strength = torch.tensor([1.0, 2.0, 0.5], dtype=torch.float64, requires_grad=True)
    lights = [Distant(torch.tensor([0.0, 0.6, 0.8]), strength), Point(torch.tensor([0.5, 0.5, 2.0], dtype=D))]
    terms = bounced(solid, lights, points, normals)
    assert terms.shape[1:] == (2, 3)
    (gradient,) = torch.autograd.grad(terms[0, 0, 1], strength)
    alone = bounced(solid, [Distant(lights[0].direction)], points, normals)
    torch.testing.assert_close(gradient, torch.stack((0 * gradient[0], alone[0, 0, 0], 0 * gradient[0])))
    single = bounced(solid, lights, points.float(), normals.float())
    assert single.dtype == torch.float32
    torch.testing.assert_close(single.double(), terms.detach(), atol=1e-6, rtol=1e-5)


def test_refusals():
    points, normals = ball([0.1])
    with pytest.raises(ValueError, match="HeightField has no patches"):
        bounced(HeightField(torch.ones(4, 4)), [Ambient()], points, normals)
    with pytest.raises(ValueError, match="tolerance must be a positive share of the direct irradiance; found 0"):
        bounced(SCENE, [Ambient()], points, normals, tolerance=0.0)
    with pytest.raises(ValueError, match=r"patches must be a whole number of at least 9; found 1\.5"):
        bounced(SCENE, [Ambient()], points, normals, patches=1.5)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="found planes only"):
        bounced(Group((Plane(), Plane((0, 1, 0)))), [Ambient()], points, normals)


class Tracer:
    """Paths between white Lambert walls of the vase; crossings by marching and bisection."""

    def __init__(self):
        self.profile, self.rng = vase_profile(), np.random.default_rng(0)
        heights = np.linspace(-0.92, 0.92, 20001)
        self.heights, self.radii = heights, self.profile(heights)

    def inside(self, p):
        radius = np.interp(p[..., 1], self.heights, self.radii, left=0.0, right=0.0)
        return p[..., 0] ** 2 + p[..., 2] ** 2 < radius**2

    def first_hit(self, p, d):
        """Distance to where rays from outside enter; inf where they leave."""
        result, left = np.full(len(p), np.inf), np.arange(len(p))
        tried = np.concatenate((np.arange(0, 0.12, 0.004), np.geomspace(0.12, 2.0, 100)))
        for before, after in itertools.pairwise(tried):
            q = p[left] + after * d[left]
            entered = self.inside(q)
            low, high = np.full(entered.sum(), before), np.full(entered.sum(), after)
            rays = left[entered]
            for _ in range(30):
                mid = (low + high) / 2
                deep = self.inside(p[rays] + mid[:, None] * d[rays])
                low, high = np.where(deep, low, mid), np.where(deep, mid, high)
            result[rays] = high
            left = left[~entered & (np.abs(q[:, 1]) < 0.92) & (np.hypot(q[:, 0], q[:, 2]) < 0.6)]
        return result

    def normal(self, p):
        slope = self.profile(np.clip(p[:, 1], -0.92, 0.92), 1)
        n = np.stack((p[:, 0], -np.hypot(p[:, 0], p[:, 2]) * slope, p[:, 2]), -1)
        return n / np.linalg.norm(n, axis=-1, keepdims=True)

    def bounce(self, n, samples):
        """Directions about unit normals with density cos/pi."""
        share, turn = self.rng.random(samples), 2 * np.pi * self.rng.random(samples)
        other = np.where(np.abs(n[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
        u = np.cross(n, other)
        u /= np.linalg.norm(u, axis=-1, keepdims=True)
        flat = np.sqrt(share)[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * np.cross(n, u))
        return flat + np.sqrt(1 - share)[:, None] * n

    def irradiance(self, p, n, lights, bounces, samples):
        """Means and standard errors (light, bounce) of E at the ends of paths of 1, 2, ... segments from one point."""
        p, n = np.repeat(p[None], samples, 0), np.repeat(n[None], samples, 0)
        alive, values = np.arange(samples), np.zeros((len(lights), bounces, samples))
        for b in range(bounces):
            d = self.bounce(n, len(p))
            start = p + 1e-5 * n
            t = self.first_hit(start, d)
            met = np.isfinite(t)
            alive, p = alive[met], start[met] + t[met, None] * d[met]
            n = self.normal(p)
            for k, light in enumerate(lights):
                lit = np.isinf(self.first_hit(p + 1e-5 * n, np.repeat(light[None], len(p), 0)))
                values[k, b, alive] = np.clip(n @ light, 0, None) * lit
        return values.mean(-1), values.std(-1) / math.sqrt(samples)


@pytest.mark.parametrize("samples", [20_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_vase_as_traced(samples):
    """One and two bounces of a level and a raised light at lip, neck and foot: 3 standard errors and 2 % allowed."""
    solid = vase(8, 8).solid
    y, turn = np.array([0.88, 0.68, -0.75]), np.array([0.1, -0.8, 1.2])
    r = vase_profile()(y)
    points = torch.from_numpy(np.stack((r * np.sin(turn), y, r * np.cos(turn)), -1))
    normals = solid.normal(points)
    lights = [np.array(k) / np.linalg.norm(k) for k in ((0.3, 0.0, 0.954), (0.2, 0.85, 0.487))]
    got = [bounced(solid, [Distant(torch.from_numpy(light))], points, normals)[:2, :, 0].numpy() for light in lights]
    tracer = Tracer()
    for k in range(len(points)):
        means, errors = tracer.irradiance(points[k].numpy(), normals[k].numpy(), lights, 2, samples)
        assert means[0, 0] > 0.02
        for light in range(2):
            allowed = 3 * errors[light] + 0.02 * means[:, 0].max()
            assert (np.abs(got[light][:, k] - means[light]) < allowed).all()
