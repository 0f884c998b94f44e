"""The examples run at reduced size and print what they promise."""

import json
import os
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

import torchbrdf
from torchbrdf import BRDF
from torchbrdf import testing as laws

EXAMPLES = Path(__file__).parents[3] / "examples"
RECORD = EXAMPLES.parent / "docs" / "figures" / "ladder.json"
MEASURED = "TORCHBRDF_CORNELL"  # environment variable: the folder of the measured paints, which are not ours to ship


@pytest.fixture
def load(monkeypatch):
    """The names of an example, without running its `main`."""

    def names(name, run_name="imported"):
        monkeypatch.syspath_prepend(str((EXAMPLES / name).parent))  # as python does for a script
        return runpy.run_path(str(EXAMPLES / name), run_name=run_name)

    return names


@pytest.fixture
def run(monkeypatch, capsys, load):
    def printed(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        load(name, "__main__")
        return capsys.readouterr().out

    return printed


def numbers(line):
    return [float(k) for k in re.findall(r"[-+]?\d+\.\d+", line)]


def test_first_steps(run):
    printed = run("00_first_steps.py")
    for name in ("Adam", "LBFGS"):
        (line,) = (line for line in printed.splitlines() if line.startswith(name))
        assert numbers(line)[0] == pytest.approx(40, abs=0.02)


@pytest.mark.parametrize("backend", ["aot_eager", pytest.param("inductor", marks=pytest.mark.slow)])
def test_compiled_fit_finds_most_pixels(run, backend):
    torch.compiler.reset()
    printed = run("06_compiled_fit.py", "--pixels", 500, "--steps", 200, "--backend", backend).splitlines()
    sigma, albedo = numbers(printed[-1])
    assert sigma < 0.02
    assert albedo < 0.01


def test_vase_fit_recovers_the_clay_and_lambert_fails_as_the_paper_says(run, tmp_path):
    printed = run("01_fit_vase.py", "--size", 96, "--output", tmp_path).splitlines()
    exact = next(x for x in printed if x.startswith("interpolated, all"))
    sigma, sigma_error, albedo, albedo_error, *_ = numbers(exact)
    assert abs(sigma - 40) < 4 * sigma_error
    assert abs(albedo - 0.7) < 4 * albedo_error
    assert sigma_error < 0.3
    straight, oblique = (k for k, line in enumerate(printed) if line.startswith("  light"))
    # the numbers of a line: (displacement,) -0.9, brightness there, +0.9, brightness there, rms
    limb = {line.split()[0]: numbers(line) for line in printed[straight + 1 : straight + 3]}
    assert limb["Lambert"][1] < 0.5
    assert limb["interpolated"][1] > 0.7
    displaced = {line.split()[0]: numbers(line)[0] for line in printed[oblique + 1 : oblique + 3]}
    assert displaced["Lambert"] < -0.2
    assert abs(displaced["interpolated"]) < 0.1
    with Image.open(tmp_path / "vase_fit.png") as figure:
        assert 900 < figure.size[0] < 1100


def test_photographs_are_written_read_and_fitted(run, tmp_path):
    for _ in range(2):  # nothing of the first run is in the way of the second
        printed = run("02_fit_photographs.py", "--size", 48, "--refits", 3, "--output", tmp_path)
    line = next(x for x in printed.splitlines() if x.startswith("sigma") and "deg" in x)
    assert numbers(line)[0] == pytest.approx(15, abs=3)
    albedo = [numbers(x)[0] for x in printed.splitlines() if x.startswith("albedo")]
    assert albedo[-1] == pytest.approx(0.5, abs=0.01)
    assert [path.name for path in tmp_path.iterdir()] == ["photographs_fit.png"]


def test_ladder_is_measured_and_drawn(run, tmp_path):
    rungs = ("Lambert", "functional", "fast, all bounces", "exact, K = 16, 2 bounces")
    printed = run("benchmarks/ladder.py", "--directions", 40, "--size", 12, "--output", tmp_path, "--rungs", *rungs)
    rows = json.loads((tmp_path / "ladder_eager.json").read_text())["rows"]
    assert [row["name"] for row in rows] == list(rungs)
    assert rows[2]["rms_error"] < 0.1 * rows[1]["rms_error"]
    assert rows[2]["sigma_bias"] < rows[1]["sigma_bias"]
    assert "| Lambert |" in printed.replace("*", "")
    assert (tmp_path / "ladder_eager.png").exists()


def test_every_model_is_timed(run):
    printed = dict(line.split()[:2] for line in run("benchmarks/cost_of_models.py", "--points", 200).splitlines())
    models = {name for name, kind in vars(torchbrdf).items() if isinstance(kind, type) and issubclass(kind, BRDF)}
    assert set(printed) == models - {"BRDF", "FieldBRDF", "LinearBRDF", "ImageBRDF", "WeightedSum", "Oriented"}
    assert next(iter(printed.items())) == ("Lambert", "1")
    assert float(printed["RoughSurface"]) > float(printed["OrenNayar"])


def test_models_are_timed_against_the_code_by_hand(run):
    printed = run("benchmarks/eager.py", "--pixels", 64, "--repeats", 1)
    rows = dict(line.strip("| ").split(" | ", 1) for line in printed.splitlines() if " x | " in line)
    assert rows["by hand"].startswith("1.00 x | 1.00 x")
    assert {"OrenNayar", "EON", "FastGaussianHeightfield"} <= rows.keys()


def test_pictures_and_their_shadows_are_timed(run):
    printed = run("benchmarks/pictures.py", "--size", 24, "--repeats", 1)
    rows = [line.strip("| ").split(" | ") for line in printed.splitlines() if line[-3:-2].isdigit()]
    assert [row[0] for row in rows] == [
        "vase",
        "two spheres on a plane",
        "vase's depth map",
        *["vase", "vase", "sphere", "sphere"],
    ]
    assert all(float(number) > 0 for row in rows for number in row[1:])


def test_the_code_by_hand_is_the_functional_model(load):
    """Away from the normal, where it has its faults."""
    by_hand = load("benchmarks/naive.py")["naive_oren_nayar"]
    normal, light, view = laws.random_directions(200, generator=torch.Generator().manual_seed(1))
    sigma, albedo = torch.full((200,), 0.6), torch.tensor([0.8, 0.3]).expand(200, 2)
    model = torchbrdf.OrenNayar(albedo=albedo[0], sigma=0.6)
    torch.testing.assert_close(
        by_hand(normal, light, view, sigma, albedo), model(normal, light, view), rtol=1e-3, atol=1e-4
    )


def test_schemes_of_the_series_are_measured_and_drawn(run, tmp_path):
    printed = run("benchmarks/series.py", "--points", 2000, "--output", tmp_path)
    shipped = next(line for line in printed.splitlines() if line.startswith("| as shipped"))
    assert "| 0.00% |" in shipped
    assert (tmp_path / "series.png").exists()


def test_figures_of_the_paper(run, tmp_path):
    printed = run("figures/oren_nayar.py", "--size", 16, "--points", 9, "--output", tmp_path).split()
    assert len(printed) == 12
    assert all(Path(name).exists() for name in printed)


def test_gallery_shows_every_model_asked_for(run, tmp_path):
    printed = run("03_model_gallery.py", "--size", 8, "--points", 9, "--models", 23, "--output", tmp_path).splitlines()
    assert len(printed) == 24
    with Image.open(tmp_path / "model_gallery.png") as picture:
        assert 900 < picture.size[0] < 1100  # shown about 900 wide: letters keep their size


def test_gallery_leaves_no_model_out(load):
    gallery = load("03_model_gallery.py")["MODELS"]
    shown = {type(part).__name__ for model in gallery.values() for part in model.modules()}
    library = {name for name in torchbrdf.__all__ if isinstance(getattr(torchbrdf, name), type)}
    models = {name for name in library if issubclass(getattr(torchbrdf, name), BRDF)}
    tables = {"InterpolatedRoughSurface", "InterpolatedGaussianHeightfield"}  # look like what they stand for
    assert models - shown <= {"BRDF", "FieldBRDF", "ImageBRDF", "LinearBRDF"} | tables


def test_he_torrance_figures_say_which_claims_hold(run, tmp_path):
    printed = run("figures/he_torrance_lobes.py", "--points", 41, "--output", tmp_path).splitlines()
    verdict = {line.rsplit(": ", 1)[0]: line.rsplit(": ", 1)[1] for line in printed if line.startswith("Figure")}
    assert {v for claim, v in verdict.items() if claim.startswith("Figure 9")} == {"does NOT hold"}
    assert {v for claim, v in verdict.items() if not claim.startswith("Figure 9")} == {"holds"}
    assert len(verdict) == 6
    assert "exceeds the energy bound" in printed[0]
    assert (tmp_path / "he_torrance_lobes.png").exists()


def test_cylinders_of_growing_roughness(run, tmp_path):
    assert len(run("figures/he_torrance_cylinders.py", "--size", 10, "--output", tmp_path).splitlines()) == 9
    with Image.open(tmp_path / "he_torrance_cylinders.png") as picture:
        assert picture.size[0] > 600


def test_paints_are_fitted_and_called_glossy(run, tmp_path):
    names = ("Lambert", "Lambert + GGX")
    if MEASURED not in os.environ:
        pytest.skip(f"the measured paints are not at hand: {MEASURED} names no folder")
    printed = run(
        "benchmarks/measured_paints.py",
        os.environ[MEASURED],
        *("--paints", 1, "--models", *names, "--output", tmp_path),
    )
    rows = {name: next(x for x in printed.splitlines() if x.startswith(f"{name:<20}")) for name in names}
    matte, glossy = (int(row[29:].split("/")[0]) for row in rows.values())
    assert glossy < 0.7 * matte
    assert "acryl_blue is glossy" in printed
    assert (tmp_path / "measured_paints.png").exists()


def test_paints_that_are_not_there(run, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        run("benchmarks/measured_paints.py", tmp_path)
    assert ended.value.code == 2
    assert f"no .brdf files in {tmp_path}" in capsys.readouterr().err


def test_laws_catch_the_broken_brdfs_and_pass_the_corrected_one(run):
    printed = run("05_check_your_brdf.py").splitlines()
    table = {line[:20].strip(): line[20:].split() for line in printed[: printed.index("")]}
    assert table.pop("law") == ["FromAngles", "Varnished", "Corrected"]
    caught = {
        title: {law for law, row in table.items() if row[k] == "broken"} for k, title in enumerate(("a", "v", "c"))
    }
    assert caught == {"a": {"energy", "dark below horizon", "finite"}, "v": {"reciprocal", "energy"}, "c": set()}
    in_degrees, in_radians = (float(line.split()[-1]) for line in printed[-2:])
    assert in_degrees > 0.2
    assert in_radians < 1e-6


def test_plans_of_three_scenes(run, tmp_path):
    printed = run("04_only_what_matters.py", "--size", 24, "--tolerance", 0.02, "--output", tmp_path)
    shares = [float(line.split()[5].rstrip("%;")) for line in printed.splitlines() if line.startswith("largest error")]
    assert len(shares) == 3
    assert max(shares) < 2
    assert (tmp_path / "only_what_matters.png").exists()


def test_plans_of_a_grid(run):
    printed = run("benchmarks/plans.py", "--size", 24, "--scenes", 2)
    assert [line.split()[1] for line in printed.splitlines()] == ["10.0%:", "1.0%:", "0.1%:"]


def test_no_label_of_the_ladder_covers_another(load):
    example = load("benchmarks/ladder.py")
    record = json.loads(RECORD.read_text())
    assert {row["name"] for row in record["rows"]} <= {rung.name for rung in example["RUNGS"]}
    figure = example["draw"](record["rows"], record["machine"])
    (axis,) = figure.axes
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axis.texts]
    assert len(boxes) == 9  # the Pareto front of the record
    inside = axis.get_window_extent()
    for k, box in enumerate(boxes):
        assert inside.x0 < box.x0
        assert inside.y0 < box.y0
        assert not any(box.overlaps(other) for other in boxes[:k])
    points = np.concatenate([axis.transData.transform(line.get_xydata()) for line in axis.lines if line.get_marker()])
    assert not any(box.contains(*point) for box in boxes for point in points)


def test_figure_10_of_oren_and_nayar_shows_the_brdf(load):
    """Close to Lambertian where the light is normal, and backscatter that grows with the angle of the light."""
    example = load("figures/oren_nayar.py")
    theta_r = torch.tensor([-60.0, -30.0, 0.0, 30.0, 60.0])
    curves = example["curves"]()
    (axis,) = example["draw"](10, curves[10], theta_r).axes
    assert axis.get_ylabel() == "BRDF [1/sr]"
    straight, *oblique = (torch.tensor(line.get_ydata()) for line in axis.lines)
    assert straight.max() / straight.min() < 1.15
    asymmetry = [(f[4] / f[0]).item() for f in oblique]  # towards the light over away from it
    assert asymmetry == sorted(asymmetry)
    assert asymmetry[0] > 1.15
    # reciprocity tells the BRDF from the radiance: light at 30 seen at 60 is light at 60 seen at 30
    at_30, at_60, _ = oblique
    assert at_30[4] == pytest.approx(at_60[3].item(), rel=1e-4)
    assert at_30[0] == pytest.approx(at_60[1].item(), rel=1e-4)
    model = curves[10].lines[2][1]
    assert example["radiance"](model, 60, 0, theta_r)[3] == pytest.approx(0.5 * at_30[4].item(), rel=1e-4)


def test_no_example_chooses_a_backend_or_points_outside():
    for path in EXAMPLES.rglob("*.py"):
        for forbidden in ("pyplot", "matplotlib.use", "../", '"/'):
            assert forbidden not in path.read_text(), f"{path.name}: {forbidden}"


def test_what_users_read_is_short_and_numbered_once():
    scripts = sorted(EXAMPLES.glob("[0-9]*.py"))
    assert [path.name[:2] for path in scripts] == [f"{k:02d}" for k in range(len(scripts))]
    assert all(len(path.read_text().splitlines()) < 100 for path in scripts)
