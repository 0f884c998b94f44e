"""The command line: render and fit meet in a folder; bad input is one line and exit code 2."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest

from inverse import read_image, read_stack
from inverse.cli import main


def refuse(text):
    raise ValueError(f"not strict JSON: {text}")


def strict_json(text):
    return json.loads(text, parse_constant=refuse)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("stack") / "vase"
    material = ["--sigma", "30", "--albedo", "0.6", "--lights-deg", "-30", "10", "50"]
    image = ["--size", "48", "--noise", "0.002", "--seed", "5"]
    assert main(["render", "--output", str(path), *material, *image]) == 0
    return path


def test_render_then_fit_recovers_the_material(folder, capsys):
    assert main(["fit", str(folder), "--json"]) == 0
    found = strict_json(capsys.readouterr().out)
    assert found["status"] == "converged"
    assert found["images"] == ["image_0.png", "image_1.png", "image_2.png"]
    # 5 standard errors: 6e-7 false alarms, and the seed is fixed
    assert abs(found["sigma_degrees"] - 30) < 5 * found["sigma_degrees_standard_error"] < 3
    assert abs(found["albedo"][0] - 0.6) < 5 * found["albedo_standard_error"][0] < 0.02
    assert found["residual_rms"] == pytest.approx(0.002, rel=0.1)


def test_table(folder, capsys):
    assert main(["fit", str(folder), "--model", "lambert"]) == 0
    out = capsys.readouterr().out
    assert "Lambert" in out
    assert "albedo" in out
    assert "sigma" not in out


def test_per_pixel_albedo(folder, capsys):
    options = ["--model", "qualitative", "--albedo", "per-pixel", "--json", "--free-exposure", "--limb", "60"]
    assert main(["fit", str(folder), *options]) == 0
    found = strict_json(capsys.readouterr().out)
    points = int(read_stack(folder).scene.surface.mask.sum())
    assert len(found["albedo"]) == points
    known = [a[0] for a in found["albedo"] if a[0] is not None]
    assert 0 < len(known) < points  # those beyond the limb have no value, and JSON has no NaN
    assert np.median(known) == pytest.approx(0.6, abs=0.05)
    assert len(found["exposure"]) > 0


def test_bootstrap(folder, capsys):
    assert main(["fit", str(folder), "--bootstrap", "4", "--json"]) == 0
    found = strict_json(capsys.readouterr().out)["bootstrap"]
    assert found["samples"] == 4
    assert 0 < found["sigma_degrees"] < 3
    assert main(["fit", str(folder), "--bootstrap", "4"]) == 0
    out = capsys.readouterr().out
    assert "4 refits" in out


def test_options_reach_the_fit(folder, tmp_path, capsys):
    """Half the exposure is twice the albedo; other lights, another subset of images."""
    (tmp_path / "lights.txt").write_text(f"{math.sin(math.radians(10))} 0 {math.cos(math.radians(10))} 2\n")
    options = ["--images", "image_1*", "--lights", str(tmp_path / "lights.txt"), "--exposure", str(math.pi / 2)]
    assert main(["fit", str(folder), "--model", "lambert", "--json", *options]) == 0
    same = strict_json(capsys.readouterr().out)
    (tmp_path / "lights.txt").write_text(f"{math.sin(math.radians(10))} 0 {math.cos(math.radians(10))} 1\n")
    assert main(["fit", str(folder), "--model", "lambert", "--json", *options[:-1], str(math.pi)]) == 0
    assert strict_json(capsys.readouterr().out)["albedo"] == pytest.approx(same["albedo"])
    assert same["images"] == ["image_1.png"]
    assert (
        main(["fit", str(folder), "--json", "--limb", "40", "--shadow", "50", "--highlight", "5", "--starts", "2"]) == 0
    )
    fewer = strict_json(capsys.readouterr().out)["samples"]
    assert main(["fit", str(folder), "--json", "--srgb", "--mask", "mask.png"]) == 0
    decoded = strict_json(capsys.readouterr().out)
    assert fewer < decoded["samples"]
    assert decoded["albedo"][0] < 0.45  # 0.6 encoded is 0.32 linear


def test_the_exposure_is_that_of_the_folder_unless_given(tmp_path, capsys):
    options = ["--output", str(tmp_path / "s"), "--model", "lambert", "--albedo", "0.5", "--size", "16"]
    assert main(["render", *options, "--exposure", "1.5"]) == 0
    albedo = {}
    for given in ([], ["--exposure", "1.5"], ["--exposure", "3"]):
        capsys.readouterr()
        assert main(["fit", str(tmp_path / "s"), "--model", "lambert", "--json", *given]) == 0
        (albedo[tuple(given)],) = strict_json(capsys.readouterr().out)["albedo"]
    assert list(albedo.values()) == pytest.approx([0.5, 0.5, 0.25], abs=1e-4)


def test_render_overwrites_when_asked(tmp_path, capsys):
    options = ["render", "--output", str(tmp_path / "s"), "--size", "16", "--albedo"]
    assert main([*options, "0.5"]) == 0
    before = read_image(tmp_path / "s" / "image_0.png")
    assert main([*options, "0.9"]) == 2
    assert "exists and is not empty" in capsys.readouterr().err
    assert read_image(tmp_path / "s" / "image_0.png").equal(before)
    assert main([*options, "0.9", "--overwrite"]) == 0
    assert (read_image(tmp_path / "s" / "image_0.png") > before).any()


@pytest.mark.parametrize("geometry", ["sphere", "cylinder", "plane"])
def test_render_shapes(tmp_path, geometry, capsys):
    options = ["--geometry", geometry, "--model", "lambert", "--albedo", "0.5", "--size", "17", "--lights-deg", "0"]
    assert main(["render", "--output", str(tmp_path), *options, "--json"]) == 0
    report = strict_json(capsys.readouterr().out)
    assert (report["images"], report["rows"], report["clipped"]) == (1, 17, 0.0)
    # facing the camera at the centre: radiance rho/pi, exposure pi
    assert read_image(tmp_path / "image_0.png")[8, 8, 0].item() == pytest.approx(0.5, abs=1e-5)


def test_render_repeats_with_the_seed(tmp_path):
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert main(["render", "--output", str(tmp_path / name), "--size", "16", "--noise", "0.1", "--seed", seed]) == 0
    a, b, c = (read_image(tmp_path / name / "image_0.png") for name in "abc")
    assert a.equal(b)
    assert not a.equal(c)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fit", "absent"], "absent: no such folder"),
        (["fit", "FOLDER", "--images", "x*"], "no images x*"),
        (["fit", "FOLDER", "--geometry", "cube 1"], "found 'cube 1'"),
        (["fit", "FOLDER", "--mask", "absent.png"], "absent.png: cannot be read"),
        (["fit", "FOLDER", "--lights", "absent.txt"], "absent.txt"),
        (["fit", "FOLDER", "--limb", "100"], "limb 100"),
        (["fit", "FOLDER", "--exposure", "0"], "Sensor.exposure must be positive"),
        (["fit", "FOLDER", "--starts", "0"], "starts must be a whole number of at least 1"),
        (["fit", "FOLDER", "--bootstrap", "1"], "at least 2"),
        (["fit", "FOLDER", "--bootstrap", "-3"], "at least 2"),
        (["render", "--output", "NEW", "--sigma", "200"], "sigma must lie in"),
        (["render", "--output", "NEW", "--albedo", "1.5"], "albedo must lie in"),
        (["render", "--output", "NEW", "--size", "0"], "at least 1"),
        (["render", "--output", "NEW", "--noise", "-1"], "read_noise must not be negative"),
        (["render", "--output", "NEW", "--lights-deg", "nan"], "direction"),
    ],
)
def test_bad_input_is_one_line_and_code_2(arguments, message, folder, tmp_path, capsys):
    known = {"FOLDER": str(folder), "NEW": str(tmp_path / "new")}
    assert main([known.get(a, a) for a in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err


@pytest.mark.parametrize(
    "arguments", [[], ["paint"], ["fit"], ["fit", "x", "--model", "phong"], ["render"], ["render", "--output"]]
)
def test_bad_usage_is_one_line_and_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    err = capsys.readouterr().err
    assert err.startswith("error: ")
    assert err.count("\n") == 1


def test_module_runs():
    done = subprocess.run([sys.executable, "-m", "inverse", "--help"], capture_output=True, text=True, check=True)
    assert "fit" in done.stdout
    assert "render" in done.stdout
    failed = subprocess.run(
        [sys.executable, "-m", "inverse", "fit", "absent"], capture_output=True, text=True, check=False
    )
    assert (failed.returncode, failed.stdout) == (2, "")
    assert failed.stderr == "error: absent: no such folder.\n"
