"""Cast shadows against closed forms and against marching along rays from the definition of the shape."""

import math

import numpy as np
import pytest
import torch

from inverse import Ambient, Disc, Distant, Group, Plane, Point, Revolution, Sphere, cuboid, cylinder, sphere, vase
from inverse.scene.maps import from_depth
from inverse.scene.surface import vase_profile
from inverse.shapes.height_field import HeightField
from inverse.transport.shadows import unshadowed

D = torch.float64


def towards(azimuth: float, elevation: float) -> torch.Tensor:
    """Unit vector to a light: degrees to the right of the camera and above the horizon."""
    a, e = math.radians(azimuth), math.radians(elevation)
    return torch.tensor([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)], dtype=D)


def masked(surface):
    return surface.points[surface.mask], surface.normals[surface.mask]


def marched(points, normals, direction, steps=1500):
    """True where a ray, tried at many distances, comes inside the vase: nothing but its profile is used."""
    profile = vase_profile()
    blocked = np.zeros(len(points), dtype=bool)
    start, along = (points + 1e-6 * normals).numpy(), direction.numpy()
    for t in np.linspace(0, 2.4, steps)[1:]:
        x, y, z = (start + t * along).T
        radius = np.nan_to_num(profile(y))  # NaN beyond the ends
        blocked |= x * x + z * z < radius * radius
    return torch.from_numpy(blocked & (normals @ direction > 0).numpy())


# --- what is known beforehand ------------------------------------------------------------------------------


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


# --- the vase ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("azimuth", "elevation"), [(20, 60), (0, 75), (-60, 45), (10, -70)])
def test_vase_in_raised_light_as_marched(azimuth, elevation):
    solid, (points, normals) = vase(8, 8).solid, masked(vase(96, 96, dtype=D))
    direction = towards(azimuth, elevation)
    shadow, expected = ~unshadowed(solid, points, normals, direction), marched(points, normals, direction)
    assert expected.sum() > 20
    # the marching misses dips shorter than its steps: a few points at the shadow's edge
    assert (shadow & ~expected).sum() <= 0.002 * len(points)
    assert not (expected & ~shadow).any()


@pytest.mark.parametrize("azimuth", [0, 20, 75, 150])
def test_level_light_casts_no_shadow_on_the_vase(azimuth):
    solid, (points, normals) = vase(8, 8).solid, masked(vase(64, 64, dtype=D))
    assert not marched(points, normals, towards(azimuth, 0)).any()
    assert unshadowed(solid, points, normals, towards(azimuth, 0)).all()


def hyperboloid(a=0.3, b=0.8, high=0.9):
    """x^2 + z^2 = a^2 + b y^2 between two heights: concave along its height, and its rays are closed forms."""
    return Revolution(lambda y: np.sqrt(a * a + b * y * y), lambda y: b * y / np.sqrt(a * a + b * y * y), -high, high)


@pytest.mark.parametrize("dtype", [torch.float32, D])
@pytest.mark.parametrize("elevation", [-80, -60, 35, 50, 65, 85])
def test_concave_solid_of_revolution_in_closed_form(elevation, dtype):
    """x^2 + z^2 - b y^2 - a^2 is 0 at the point and once more along its ray: there it enters, if between the ends."""
    a, b, high = 0.3, 0.8, 0.9
    solid = hyperboloid(a, b, high)
    y, turn = torch.linspace(-0.89, 0.89, 90, dtype=D), torch.linspace(0, 6.2, 70, dtype=D)
    y, turn = y.repeat_interleave(70), turn.repeat(90)
    r = (a * a + b * y * y).sqrt()
    points = torch.stack((r * turn.sin(), y, r * turn.cos()), -1)
    normals = points * torch.tensor([1.0, -b, 1.0], dtype=D)
    normals = normals / normals.norm(dim=-1, keepdim=True)
    direction = towards(25, elevation)
    metric = torch.tensor([1.0, -b, 1.0], dtype=D)
    first, second = 2 * (points * metric) @ direction, (direction * direction) @ metric
    again = -first / second
    height = points[:, 1] + again * direction[1]
    expected = (first > 0) & (again > 0) & (height.abs() < high)
    sure = ((height.abs() - high).abs() > 2e-3) & (first.abs() > 1e-3)
    clear = unshadowed(solid, points.to(dtype), normals.to(dtype), direction.to(dtype))
    assert torch.equal(~clear[sure], expected[sure])
    assert sure.double().mean() > 0.95
    if abs(elevation) > 45:  # steeper than the cone b y^2 that it approaches
        assert expected.sum() > 50


def test_both_precisions_agree():
    one, other = (masked(vase(128, 128, dtype=k)) for k in (torch.float32, D))
    solid = vase(8, 8).solid
    for angles in [(20, 60), (-70, 50), (0, -60)]:
        direction = towards(*angles)
        assert torch.equal(unshadowed(solid, *one, direction.float()), unshadowed(solid, *other, direction))


@pytest.mark.parametrize("dtype", [torch.float32, D])
def test_no_speckles_on_convex_shapes(dtype):
    long = Revolution(lambda y: 0.5 * np.sqrt(1 - y * y), lambda y: -0.5 * y / np.sqrt(1 - y * y), -0.99, 0.99)
    for surface in (sphere(64, 64, dtype=dtype), cylinder(64, 64, dtype=dtype), cuboid(64, 64, pitch=20, dtype=dtype)):
        points, normals = masked(surface)
        for angles in [(0, 0), (80, 5), (100, 40), (30, 89), (-60, -30)]:
            assert unshadowed(surface.solid, points, normals, towards(*angles).to(dtype)).all()
    points = long.patches(1600).points
    normals = long.normal(points).to(dtype)
    for angles in [(0, 0), (80, 5), (100, 40), (30, 89), (-60, -30)]:
        assert unshadowed(long, points.to(dtype), normals, towards(*angles).to(dtype)).all()


# --- sphere over a plane -----------------------------------------------------------------------------------

RADIUS, ABOVE = 0.25, 0.4
SCENE = Group((Sphere(RADIUS, (0.0, ABOVE, 0.0)), Plane((0.0, 1.0, 0.0))))


def floor(size=121, reach=1.5):
    x, z = torch.meshgrid(*2 * (torch.linspace(-reach, reach, size, dtype=D),), indexing="ij")
    points = torch.stack((x, 0 * x, z), -1).flatten(0, 1)
    return points, torch.tensor([0.0, 1, 0], dtype=D).expand(points.shape)


def test_shadow_of_a_sphere_on_a_plane_is_an_ellipse():
    """Centre at c - l c_y/l_y, half axes R/l_y along the light and R across."""
    points, normals = floor()
    direction = towards(30, 35)
    level = direction[[0, 2]] / direction[[0, 2]].norm()
    offset = points[:, [0, 2]] + direction[[0, 2]] * ABOVE / direction[1]
    along, across = offset @ level, offset[:, 0] * level[1] - offset[:, 1] * level[0]
    form = (along * direction[1] / RADIUS) ** 2 + (across / RADIUS) ** 2
    sure = (form - 1).abs() > 1e-3
    clear = unshadowed(SCENE, points, normals, direction)
    assert torch.equal(clear[sure], form[sure] > 1)
    assert (~clear).sum().item() * (3 / 120) ** 2 == pytest.approx(math.pi * RADIUS**2 / direction[1].item(), rel=0.02)


def test_shadow_of_a_lamp_is_a_cone():
    points, normals = floor()
    for position in ([0.4, 1.0, 0.3], [0.0, 0.66, 0.0]):
        lamp = Point(torch.tensor(position, dtype=D))
        to_centre = torch.tensor([0.0, ABOVE, 0.0], dtype=D) - lamp.position
        arrival = next(lamp.arrivals(points))
        cosine = -(arrival.direction @ to_centre) / to_centre.norm()
        edge = math.sqrt(1 - (RADIUS / to_centre.norm().item()) ** 2)
        clear = unshadowed(SCENE, points, normals, arrival.direction, lamp.distance(points))
        sure = (cosine - edge).abs() > 1e-5
        assert torch.equal(clear[sure], cosine[sure] < edge)
        assert not clear.all()


def test_lamp_in_front_of_the_occluder_casts_no_shadow():
    points, normals = floor()
    lamp = Point(torch.tensor([0.02, 0.1, 0.0], dtype=D))  # between the sphere and the floor
    arrival = next(lamp.arrivals(points))
    assert unshadowed(SCENE, points, normals, arrival.direction, lamp.distance(points)).all()
    assert not unshadowed(SCENE, points, normals, arrival.direction).all()
    assert Distant.from_angle(0).distance(points) is None


# --- depth maps --------------------------------------------------------------------------------------------


def grid(size):
    row, column = torch.meshgrid(*2 * (torch.arange(size, dtype=D),), indexing="ij")
    return column, -row


@pytest.mark.parametrize("dtype", [torch.float32, D])
def test_shadow_of_a_dome_in_a_depth_map(dtype):
    """A half sphere on a flat ground: shadowed where the ray passes the centre within the radius."""
    size, radius = 161, 30.0
    x, y = grid(size)
    centre = torch.tensor([60.0, -80.0, -200.0], dtype=D)
    dome = (radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2).clamp(min=0).sqrt()
    surface = from_depth((200 - dome).to(dtype))
    points, normals = masked(surface)
    direction = towards(-65, 0)
    to_centre = centre - points.double()
    beside = (to_centre - (to_centre @ direction)[:, None] * direction).norm(dim=-1)
    ground = to_centre[:, :2].norm(dim=-1) > radius + 2
    sure = ground & ((beside - radius).abs() > 1)
    clear = unshadowed(surface.solid, points, normals, direction.to(dtype))
    assert torch.equal(~clear[sure], (beside < radius)[sure] & (to_centre @ direction > 0)[sure])
    assert (~clear[sure]).sum() > 300
    top = to_centre[:, :2].norm(dim=-1) < 0.8 * radius
    assert clear[top].all()  # a dome hides nothing from itself


@pytest.mark.parametrize("dtype", [torch.float32, D])
@pytest.mark.parametrize("angles", [(60, 0), (20, 60), (-75, 30)])
def test_bowl_in_closed_form(angles, dtype):
    """z = k (x^2 + y^2) is met again at t = (z' - 2 k x x' - 2 k y y')/(k (x'^2 + y'^2)), if inside the image."""
    size, k = 121, 1 / 120
    x, y = grid(size)
    middle = torch.tensor([60.0, -60.0], dtype=D)
    surface = from_depth((500 - k * ((x - middle[0]) ** 2 + (y - middle[1]) ** 2)).to(dtype))
    points, normals = masked(surface)
    direction, own = towards(*angles), points[:, :2].double() - middle
    rate = direction[2] - 2 * k * own @ direction[:2]
    end = own + (rate / (k * direction[:2].square().sum()))[:, None] * direction[:2]
    border = end.abs().amax(-1)
    sure = ((border - 60).abs() > 0.5) & (rate.abs() > 0.02)
    clear = unshadowed(surface.solid, points, normals, direction.to(dtype))
    assert torch.equal(~clear[sure], ((rate > 0) & (border < 60))[sure])
    assert sure.double().mean() > 0.9
    assert (~clear).sum() > 500


def test_relief_is_met_from_the_front():
    x, y = grid(41)
    heights = 0.3 * x + 0.1 * y
    relief = HeightField(heights)
    origin = torch.tensor([[10.25, -7.5, 100.0], [33.0, -39.75, 50.0], [50.0, -3.0, 9.0]], dtype=D)
    distance, normal = relief.meet(origin, torch.tensor([0.0, 0, -1], dtype=D))
    expected = origin[:, 2] - 0.3 * origin[:, 0] - 0.1 * origin[:, 1]
    torch.testing.assert_close(distance[:2], expected[:2], atol=1e-9, rtol=0)
    assert distance[2] == math.inf
    n = torch.tensor([-0.3, -0.1, 1.0], dtype=D)
    torch.testing.assert_close(normal[:2], (n / n.norm()).expand(2, 3))


def test_unknown_parts_of_a_depth_map_hide_nothing():
    heights = torch.zeros(31, 61, dtype=D)
    heights[:, 28:33] = 20.0
    at, up = torch.tensor([[15.0, -15.0, 0.0]], dtype=D), torch.tensor([[0.0, 0, 1]], dtype=D)
    assert not unshadowed(HeightField(heights), at, up, towards(60, 0)).any()
    heights[:, 28:33] = torch.nan
    assert unshadowed(HeightField(heights), at, up, towards(60, 0)).all()
    with pytest.raises(ValueError, match=r"HeightField.heights must be \(rows, columns\)"):
        HeightField(torch.full((3, 3), torch.nan))


def test_who_knows_its_solid():
    depth = torch.full((9, 9), 5.0)
    assert isinstance(from_depth(depth).solid, HeightField)
    assert from_depth(depth, torch.eye(3)).solid is None
