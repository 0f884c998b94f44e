"""The path tracer of `examples/heightfield_study`: geometry that is known, then surfaces traced by another program."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("embreex", reason="the study's ray caster is not installed: pip install torchbrdf[study]")

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "examples" / "heightfield_study"))

import calibration  # noqa: E402
import surfaces  # noqa: E402
from runs import Plan, carry_out  # noqa: E402
from samples import Sample, by_azimuth, chi_square, distinct, without_mesh  # noqa: E402
from terrain import Terrain  # noqa: E402
from tracing import Directions, Traced, cosine_steps, on_sphere, trace  # noqa: E402

STUDENT_7 = 5.408  # two-sided 1e-3 of Student's t with 7 degrees of freedom


def grid(count: int, length: float, seed: int = 0) -> np.ndarray:
    corners = np.stack(np.meshgrid(np.arange(count), np.arange(count), indexing="ij"), axis=-1).reshape(-1, 2)
    return (corners + np.random.default_rng(seed).uniform(size=corners.shape)) * length / count


def zigzag(n: int, period: int) -> np.ndarray:
    """Grooves along y, walls of one slope."""
    x = np.arange(n)[:, None] % period
    return np.minimum(x, period - x) * np.ones((1, n))


def heights(cells: int, length: int, seed: int = 3) -> np.ndarray:
    return surfaces.Waves.draw(surfaces.gaussian, length, np.random.default_rng(seed)).heights(cells)


def test_a_plane_is_lambert():
    flat = 1e-6 * zigzag(16, 8)
    directions = Directions.of(np.radians([0, 45, 80]), 4)
    traced = trace(Terrain(flat, 4, 1e-9), grid(20, 4), directions, 3, np.random.default_rng(1))
    np.testing.assert_allclose(traced.f[0], 1 / math.pi, rtol=1e-5)
    np.testing.assert_allclose(traced.alb[0], 1, rtol=1e-5)
    assert not traced.f[1:].any()


@pytest.mark.parametrize("degrees", [50, 60, 70, 80])
def test_grooves_seen_by_their_own_light(degrees):
    # From beyond 45 degrees only one wall is seen, and it fills the view: f_1 = cos(theta - 45 deg)/(pi cos(theta)).
    directions = Directions.of(np.radians([degrees]), 4)
    slope = 1 / math.sqrt(2)  # per axis, of walls at 45 degrees to either side
    terrain = Terrain(zigzag(64, 8), 8, slope)
    traced = trace(terrain, grid(300, 8), directions, 1, np.random.default_rng(1))
    expected = math.cos(math.radians(degrees - 45)) / math.cos(math.radians(degrees)) / math.pi
    along, across = directions.column[0, 0], directions.column[0, 1]
    assert traced.f[0][along, along] == pytest.approx(expected, rel=3e-3)
    # Along the grooves both walls are seen whole, but for the valleys' lines: rays start lifted off the surface.
    wall = math.cos(math.radians(degrees)) / math.sqrt(2)
    expected = math.sqrt(2) * wall**2 / math.cos(math.radians(degrees)) ** 2 / math.pi
    assert traced.f[0][across, across] == pytest.approx(expected, rel=5e-4)


@pytest.mark.parametrize("degrees", [60, 80, 89, 89.9])
def test_the_period_has_no_edge(degrees):
    one = heights(4, 10)
    theta, phi = math.radians(degrees), 0.7
    direction = np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])
    start = grid(60, 10)
    hidden = []
    for times in (1, 3):
        terrain = Terrain(np.tile(one, (times, times)), 10 * times, 1.0)
        positions, facets = terrain.drop(start)
        hidden.append(terrain.blocked(positions, facets, direction))
    assert hidden[0].mean() > 0.1
    assert (hidden[0] != hidden[1]).sum() <= 2  # rays that graze an edge within rounding


def test_rays_land_on_the_surface():
    terrain = Terrain(heights(6, 10), 10, 1.0)
    positions, facets = terrain.drop(grid(60, 10))
    rng = np.random.default_rng(2)
    directions = rng.standard_normal((len(facets), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    upward = (directions * terrain.normals[facets]).sum(1, keepdims=True)
    directions *= np.sign(upward)
    points, met = terrain.meet(positions, facets, directions)
    landed = met >= 0
    assert landed[directions[:, 2] < 0].mean() > 0.999
    below, _ = terrain.drop(points[landed][:, :2] % terrain.length)
    np.testing.assert_allclose(below[:, 2], points[landed][:, 2], atol=1e-4)


def test_steps_follow_the_cosine():
    normals = np.broadcast_to([0.6, 0.0, 0.8], (200_000, 3))
    cosine = (cosine_steps(normals, on_sphere(len(normals), np.random.default_rng(6))) * normals).sum(1)
    assert cosine.min() >= 0
    for power in (1, 2, 4):  # five standard errors or more: one seed in a million fails
        assert (cosine**power).mean() == pytest.approx(2 / (power + 2), abs=4e-3)


def test_energy_and_projected_area():
    directions = Directions.of(np.radians([0, 40, 70]), 8)
    traced = trace(Terrain(heights(6, 12), 12, 0.67), grid(120, 12), directions, 24, np.random.default_rng(4))
    np.testing.assert_allclose(traced.alb.sum(0), 1, atol=6e-3)  # of a period, exact but for the points
    np.testing.assert_allclose(traced.f[0], traced.f[0].T, rtol=1e-6)


def test_meshes_of_one_surface_share_their_waves():
    coarse, fine = heights(4, 6), heights(12, 6)
    scale = (fine[::3, ::3] * coarse).sum() / (coarse**2).sum()
    np.testing.assert_allclose(fine[::3, ::3], scale * coarse, atol=1e-9 * abs(fine).max())


@pytest.mark.parametrize("spectrum", [surfaces.gaussian, surfaces.two_scale, surfaces.power_law])
def test_slopes_are_as_asked_and_gaussian(spectrum):
    waves = surfaces.Waves.draw(spectrum, 60, np.random.default_rng(5))
    terrain = Terrain(waves.heights(6), 60, 0.5)
    _, facets = terrain.drop(grid(360, 60))
    slopes = -terrain.normals[facets, :2] / terrain.normals[facets, 2:]
    assert math.sqrt((slopes**2).mean()) == pytest.approx(0.5, rel=2e-3)
    assert (slopes**4).mean() / (slopes**2).mean() ** 2 == pytest.approx(3, abs=0.15)


def test_autocorrelation_of_the_smooth_surface():
    length, cells = 100, 4
    h = heights(cells, length)
    power = np.abs(np.fft.fft2(h)) ** 2
    correlation = np.fft.ifft2(power).real
    lag = np.arange(0, 9)
    expected = np.exp(-((lag / cells) ** 2))
    np.testing.assert_allclose(correlation[0, lag] / correlation[0, 0], expected, atol=0.05)


def test_the_same_seed_gives_the_same_numbers(tmp_path):
    plan = Plan(surfaces=2, length=4, cells=(4, 8), paths=4, bounces=3)
    first, again = (
        carry_out(plan, surfaces.gaussian, 0.67, folder=tmp_path / name, processes=processes).limit
        for name, processes in (("one", 1), ("two", 2))
    )
    np.testing.assert_array_equal(first.f, again.f)
    with pytest.raises(ValueError, match="another plan"):
        carry_out(Plan(2, 4, (4, 8), 5, 3), surfaces.gaussian, 0.67, folder=tmp_path / "one", processes=1)


def test_means_over_azimuth_keep_what_depends_on_the_difference():
    directions = Directions.of(np.radians([0, 30, 70]), 8)
    cosine = directions.unit @ directions.unit.T  # symmetric, and an even function of dphi
    f, _ = by_azimuth(Traced(cosine[None], np.ones((1, len(directions.unit)))), directions)
    theta, dphi = directions.polar, 2 * np.pi * np.arange(8) / 8
    i, r = theta[:, None, None], theta[None, :, None]
    expected = np.sin(i) * np.sin(r) * np.cos(dphi) + np.cos(i) * np.cos(r)
    np.testing.assert_allclose(f[0], expected, atol=1e-12)


def test_the_limit_of_a_quadratic_bias_is_exact():
    coarse, fine = (3.0 + 0.7 * cell**2 for cell in (1 / 8, 1 / 24))
    assert without_mesh(np.array(coarse), np.array(fine), 3) == pytest.approx(3.0, rel=1e-14)


class Bent:
    """Stands for a model: four constants and an occlusion that bend f_1 in ways of their own."""

    constants = (0.5, 0.3, 3.0, 1.0)
    highest_occlusion = 2.0

    def __init__(self, polar: np.ndarray):
        i, r, k = polar[:, None, None], polar[None, :, None], np.arange(16)
        half = np.abs(np.sin(np.pi * k / 16))
        self.shapes = [np.sin(i) * np.sin(r) + 0 * half, (i * r) ** 2 + 0 * half, half * i * r, half * (i * r) ** 3]
        self.local = np.cos(i) * np.cos(r) + 0 * half

    def __call__(self, slope, occlusion, constants, bounces):
        terms = zip(constants, self.shapes, strict=True)
        bend = sum(slope * c * shape for c, shape in terms) + 0.2 * occlusion * self.local
        return np.repeat((np.exp(-0.1 * bend) / math.pi)[None], bounces, axis=0)


def test_calibration_recovers_constants_within_its_errors():
    polar, rng = np.radians([0, 10, 20, 30, 40, 50, 60, 67.5, 75, 80]), np.random.default_rng(8)
    model, true = Bent(polar), np.array([0.45, 0.25, 3.4, 1.3])
    pulls, e_pulls = [], []
    for _ in range(12):
        samples = []
        for slope in (0.3, 1.0):
            common = 1 + 0.002 * rng.standard_normal((20, 1, 1, 1, 1))  # surfaces err in all directions together
            f = model(slope, 1.3, true, 1) * common * (1 + 0.01 * rng.standard_normal((20, 1, 10, 10, 16)))
            samples.append(Sample.of(slope, polar, f, np.ones((20, 1, 10))))
        fit = calibration.occlusion(model, true.tolist(), samples)
        e_pulls.append((fit.values[0] - 1.3) / fit.errors[0])
        smooth = [
            Sample.of(
                x.slope,
                polar,
                x.each * model(x.slope, 1.0, true, 1) / model(x.slope, 1.3, true, 1),
                np.ones((20, 1, 10)),
            )
            for x in samples
        ]
        fit = calibration.constants(model, smooth)
        pulls.append((fit.values - true) / fit.errors)
    # Mean squares of 12 pulls, Student's t of 19 degrees of freedom: one seed in a hundred fails.
    squares = np.append(np.mean(np.square(pulls), axis=0), np.mean(np.square(e_pulls)))
    assert squares.min() > 0.15
    assert squares.max() < 3.3


@pytest.mark.slow
def test_surfaces_traced_by_another_program(tmp_path):
    """A minute. Eight surfaces at 6 cells a correlation length, like those of the file.

    Six means, each by Student's t of our surfaces (the file's errors are smaller): 0.6 % of all seeds would fail.
    """
    plan = Plan(surfaces=8, length=21, cells=(6, 12), paths=6, bounces=24)
    ours = carry_out(plan, surfaces.gaussian, 0.67, folder=tmp_path, processes=2).meshes[6]
    theirs = Sample.load(ROOT / "tests" / "data" / "heightfield_own_0.67.npz")
    for n in range(3):
        for part in (slice(0, 5), slice(5, 10)):  # steep and grazing lights
            each = (ours.each[:, n, part] / theirs.f[n, part]).mean((1, 2, 3))
            t = (each.mean() - 1) / (each.std(ddof=1) / math.sqrt(len(each)))
            assert abs(t) < STUDENT_7, f"f{n + 1}, lights {part}: {each.mean():.4f} of theirs, t = {t:.1f}"
        assert chi_square(ours, theirs, n + 1) < 6
    spread = np.sqrt(np.mean(distinct(ours.f[0] / theirs.f[0] - 1) ** 2))
    assert spread < 0.012  # rms of f_1, all directions; a wrong slope by 3 % gives 0.02
