"""Photographs of grooves and of a random heightfield: each is recovered by its own models, and by them alone."""

import json
import re
import runpy
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from torchbrdf.accuracy import DIFFUSE_RUNGS

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples"
RECORD = json.loads((ROOT / "docs" / "figures" / "ladder_two_truths.json").read_text())
ACCURACY = (ROOT / "docs" / "accuracy.md").read_text()
MODELS = (ROOT / "docs" / "models.md").read_text()


@pytest.fixture
def run(monkeypatch, capsys):
    def printed(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out.splitlines()

    return printed


def numbers(line):
    return [float(k) for k in re.findall(r"[-+]?\d+\.\d+", line)]


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_vase_of_a_heightfield(run, tmp_path):
    printed = run("01_fit_vase.py", "--size", 48, "--truth", "heightfield", "--output", tmp_path)
    assert "random heightfield" in printed[0]
    rows = {line[:28].strip(): line[28:] for line in printed[3:11]}
    sigma, sigma_error, rho, rho_error, residual, _ = numbers(rows["fast heightfield"])
    assert abs(sigma - 40) < 4 * sigma_error
    assert abs(rho - 0.7) < 4 * rho_error
    wrong = numbers(rows["interpolated, all bounces"])
    assert wrong[0] > 60  # no V-cavity is as flat at the limb
    assert wrong[2] > 0.75
    assert wrong[4] > 1.3 * residual  # and the photographs tell
    assert (tmp_path / "vase_fit_heightfield.png").exists()


def test_wrong_surface_is_the_wrong_answer(run):
    rungs = ("Lambert", "EON", "fast V-cavities", "fast heightfield")
    printed = run("benchmarks/wrong_surface.py", "--size", 16, "--sigmas", 30, "--rhos", 0.3, 0.7, "--rungs", *rungs)
    rows = [cells(line) for line in printed if line.startswith("|") and "---" not in line]
    assert [row[0] for row in rows] == ["fitted with", *rungs] * 2
    grooves, heights = (dict(zip(rungs, rows[k : k + 4], strict=True)) for k in (1, 6))
    assert abs(float(grooves["fast V-cavities"][1])) < 0.6
    assert abs(float(heights["fast heightfield"][1])) < 0.2
    assert float(grooves["fast heightfield"][1]) < -5
    assert float(heights["fast V-cavities"][1]) > 8
    assert grooves["Lambert"][1] == ""


def test_ladder_against_both_surfaces(run, tmp_path):
    rungs = ("Lambert", "fast V-cavities", "fast heightfield")
    small = ("--directions", 40, "--points", 500, "--output", tmp_path)
    printed = run("benchmarks/two_truths.py", *small, "--rungs", *rungs)
    _, grooves, heights = json.loads((tmp_path / "ladder_two_truths.json").read_text())["rows"]
    assert grooves["rms_error"]["V-cavities"] < 0.1 * grooves["rms_error"]["heightfield"]
    assert heights["rms_error"]["heightfield"] < 0.1 * heights["rms_error"]["V-cavities"]
    assert sum(line.startswith("|") for line in printed) == 2 + len(rungs)


def test_docs_show_the_record_of_the_figure():
    example = runpy.run_path(str(EXAMPLES / "benchmarks" / "two_truths.py"))
    assert [row["name"] for row in RECORD["rows"]] == [rung.name for rung in DIFFUSE_RUNGS]
    assert example["table"](RECORD["rows"]) in ACCURACY
    figure = example["draw"](RECORD["rows"], RECORD["machine"])
    figure.draw_without_rendering()
    for axis in figure.axes:
        boxes = [text.get_window_extent() for text in axis.texts]
        assert {text.get_text() for text in axis.texts} == {rung.name for rung in DIFFUSE_RUNGS}
        assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
        points = np.concatenate([axis.transData.transform(line.get_xydata()) for line in axis.lines])
        assert not any(box.contains(*point) for box in boxes for point in points)


def test_conversions_of_the_docs_are_printed(run):
    printed = run("benchmarks/roughness_conversions.py", "--sigmas", 30)
    assert printed[0] in MODELS
    assert printed[-1] in MODELS
