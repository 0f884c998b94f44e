"""Sums of products hold all that a fit needs: the same minimum, errors and cost as from the pixels themselves."""

import pytest
import torch
from helpers.photographs import LIGHTS

from inverse import Ambient, Distant, Scene, Sensor, fit, plane, render, sphere
from inverse.fitting.gram import condensed, gram
from inverse.fitting.levenberg_marquardt import NormalEquations, Residuals
from inverse.fitting.prediction import predictor
from inverse.fitting.unknowns import Unknowns
from torchbrdf import EON, OrenNayar, RoughSurface

D = torch.float64
COLOURED = Distant(torch.tensor([0.5, 0.3, 0.8], dtype=D), torch.tensor([1.0, 0.7, 0.4], dtype=D))


def number(value):
    return torch.tensor(value, dtype=D)


def problem(make, lights, seed=0):
    """Both forms of the residuals of noisy photographs with samples left out at random."""
    generator = torch.Generator().manual_seed(seed)
    scene = Scene(sphere(14, 14, dtype=D), lights, Sensor(exposure=2.0))
    model = make(albedo=number([0.7, 0.4, 0.2]), sigma=number(0.5))
    pixels = scene.surface.mask
    unknowns = Unknowns(model, torch.arange(int(pixels.sum())), int(pixels.sum()), len(lights),
                        free_exposure=True, free_ambient=True)  # fmt: skip
    of_material = predictor(scene, model, pixels, per_texel=False)
    clean = of_material(dict(model.named_parameters())).detach()
    recorded = clean + 0.01 * torch.randn(clean.shape, generator=generator, dtype=D)
    used = torch.rand(clean.shape, generator=generator) < 0.8
    assert of_material.basis is not None
    assert of_material.coefficients is not None

    def direct(shared, own):
        raw, exposure, ambient = unknowns.unpack(shared, own)
        return (of_material(raw) * exposure[:, None, None] + ambient[:, None, None] - recorded) * used

    small = condensed(of_material.basis, of_material.coefficients, unknowns, recorded, used)
    return Residuals(direct), small, unknowns.pack(), generator


@pytest.mark.parametrize("make", [OrenNayar, lambda **k: RoughSurface(**k, nodes=4)])
@pytest.mark.parametrize("lights", [LIGHTS[:2], [COLOURED, LIGHTS[0]]], ids=["white", "coloured"])
def test_condensed_residuals_have_the_sums_of_the_pixels(make, lights):
    direct, (small, nothing), (shared, own), generator = problem(make, lights)
    for _ in range(3):
        at = shared + 0.3 * torch.randn(shared.shape, generator=generator, dtype=D)
        of_pixels, of_sums = NormalEquations.of(direct, at, own), NormalEquations.of(small, at, nothing)
        assert of_sums.cost == pytest.approx(of_pixels.cost, rel=1e-10)
        torch.testing.assert_close(of_sums.shared, of_pixels.shared, rtol=1e-9, atol=1e-11)
        torch.testing.assert_close(of_sums.shared_gradient, of_pixels.shared_gradient, rtol=1e-9, atol=1e-11)


def test_sums_in_pieces_and_by_channel_are_the_sums_of_products():
    generator = torch.Generator().manual_seed(1)
    basis, recorded = (torch.randn(40000, 1, 5, generator=generator), torch.rand(40000, 3, generator=generator))
    for used in (torch.rand(40000, 1, generator=generator) < 0.5, torch.rand(40000, 3, generator=generator) < 0.5):
        sums = gram(basis, recorded, used.expand(-1, 3))
        for c in range(3):
            kept = used.expand(-1, 3)[:, c]
            columns = torch.cat((basis[kept, 0], torch.ones(int(kept.sum()), 1), recorded[kept, c, None]), 1).double()
            torch.testing.assert_close(sums[c], columns.mT @ columns, rtol=1e-12, atol=1e-8)


@pytest.mark.parametrize("how", [{}, {"free_exposure": True, "free_ambient": True}])
def test_a_fit_is_that_of_the_pixels(how):
    """An ambient light of radiance 0 forbids the sums: the same fit goes through every pixel."""
    surface = sphere(24, 24, dtype=D)
    sensor = Sensor(exposure=2.0, read_noise=0.003)
    lights = [Distant.from_angle(a) for a in (-50, 0, 35)]
    condensable = Scene(surface, lights, sensor)
    direct = Scene(surface, [[light, Ambient(0.0)] for light in lights], sensor)
    truth = OrenNayar(albedo=number([0.6, 0.3]), sigma=number(0.5))
    photographs = sensor.expose(render(condensable, truth).detach(), torch.Generator().manual_seed(3))
    start = OrenNayar(albedo=number([0.5, 0.5]), sigma=number(0.3))
    one, other = (fit(scene, photographs, start, **how) for scene in (condensable, direct))
    for name, value in one.parameters.items():
        torch.testing.assert_close(value, other.parameters[name], rtol=1e-9, atol=1e-10)
        torch.testing.assert_close(one.standard_error[name], other.standard_error[name], rtol=1e-6, atol=0)
    assert (one.status, one.samples, one.clipped) == (other.status, other.samples, other.clipped)
    assert one.residual_rms == pytest.approx(other.residual_rms, rel=1e-9)


def test_a_perfect_fit_is_not_chased():
    """A plane under one light: every pixel is the same, and rounding of the sums is all that is left."""
    scene = Scene(plane(24, 24, dtype=D), [Distant.from_angle(0)], Sensor(exposure=3.0))
    photographs = render(scene, OrenNayar(albedo=number(0.7), sigma=number(0.7))).detach() * 3
    result = fit(scene, photographs, OrenNayar(albedo=number([0.5]), sigma=number(0.3)))
    assert result.status == "not identified"
    assert result.iterations < 15


def test_models_without_a_basis_and_per_texel_materials_go_through_the_pixels():
    scene = Scene(sphere(12, 12, dtype=D), LIGHTS[:3])
    points = int(scene.surface.mask.sum())
    truth = EON(albedo=number(0.6), roughness=number(0.4))
    result = fit(scene, render(scene, truth).detach(), EON(albedo=number(0.5), roughness=number(0.5)))
    assert result.parameters["roughness"].item() == pytest.approx(0.4, rel=1e-6)
    paint = 0.3 + 0.5 * torch.rand(points, 1, dtype=D, generator=torch.Generator().manual_seed(0))
    photographs = render(scene, OrenNayar(albedo=paint, sigma=number(0.5))).detach()
    result = fit(scene, photographs, OrenNayar(albedo=torch.full_like(paint, 0.5), sigma=number(0.3)))
    assert result.parameters["sigma"].item() == pytest.approx(0.5, rel=1e-6)
