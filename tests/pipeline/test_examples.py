"""The examples run at reduced size and print what they promise."""

import json
import re
import runpy
import sys
from pathlib import Path

import pytest
from PIL import Image

import torchbrdf
from torchbrdf import BRDF

EXAMPLES = Path(__file__).parents[2] / "examples"
CORNELL = Path(__file__).parents[3] / "shared" / "data" / "cornell_brdf"


@pytest.fixture
def run(monkeypatch, capsys):
    def run_example(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run_example


def numbers(line):
    return [float(k) for k in re.findall(r"[-+]?\d+\.\d+", line)]


def test_first_steps(run):
    printed = run("00_first_steps.py")
    for name in ("Adam", "LBFGS"):
        (line,) = (line for line in printed.splitlines() if line.startswith(name))
        assert numbers(line)[0] == pytest.approx(40, abs=0.02)


def test_vase_fit_recovers_the_clay_and_lambert_fails_as_the_paper_says(run, tmp_path):
    printed = run("01_fit_vase.py", "--size", 96, "--output", tmp_path).splitlines()
    exact = next(x for x in printed if x.startswith("exact, K = 16, all"))
    sigma, sigma_error, albedo, albedo_error, *_ = numbers(exact)
    assert abs(sigma - 40) < 4 * sigma_error
    assert abs(albedo - 0.7) < 4 * albedo_error
    assert sigma_error < 0.3
    straight, oblique = (k for k, line in enumerate(printed) if line.startswith("  light"))
    # the numbers of a line: (displacement,) -0.9, brightness there, +0.9, brightness there, rms
    limb = {line.split()[0]: numbers(line) for line in printed[straight + 1 : straight + 3]}
    assert limb["Lambert"][1] < 0.5
    assert limb["exact"][1] > 0.7
    displaced = {line.split()[0]: numbers(line)[0] for line in printed[oblique + 1 : oblique + 3]}
    assert displaced["Lambert"] < -0.2
    assert abs(displaced["exact"]) < 0.1
    with Image.open(tmp_path / "vase_fit.png") as figure:
        assert figure.size[0] > 1000


def test_photographs_are_written_read_and_fitted(run, tmp_path):
    printed = run("02_fit_photographs.py", "--synthetic", "--size", 48, "--refits", 3, "--output", tmp_path)
    line = next(x for x in printed.splitlines() if x.startswith("sigma") and "deg" in x)
    assert numbers(line)[0] == pytest.approx(15, abs=3)
    assert (tmp_path / "photographs_fit.png").exists()


def test_ladder_is_measured_and_drawn(run, tmp_path):
    rungs = ("Lambert", "functional", "fast, all bounces", "exact, K = 16, 2 bounces")
    printed = run("03_accuracy_vs_time.py", "--directions", 40, "--size", 12, "--output", tmp_path, "--rungs", *rungs)
    rows = json.loads((tmp_path / "ladder_eager.json").read_text())["rows"]
    assert [row["name"] for row in rows] == list(rungs)
    assert rows[2]["rms_error"] < 0.1 * rows[1]["rms_error"]
    assert rows[2]["sigma_bias"] < rows[1]["sigma_bias"]
    assert "| Lambert |" in printed.replace("*", "")
    assert (tmp_path / "ladder_eager.png").exists()


def test_every_model_is_timed(run):
    printed = dict(line.split()[:2] for line in run("03_accuracy_vs_time.py", "--models", "--points", 200).splitlines())
    models = {name for name, kind in vars(torchbrdf).items() if isinstance(kind, type) and issubclass(kind, BRDF)}
    assert set(printed) == models - {"BRDF", "LinearBRDF", "ImageBRDF", "WeightedSum", "Oriented"}
    assert next(iter(printed.items())) == ("Lambert", "1")
    assert float(printed["RoughSurface"]) > float(printed["OrenNayar"])


def test_schemes_of_the_series_are_measured_and_drawn(run, tmp_path):
    printed = run("03_accuracy_vs_time.py", "--series", "--points", 2000, "--output", tmp_path)
    shipped = next(line for line in printed.splitlines() if line.startswith("| as shipped"))
    assert "| 0.00% |" in shipped
    assert (tmp_path / "series.png").exists()


def test_figures_of_the_paper(run, tmp_path):
    printed = run("04_paper_figures.py", "--size", 16, "--points", 9, "--output", tmp_path).split()
    assert len(printed) == 12
    assert all(Path(name).exists() for name in printed)


def test_gallery_shows_every_model_asked_for(run, tmp_path):
    printed = run("05_model_gallery.py", "--size", 8, "--points", 9, "--models", 23, "--output", tmp_path).splitlines()
    assert len(printed) == 24
    with Image.open(tmp_path / "model_gallery.png") as picture:
        assert picture.size[0] > 1000


def test_gallery_leaves_no_model_out():
    gallery = runpy.run_path(str(EXAMPLES / "05_model_gallery.py"))["MODELS"]
    shown = {type(part).__name__ for model in gallery.values() for part in model.modules()}
    library = {name for name in torchbrdf.__all__ if isinstance(getattr(torchbrdf, name), type)}
    models = {name for name in library if issubclass(getattr(torchbrdf, name), BRDF)}
    assert models - shown <= {"BRDF", "ImageBRDF", "LinearBRDF"}


def test_he_torrance_figures_say_which_claims_hold(run, tmp_path):
    printed = run("06_he_torrance_figures.py", "--points", 41, "--output", tmp_path).splitlines()
    verdict = {line.rsplit(": ", 1)[0]: line.rsplit(": ", 1)[1] for line in printed if line.startswith("Figure")}
    assert {v for claim, v in verdict.items() if claim.startswith("Figure 9")} == {"does NOT hold"}
    assert {v for claim, v in verdict.items() if not claim.startswith("Figure 9")} == {"holds"}
    assert len(verdict) == 6
    assert "exceeds the energy bound" in printed[0]
    assert (tmp_path / "he_torrance_lobes.png").exists()


def test_cylinders_of_growing_roughness(run, tmp_path):
    assert len(run("06_he_torrance_cylinders.py", "--size", 10, "--output", tmp_path).splitlines()) == 9
    with Image.open(tmp_path / "he_torrance_cylinders.png") as picture:
        assert picture.size[0] > 600


def test_paints_are_fitted_and_called_glossy(run, tmp_path):
    names = ("Lambert", "Lambert + GGX")
    if not CORNELL.is_dir():
        pytest.skip("the measured paints are not at hand")
    printed = run("09_measured_paints.py", CORNELL, "--paints", 1, "--models", *names, "--output", tmp_path)
    rows = {name: next(x for x in printed.splitlines() if x.startswith(f"{name:<20}")) for name in names}
    matte, glossy = (int(row[29:].split("/")[0]) for row in rows.values())
    assert glossy < 0.7 * matte
    assert "acryl_blue is glossy" in printed
    assert (tmp_path / "measured_paints.png").exists()


def test_paints_that_are_not_there(run, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        run("09_measured_paints.py", tmp_path)
    assert ended.value.code == 2
    assert f"no .brdf files in {tmp_path}" in capsys.readouterr().err


def test_laws_catch_the_broken_brdfs_and_pass_the_corrected_one(run):
    printed = run("08_check_your_brdf.py").splitlines()
    table = {line[:20].strip(): line[20:].split() for line in printed[: printed.index("")]}
    assert table.pop("law") == ["FromAngles", "Varnished", "Corrected"]
    caught = {
        title: {law for law, row in table.items() if row[k] == "broken"} for k, title in enumerate(("a", "v", "c"))
    }
    assert caught == {"a": {"energy", "dark below horizon", "finite"}, "v": {"reciprocal", "energy"}, "c": set()}
    in_degrees, in_radians = (float(line.split()[-1]) for line in printed[-2:])
    assert in_degrees > 0.2
    assert in_radians < 1e-6


def test_plans_of_three_scenes_and_of_a_grid(run, tmp_path):
    printed = run("07_only_what_matters.py", "--size", 24, "--tolerance", 0.02, "--output", tmp_path)
    shares = [float(line.split()[5].rstrip("%;")) for line in printed.splitlines() if line.startswith("largest error")]
    assert len(shares) == 3
    assert max(shares) < 2
    assert (tmp_path / "only_what_matters.png").exists()
    printed = run("07_only_what_matters.py", "--size", 24, "--grid", 2)
    assert [line.split()[1] for line in printed.splitlines()] == ["10.0%:", "1.0%:", "0.1%:"]
