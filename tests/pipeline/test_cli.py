"""The command line: render and fit meet in a folder; bad input is one line and exit code 2."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from inverse import cli, read_image, read_stack
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
    assert main(["fit", str(folder), "--model", "lambert"]) == 3  # the vase is rough: what is left is no noise
    out = capsys.readouterr().out
    assert "Lambert" in out
    assert "albedo" in out
    assert "sigma" not in out


def test_per_pixel_albedo(folder, capsys):
    options = ["--model", "qualitative", "--albedo", "per-pixel", "--json", "--free-exposure", "--limb", "60"]
    assert main(["fit", str(folder), *options]) == 3  # made by another model
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
    assert main(["fit", str(folder), "--model", "lambert", "--json", *options]) == 3
    same = strict_json(capsys.readouterr().out)
    (tmp_path / "lights.txt").write_text(f"{math.sin(math.radians(10))} 0 {math.cos(math.radians(10))} 1\n")
    assert main(["fit", str(folder), "--model", "lambert", "--json", *options[:-1], str(math.pi)]) == 3
    assert strict_json(capsys.readouterr().out)["albedo"] == pytest.approx(same["albedo"])
    assert same["images"] == ["image_1.png"]
    assert (
        main(["fit", str(folder), "--json", "--limb", "40", "--shadow", "50", "--highlight", "5", "--starts", "2"]) == 0
    )
    fewer = strict_json(capsys.readouterr().out)["samples"]
    assert main(["fit", str(folder), "--json", "--srgb", "--mask", "mask.png"]) == 3
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
        (["render", "--output", "NEW", "--sigma", "200"], "sigma must lie in"),
        (["render", "--output", "NEW", "--albedo", "1.5"], "albedo must lie in"),
        (["render", "--output", "NEW", "--size", "0"], "at least 1"),
        (["render", "--output", "NEW", "--noise", "-1"], "read_noise must not be negative"),
        (["render", "--output", "NEW", "--size", "40000"], "GiB of memory"),
        (["fit", ""], "must have a name"),
        (["fit", "FOLDER", "--max-megapixels", "0.001"], "0.001 megapixels (max_pixels raises it); found 48 x 48"),
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
    "arguments",
    [
        [], ["paint"], ["fit"], ["fit", "x", "--model", "phong"], ["render"], ["render", "--output"],
        ["fit", "x", "--bootstrap", "1"], ["fit", "x", "--bootstrap", "-3"], ["fit", "x", "--exposure", "nan"],
        ["render", "--output", "x", "--lights-deg", "inf"], ["render", "--output", "x", "--seed", str(2**64)],
        ["render", "--output", "x", "--noise", "inf"],
    ],
)  # fmt: skip
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


def run(*arguments, **options):
    return subprocess.run([sys.executable, "-m", "inverse", *arguments], text=True, check=False, **options)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("form", [[], ["--json"]])
def test_output_that_cannot_be_written_is_one_line(folder, form):
    with open("/dev/full", "w") as full:
        done = run("fit", str(folder), "--model", "lambert", *form, stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 2
    assert done.stderr == "error: standard output: [Errno 28] No space left on device\n"


def test_a_reader_that_left_is_one_line(folder):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as gone:
        done = run("fit", str(folder), "--model", "lambert", stdout=gone, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (2, "error: standard output: [Errno 32] Broken pipe\n")


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (KeyboardInterrupt(), 130, "error: interrupted; what is printed was finished\n"),
        (MemoryError(), 2, "error: out of memory: smaller or fewer images may fit\n"),
        (ValueError("no refit"), 2, "error: no refit\n"),
    ],
)
@pytest.mark.parametrize("form", [[], ["--json"]])
def test_a_finished_fit_is_printed_whatever_follows(folder, capsys, monkeypatch, error, code, line, form):  # noqa: PLR0917
    def stopped(*_, **__):
        raise error

    monkeypatch.setattr(cli, "bootstrap", stopped)
    assert main(["fit", str(folder), "--model", "lambert", "--bootstrap", "4", *form]) == code
    out, err = capsys.readouterr()
    assert err == line
    assert strict_json(out)["status"] == "converged" if form else "albedo" in out


def test_memory_that_torch_cannot_have_is_one_line(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(cli, "render", lambda *_: torch.empty(2**50))
    assert main(["render", "--output", str(tmp_path / "s"), "--size", "16"]) == 2
    assert capsys.readouterr().err == "error: out of memory: smaller or fewer images may fit\n"


def test_other_errors_are_not_hidden(monkeypatch, tmp_path):
    def broken(*_):
        raise RuntimeError("a defect")

    monkeypatch.setattr(cli, "render", broken)
    with pytest.raises(RuntimeError, match="a defect"):
        main(["render", "--output", str(tmp_path / "s"), "--size", "16"])


def test_a_full_disk_names_the_file_and_leaves_nothing(tmp_path):
    """A limit on the size of files stands for the disk: PNG and NumPy meet it on different files."""
    limited = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (N, N));"
        "import inverse.cli; sys.exit(inverse.cli.main())"
    )
    render = ["render", "--output", tmp_path / "s", "--size", "48"]
    for limit, name in ((300, "image_0.png"), (8000, "normals.npy")):
        done = subprocess.run(
            [sys.executable, "-c", limited.replace("N", str(limit)), *render],
            capture_output=True, text=True, check=False, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        )  # fmt: skip
        assert done.returncode == 2
        assert done.stderr.startswith(f"error: {tmp_path / 's' / name}: cannot be written: ")
        assert done.stderr.count("\n") == 1
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("model", ["fast", "exact", "heightfield"])
def test_models(model, tmp_path, capsys):
    """Photographs of a groove surface or a heightfield, as `render` makes them with the same model."""
    folder = str(tmp_path / "s")
    assert main(["render", "--output", folder, "--model", model, "--size", "10"]) == 0
    capsys.readouterr()
    assert main(["fit", folder, "--model", model, "--json"]) == 0
    found = strict_json(capsys.readouterr().out)
    assert found["sigma_degrees"] == pytest.approx(40, abs=0.05)


def test_report(folder, tmp_path, capsys):
    report = tmp_path / "report"
    options = ["fit", str(folder), "--output", str(report)]
    assert main(options) == 0
    out = capsys.readouterr().out
    assert f"written to    {report}" in out
    assert (report / "report.txt").read_text() in out
    assert main(options) == 2
    assert "exists and is not empty" in capsys.readouterr().err
    assert main([*options, "--overwrite"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_what_is_not_to_be_trusted_is_code_3(tmp_path, capsys):
    """A plane tells no roughness from one light; swapped lights fit badly, and the sensor's noise says so."""
    flat, pair = str(tmp_path / "flat"), tmp_path / "pair"
    assert main(["render", "--output", flat, "--geometry", "plane", "--size", "24", "--lights-deg", "0"]) == 0
    assert main(["fit", flat]) == 3
    assert "not identified" in capsys.readouterr().out
    assert main(["render", "--output", str(pair), "--size", "24", "--noise", "0.002", "--lights-deg", "-50", "40"]) == 0
    assert main(["fit", str(pair)]) == 0
    (pair / "swapped.txt").write_text("0.64278761 0 0.76604444\n-0.76604444 0 0.64278761\n")
    capsys.readouterr()
    assert main(["fit", str(pair), "--lights", "swapped.txt", "--json"]) == 3
    found = strict_json(capsys.readouterr().out)
    assert found["trusted"] is False
    assert found["warnings"]
