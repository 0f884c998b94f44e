"""The report of a fit: what it says is what was fitted, and it loads again."""

import json

import numpy as np
import pytest
import torch

from inverse import Distant, FitResult, Scene, Sensor, fit, plan, read_image, render, sphere
from inverse.report import write_report
from torchbrdf import Lambert, OrenNayar, QualitativeOrenNayar

D = torch.float64
SCENE = Scene(sphere(16, 16, dtype=D), [Distant.from_angle(a) for a in (-40, 0, 50)], Sensor(exposure=2.0))
POINTS = int(SCENE.surface.mask.sum())
VALID = SCENE.surface.mask.expand(3, -1, -1)


def painted():
    paint = 0.2 + 0.6 * torch.rand(POINTS, 3, dtype=D, generator=torch.Generator().manual_seed(0))
    photographs = SCENE.sensor.expose(render(SCENE, Lambert(albedo=paint)).detach())
    photographs = photographs * torch.tensor([1.0, 0.5, 0.8])[:, None, None, None] + 0.01
    how = {"free_exposure": True, "free_ambient": True}
    return paint, photographs, fit(SCENE, photographs, Lambert(albedo=torch.full_like(paint, 0.5)), **how)


def test_maps_and_residuals(tmp_path):
    paint, photographs, result = painted()
    write_report(tmp_path, SCENE, photographs, VALID, result)
    assert {path.name for path in tmp_path.iterdir()} == {
        "report.txt", "report.json", "result.pt", "albedo.npy", "albedo_error.npy", "residuals.npy", "residuals.png",
    }  # fmt: skip
    albedo = torch.from_numpy(np.load(tmp_path / "albedo.npy"))
    assert albedo.shape == (16, 16, 3)
    assert albedo[~SCENE.surface.mask].isnan().all()
    lit = result.image("albedo").isfinite()
    torch.testing.assert_close(albedo[lit], result.image("albedo")[lit])
    known = result.parameters["albedo"].isfinite()
    torch.testing.assert_close(result.parameters["albedo"][known], paint[known], rtol=1e-6, atol=0)
    residuals = torch.from_numpy(np.load(tmp_path / "residuals.npy"))  # of another exposure and ambient light each
    assert residuals[~VALID].isnan().all()
    assert residuals[:, SCENE.surface.mask][:, known.all(-1)].abs().max() < 1e-6
    assert json.loads((tmp_path / "report.json").read_text())["status"] == result.status
    assert str(result) == (tmp_path / "report.txt").read_text().rstrip()
    assert read_image(tmp_path / "residuals.png").shape[-1] == 3


def test_a_result_loads_again(tmp_path):
    _, _, result = painted()
    result.save(tmp_path / "r.pt")
    again = FitResult.load(tmp_path / "r.pt", Lambert())
    assert str(again) == str(result)
    assert again.to_json() == result.to_json()
    assert torch.equal(again.model.albedo, result.model.albedo)
    assert torch.equal(again.mask, SCENE.surface.mask)
    assert again.trusted == result.trusted


def test_what_is_no_result_is_refused(tmp_path):
    scene = Scene(sphere(12, 12), [Distant.from_angle(0), Distant.from_angle(40)])
    result = fit(scene, render(scene, OrenNayar(albedo=0.5, sigma=0.5)).detach(), OrenNayar())
    result.save(tmp_path / "r.pt")
    with pytest.raises(ValueError, match=r"r\.pt: holds no result of Lambert"):
        FitResult.load(tmp_path / "r.pt", Lambert())
    assert isinstance(FitResult.load(tmp_path / "r.pt", QualitativeOrenNayar()).model, QualitativeOrenNayar)
    whole = (tmp_path / "r.pt").read_bytes()
    for damaged in (b"", b"text", whole[: len(whole) // 2]):
        (tmp_path / "r.pt").write_bytes(damaged)
        with pytest.raises(ValueError, match=r"r\.pt: holds no result of OrenNayar"):
            FitResult.load(tmp_path / "r.pt", OrenNayar())
    with pytest.raises(OSError, match="no such file"):
        FitResult.load(tmp_path / "absent.pt", OrenNayar())


def test_shared_parameters_are_the_same_all_over_the_object():
    scene = Scene(sphere(12, 12), [Distant.from_angle(0), Distant.from_angle(40)])
    result = fit(scene, render(scene, OrenNayar(albedo=0.5, sigma=0.5)).detach(), OrenNayar())
    image = result.image("sigma")
    assert image.shape == (12, 12, 1)
    assert torch.equal(image.isfinite()[..., 0], scene.surface.mask)
    assert (image[scene.surface.mask] == result.parameters["sigma"]).all()
    assert result.per_texel == ()


def test_no_image_of_several_points_a_pixel():
    scene = Scene(sphere(12, 12, samples=2), [Distant.from_angle(0), Distant.from_angle(40)])
    result = fit(scene, render(scene, Lambert(albedo=0.5)).detach(), Lambert())
    with pytest.raises(ValueError, match="one point a pixel"):
        result.image("albedo")


def test_a_planned_fit_is_saved_without_its_plan(tmp_path):
    scene = Scene(sphere(12, 12), [Distant.from_angle(0), Distant.from_angle(40)])
    truth = OrenNayar(albedo=0.5, sigma=0.5)
    result = plan(scene, truth, 0.05).fit(render(scene, truth).detach())
    result.save(tmp_path / "r.pt")
    again = type(result).load(tmp_path / "r.pt", result.model)
    assert type(again) is FitResult
    assert str(again) == str(result)
