"""`fit` works with every row of the catalog: the truth comes back, or the status names what cannot be told apart."""

import copy

import pytest
import torch
from torch.testing import assert_close

from inverse import Distant, Scene, Sensor, fit, render, sphere
from torchbrdf import Lambert, Mirror, Schlick, trainable

DOUBLE = torch.float64
LIGHTS = [Distant(torch.tensor(d, dtype=DOUBLE)) for d in ((-0.8, 0.3, 0.6), (0.2, -0.3, 1.0), (0.9, 0.4, 0.25))]
SURFACE = sphere(12, 12, dtype=DOUBLE)
# Of photographs without noise, in float64: the largest error found is 3e-13 (the complex index of gold).
RECOVERED = 1e-9
# Parameters that enter the reflectance as one factor, however many photographs there are.
AS_ONE = {
    "oren_nayar, interreflection only": ("albedo", "sigma"),  # rho^2 sigma^2/(sigma^2 + 0.13)
    "weighted sum": ("weights", "albedo"),  # a weight and the albedo of its part
    "coupled": ("albedo", "fresnel.f0"),  # rho (1 - f0) with Schlick's reflectance
    "dampened": ("albedo", "fresnel.f0"),
}


def photographed(brdf):
    """The scene, exposed so that the brightest pixel is at 0.8 of full scale, and its photographs."""
    peak = render(Scene(SURFACE, LIGHTS), brdf).detach().max().item()
    scene = Scene(SURFACE, LIGHTS, Sensor(exposure=0.8 / peak if peak > 0 else 1.0))
    return scene, scene.sensor.expose(render(scene, brdf)).detach()


def displaced(brdf, by=0.3):
    """A start: every unconstrained coordinate moved up or down; 0.3 is up to 7 % of a domain, or a factor 1.35."""
    start, generator = copy.deepcopy(brdf), torch.Generator().manual_seed(0)
    with torch.no_grad():
        for p in start.parameters():
            p.add_(by * (2 * torch.randint(2, p.shape, generator=generator) - 1))
    return start


def values(brdf):
    """The trainable parameters by the names `fit` gives them."""
    return {name: brdf.get_submodule(name.rpartition(".")[0]).material()[name.rpartition(".")[2]].detach()
            for name in trainable(brdf)}  # fmt: skip


def test_truth_comes_back_or_the_status_says_why_not(model):
    truth = model.make(DOUBLE)
    if model.name == "mirror":
        pytest.skip("test_mirror_has_nothing_to_show")
    scene, photographs = photographed(truth)
    start = displaced(truth, 0.03 if model.name in AS_ONE else 0.3)  # a valley takes many steps
    if not trainable(truth):
        with pytest.raises(ValueError, match=f"{type(truth).__name__} has nothing to fit: every parameter is fixed"):
            fit(scene, photographs, start)
        return
    found = fit(scene, photographs, start)
    assert found.residual_rms < RECOVERED
    if model.name in AS_ONE:
        assert found.status == "not identified"
        assert all(name in found.reason for name in AS_ONE[model.name]), found.reason
        return
    assert found.status == "converged"
    for name, value in values(truth).items():
        assert_close(found.parameters[name], value, rtol=RECOVERED, atol=0, msg=lambda m, name=name: f"{name}: {m}")


def test_rows_that_are_told_apart_by_nothing_are_rows():
    from helpers.catalog import MODELS

    assert set(AS_ONE) <= {m.name for m in MODELS}


def test_mirror_has_nothing_to_show():
    mirror = Mirror(fresnel=Schlick(f0=torch.tensor(0.5, dtype=DOUBLE)))
    scene, dark = photographed(mirror)
    with pytest.raises(ValueError, match="photograph 0 is all dark"):
        fit(scene, dark, mirror)
    scene, photographs = photographed(Lambert(albedo=torch.tensor(0.5, dtype=DOUBLE)))
    found = fit(scene, photographs, mirror)
    assert found.status == "not identified"
    assert found.reason == "fresnel.f0 changes nothing in the data"
