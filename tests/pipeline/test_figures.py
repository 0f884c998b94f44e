"""Figures show the numbers they were given, and leave pyplot and its backend alone."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from matplotlib.figure import Figure

from inverse import Distant, Scene, render, sphere
from inverse.figures import fit_figure, measurement_figure, residual_figure
from torchbrdf import Lambert


@pytest.fixture(scope="module")
def scene():
    return Scene(sphere(32, 32), [Distant.from_angle(0), Distant.from_angle(30)])


@pytest.fixture(scope="module")
def photographs(scene):
    return render(scene, Lambert(albedo=0.6)).detach()


def test_importing_figures_chooses_no_backend():
    code = "import sys, inverse.figures; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2], check=False).returncode == 0


def test_fit_figure_shows_images_on_one_scale_and_their_sections(scene, photographs, tmp_path):
    figure = fit_figure(
        scene.surface, photographs, {"darker": 0.5 * photographs}, ["light 0", "light 30"], title="a title"
    )
    assert isinstance(figure, Figure)
    images = [axis.images[0].get_array() for axis in figure.axes if axis.images]
    assert [image.max() for image in images] == pytest.approx([1, 0.5, 1, 0.5])
    sections = [axis for axis in figure.axes if not axis.images]
    assert [axis.get_title() for axis in sections] == [
        "(a) cross-section of the belly, light 0",
        "(b) cross-section of the belly, light 30",
    ]
    for axis in sections:
        seen, fitted = (line.get_ydata() for line in axis.lines)
        np.testing.assert_allclose(fitted, 0.5 * seen, rtol=1e-6)
    figure.savefig(tmp_path / "fit.png")
    assert (tmp_path / "fit.png").stat().st_size > 1000


def test_residual_figure_tells_the_rms_of_what_was_fitted(scene, photographs):
    valid = (photographs[..., 0] > 0) & (scene.surface.coverage() == 1)
    figure = residual_figure(scene, photographs, {"half": 0.5 * photographs, "all": 0.9 * photographs}, valid)
    titles = [axis.get_title() for axis in figure.axes]
    rms = photographs[..., 0][valid].square().mean().sqrt().item()
    assert f"minus half, rms {0.5 * rms:.4f}" in titles
    assert f"minus all, rms {0.1 * rms:.4f}" in titles
    (curves,) = (axis for axis in figure.axes if axis.get_xlabel() == "angle of the light [deg]")
    half = curves.lines[0]
    assert half.get_label() == "half"
    # what is left of Lambert is a cosine of the angle of the light; it varies by up to 0.008 over a bin of 5 degrees
    expected = 0.5 * 0.6 / np.pi * np.cos(np.radians(half.get_xdata()))
    np.testing.assert_allclose(half.get_ydata(), expected, atol=0.002)


def test_measurement_figure_draws_curves_in_order_and_writes_the_shares():
    angle, brdf = torch.tensor([30.0, -10.0, 0.0]), torch.tensor([0.3, 0.1, 0.2])
    curves = {"paint": {"measured": (angle, brdf), "Lambert": (angle, 2 * brdf)}}
    figure = measurement_figure(curves, {"Lambert": {"paint": 63.4}, "GGX": {"paint": 12.0}})
    plot, table = figure.axes
    assert plot.lines[0].get_xdata().tolist() == [-10, 0, 30]
    assert plot.lines[1].get_ydata() == pytest.approx([0.2, 0.4, 0.6])
    assert plot.get_ylabel() == "f_r [1/sr]"
    assert [text.get_text() for text in table.texts] == ["63", "12"]
