"""Light between the parts of an object, against closed forms and laws."""

import math

import numpy as np
import pytest
import torch

from inverse import Ambient, Cuboid, Cylinder, Distant, Group, Plane, Point, Sphere, vase
from inverse.scene.surface import vase_profile
from inverse.shapes.form_factors import PairExchange, RingExchange, form_factors
from inverse.shapes.height_field import HeightField
from inverse.shapes.patches import Patches
from inverse.transport.direct import direct_irradiance
from inverse.transport.radiosity import bounced, sky_share, why_no_interreflection

D = torch.float64


def on_vase(heights, turns):
    """Points of the vase's wall at heights and azimuths, and normals."""
    solid = vase(8, 8).solid
    y, turn = torch.tensor(heights, dtype=D), torch.tensor(turns, dtype=D)
    r = torch.from_numpy(vase_profile()(y.numpy()))
    points = torch.stack((r * turn.sin(), y, r * turn.cos()), -1)
    return solid, points, solid.normal(points)


# --- the kernel against closed forms -----------------------------------------------------------------------


def cavity(count, radius=0.7):
    """The inside of a sphere: every patch sees every other, with the share area/(4 pi R^2)."""
    points, normals, areas = Sphere(radius, (0.1, 0.2, -0.3)).patches(count)
    return PairExchange(None, Patches(points, -normals, areas))


@pytest.mark.parametrize("count", [300, 3000])
def test_spherical_cavity(count):
    """T_b = mean of E for every b, so that the sum at albedo rho is E + rho mean(E)/(1 - rho)."""
    room, within = cavity(count), 8 / count  # what a patch and its neighbours send each other is not resolved
    height = room.patches.normals[:, 1:]
    direct = torch.cat(((height > 0.3).to(D), (1 + height).square()), -1)
    mean, rho, total, arrived = direct.mean(0), 0.6, direct, direct
    for b in range(1, 30):
        arrived = room.carry(arrived)
        torch.testing.assert_close(arrived, mean.expand(arrived.shape), atol=0, rtol=within * b)
        total = total + rho**b * arrived
    expected = direct + rho * mean / (1 - rho)
    torch.testing.assert_close(total, expected, atol=0, rtol=within / (1 - rho))
    torch.testing.assert_close(room.share, torch.ones(count, dtype=D), atol=within, rtol=0)
    # at a point of the wall that is no patch's middle
    inward = torch.tensor([[0.6, 0.0, 0.8]], dtype=D)
    point = torch.tensor([[0.1, 0.2, -0.3]], dtype=D) - 0.7 * inward
    torch.testing.assert_close(room.arriving(direct, point, inward), mean[None], atol=0, rtol=within)


def plate(count, y, facing):
    side = (torch.arange(count, dtype=D) + 0.5) / count - 0.5
    x, z = (k.flatten() for k in torch.meshgrid(side, side, indexing="ij"))
    normal = torch.tensor([0.0, facing, 0.0], dtype=D)
    return Patches(torch.stack((x, 0 * x + y, z), -1), normal.expand(count**2, 3), 0 * x + 1 / count**2)


@pytest.mark.parametrize("apart", [0.2, 0.5, 1.0, 3.0])
def test_two_facing_squares(apart):
    """Form factor of equal parallel squares, e.g. Howell's catalogue C-11."""
    x = 1 / apart
    expected = (2 / (math.pi * x * x)) * (
        0.5 * math.log((1 + x * x) ** 2 / (1 + 2 * x * x))
        + 2 * x * math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x))
        - 2 * x * math.atan(x)
    )
    below, above = plate(24, 0.0, 1.0), plate(24, apart, -1.0)
    factors = form_factors(below.points, below.normals, above, None)
    assert factors.sum(-1).mean().item() == pytest.approx(expected, rel=0.01)


def test_a_disc_straight_ahead_takes_no_more_than_the_sky():
    """A disc of radius R at height h takes R^2/(R^2 + h^2), and small patches aside cos cos' A/(pi r^2)."""
    up = torch.tensor([[0.0, 1.0, 0.0]], dtype=D)
    for height in (1e-6, 0.1, 1.0, 10.0):
        disc = Patches(height * up, -up, torch.tensor([math.pi * 0.3**2], dtype=D))
        expected = 0.09 / (0.09 + height**2)
        assert form_factors(0 * up, up, disc, None).item() == pytest.approx(expected, rel=1e-12)
    aside = Patches(torch.tensor([[3.0, 4.0, 0.0]], dtype=D), torch.tensor([[-1.0, 0, 0]], dtype=D), up[0, 1:2] * 1e-6)
    assert form_factors(0 * up, up, aside, None).item() == pytest.approx(0.8 * 0.6e-6 / (25 * math.pi), rel=1e-6)


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


# --- rings against pairs -----------------------------------------------------------------------------------


def test_rings_carry_as_every_pair_does():
    solid = vase(8, 8).solid
    rings = RingExchange(solid, solid.wall(20), 20, solid.on_end)
    pairs = PairExchange(solid, rings.patches)
    exitance = torch.rand(2, 400, 3, generator=torch.Generator().manual_seed(0), dtype=D)
    torch.testing.assert_close(rings.carry(exitance), pairs.carry(exitance))
    torch.testing.assert_close(rings.share, pairs.share)
    assert rings.share.max() > 0.05


def test_patches_have_the_surface_of_their_solid():
    y = np.linspace(-0.92, 0.92, 20001)
    r = vase_profile()(y)
    wall = 2 * math.pi * r * np.sqrt(1 + vase_profile()(y, 1) ** 2)
    whole = ((wall[1:] + wall[:-1]) / 2 * np.diff(y)).sum() + math.pi * (r[0] ** 2 + r[-1] ** 2)
    for solid, expected, within in (
        (Sphere(0.5), math.pi, 1e-9),
        (Cylinder(0.5, 0.3), 1.1 * math.pi, 1e-9),
        (Cuboid((0.5, 0.2, 0.3), 20.0, 10.0), 8 * (0.1 + 0.06 + 0.15), 1e-9),
        (vase(8, 8).solid, whole, 5e-3),  # frustums of 22 rings
    ):
        points, normals, areas = solid.patches(500)
        assert areas.sum().item() == pytest.approx(expected, rel=within)
        torch.testing.assert_close(solid.normal(points), normals)
        assert 300 < len(points) < 800
        # closed surfaces: their normals add up to nothing
        assert (areas[:, None] * normals).sum(0).abs().max() < 5e-3 * expected


# --- what the caller may ask -------------------------------------------------------------------------------


def test_a_plane_takes_part_far_out():
    """In a disc of 1000 half sizes under the middle of what stands on it."""
    above = Sphere(0.5).patches(2000).points
    points, normals, areas = Plane((0.0, 0.6, 0.8), (0.0, 1.0, 0.0)).patches_near(above, 300)
    assert areas.sum().item() == pytest.approx(math.pi * 500**2, rel=0.01)
    assert ((points - torch.tensor([0.0, 1.0, 0.0], dtype=D)) @ normals[0]).abs().max() < 1e-9
    middle = 0.6 * normals[0]  # the plane's point nearest to the sphere's centre
    distances = (points - middle).norm(dim=-1)
    assert distances.min() < 0.2
    # all patches but the last reach half way between the last two
    reached = (distances[-1] + distances[-2]).item() / 2
    assert areas[:-1].sum().item() == pytest.approx(math.pi * reached**2, rel=0.02)


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


def test_shadows_fall_on_the_patches_too():
    exchange = PairExchange(SCENE, SCENE.patches(400))
    light = Distant(torch.tensor([0.0, 1.0, 0.0], dtype=D))
    received = direct_irradiance([light], *exchange.patches[:2], SCENE, 1 - exchange.share)[:, 0]
    points, normals, _ = exchange.patches
    below = (points[:, 1] == 0) & (points[:, [0, 2]].norm(dim=-1) < RADIUS)
    assert below.sum() > 3
    assert (received[below] == 0).all()
    open_ = (points[:, 1] == 0) & ~below
    assert (received[open_] == 1).all()
    on_ball = points[:, 1] > 0
    torch.testing.assert_close(received[on_ball], normals[on_ball, 1].clamp(min=0))


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
