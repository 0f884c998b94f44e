"""The iteration ends at the minimum, from afar, with unknowns of every pixel, or says that it did not."""

import math
from itertools import pairwise

import pytest
import torch
from helpers.photographs import LIGHTS, clay, photographed, scene_and_photographs

from inverse import Distant, Scene, Sensor, fit, sphere, vase
from inverse.fitting.levenberg_marquardt import NormalEquations, Residuals, minimise
from torchbrdf import OrenNayar, QualitativeOrenNayar

D = torch.float64


def test_sigma_and_albedo_of_every_pixel():
    lights = [Distant.from_angle(a) for a in (-50, -25, 0, 25, 50)]
    scene = Scene(sphere(24, 24, dtype=D), lights, Sensor(exposure=1.5))
    points = int(scene.surface.mask.sum())
    generator = torch.Generator().manual_seed(0)
    truth = QualitativeOrenNayar(
        albedo=0.3 + 0.5 * torch.rand(points, 1, dtype=D, generator=generator),
        sigma=0.2 + 0.6 * torch.rand(points, dtype=D, generator=generator),
    )
    start = QualitativeOrenNayar(albedo=torch.full((points, 1), 0.5), sigma=torch.full((points,), 0.4))
    found = fit(scene, photographed(scene, truth), start)
    central = scene.surface.normals[scene.surface.mask][:, 2] > 0.6  # well seen under all lights
    torch.testing.assert_close(found.parameters["sigma"][central], truth.sigma.detach()[central], rtol=1e-4, atol=0)


def test_out_of_steps_is_a_status():
    scene = Scene(vase(32, 32, dtype=D), LIGHTS, Sensor(exposure=3.0))
    found = fit(scene, photographed(scene, clay()), OrenNayar(), max_steps=1)
    assert found.status == "out of steps"


def test_every_random_start_ends_at_the_optimum_or_says_it_did_not():
    surface = sphere(24, 24, dtype=D)
    scene, photographs = scene_and_photographs([0, 20], surface=surface, sigma=0.7)
    best = fit(scene, photographs, OrenNayar()).residual_rms
    generator = torch.Generator().manual_seed(0)
    for _ in range(30):
        albedo, share = torch.rand(2, generator=generator, dtype=D) * 0.98 + 0.01
        found = fit(scene, photographs, OrenNayar(albedo=albedo, sigma=share * math.pi / 2))
        assert found.residual_rms == pytest.approx(best, rel=1e-6)
        assert found.status == "converged"


@pytest.mark.parametrize("exposure", [60.0, 300.0])
def test_a_start_far_too_bright_does_not_stop_early(exposure):
    surface = sphere(96, 96)
    scene, photographs = scene_and_photographs(
        [0, 20], surface=surface, noise=1e-3, albedo=2.1 / exposure, exposure=exposure
    )
    found = fit(scene, photographs.float(), OrenNayar(), valid=photographs[..., 0] > 0.02)
    assert abs(found.parameters["sigma"].item() - 0.5) < 4 * found.standard_error["sigma"].item()


def test_normal_equations_of_a_model_that_may_write_into_its_tensors():
    shared, own = torch.tensor([0.3, -0.7], dtype=D), torch.linspace(-1, 1, 5, dtype=D)[:, None]

    def plain(shared, own):
        return torch.stack((shared[0].exp() * own, shared.prod() - own**2))

    def written(shared, own):
        values = torch.zeros(2, 5, 1, dtype=D)
        return values.add_(plain(shared, own))

    one, other = (NormalEquations.of(Residuals(k), shared, own) for k in (plain, written))
    a, b, y = shared[0].exp(), shared.flip(0), own
    by_shared = torch.stack((torch.stack((a * y, b[0] + 0 * y)), torch.stack((0 * y, b[1] + 0 * y))))
    by_own = torch.stack((a + 0 * y, -2 * y))
    for equations in (one, other):
        torch.testing.assert_close(equations.shared, torch.einsum("ginc,hinc->gh", by_shared, by_shared))
        torch.testing.assert_close(equations.own[:, 0], by_own.square().sum((0, 2))[:, None])
        torch.testing.assert_close(equations.mixed[..., 0], torch.einsum("ginc,inc->ng", by_shared, by_own))


# Without photographs: problems whose minimum is known


def linear_problem(pixels, shared, own, channels=2, images=5):
    """Residuals that are linear in all unknowns, and the same as one dense matrix and its right side."""
    generator = torch.Generator().manual_seed(4)
    rows = (images, pixels, channels)
    by_shared = torch.randn(*rows, shared, dtype=D, generator=generator)
    by_own = torch.randn(*rows, own, dtype=D, generator=generator)
    constant = torch.randn(*rows, dtype=D, generator=generator)

    def residual(x, y):
        return by_shared @ x + torch.einsum("ipcl,pl->ipc", by_own, y) + constant

    own_columns = torch.zeros(*rows, pixels, own, dtype=D)
    for k in range(pixels):
        own_columns[:, k, :, k] = by_own[:, k]
    dense = torch.cat((by_shared.flatten(0, 2), own_columns.flatten(0, 2).flatten(1)), 1)
    return residual, dense, constant.flatten()


@pytest.mark.parametrize(("pixels", "shared", "own"), [(7, 3, 2), (1, 4, 0), (6, 0, 2)])
def test_linear_problem_against_dense_algebra(pixels, shared, own):
    residual, dense, constant = linear_problem(pixels, shared, own)
    x, y = torch.zeros(shared, dtype=D), torch.zeros(pixels, own, dtype=D)
    wanted = torch.linalg.lstsq(dense, -constant[:, None]).solution[:, 0]
    solved = minimise(Residuals(residual), x, y, max_steps=50)
    assert solved.status == "converged"
    torch.testing.assert_close(torch.cat((solved.shared, solved.own.flatten())), wanted, rtol=0, atol=1e-9)
    equations = solved.equations
    normal = dense.T @ dense
    torch.testing.assert_close(equations.shared, normal[:shared, :shared])
    for k in range(pixels):
        mine = slice(shared + own * k, shared + own * (k + 1))
        torch.testing.assert_close(equations.own[k], normal[mine, mine])
        torch.testing.assert_close(equations.mixed[k], normal[:shared, mine])


def test_predicted_decrease_of_a_linear_problem_is_exact():
    residual, _, _ = linear_problem(5, 2, 1)
    x, y = torch.zeros(2, dtype=D), torch.zeros(5, 1, dtype=D)
    equations = NormalEquations.of(Residuals(residual), x, y)
    for damping in (0.0, 0.1, 10.0):
        dx, dy = equations.step(damping)
        fell = residual(x, y).square().sum() - residual(x + dx, y + dy).square().sum()
        assert equations.predicted_decrease(dx, dy) == pytest.approx(fell.item(), rel=1e-10)


def test_a_bent_valley_is_followed_to_its_end():
    """Rosenbrock's function, from his start: 10 (y - x^2) and 1 - x are 0 at (1, 1)."""

    def residual(shared, own):
        x, y = shared
        return torch.stack((10 * (y - x * x), 1 - x))[None, :, None]

    solved = minimise(
        Residuals(residual), torch.tensor([-1.2, 1.0], dtype=D), torch.zeros(2, 0, dtype=D), max_steps=100
    )
    assert solved.status == "converged"
    torch.testing.assert_close(solved.shared, torch.ones(2, dtype=D), rtol=0, atol=1e-8)
    assert all(later <= earlier for earlier, later in pairwise(solved.history))
