"""The code of README, CONTRIBUTING and docs runs as it stands; what they point to exists."""

import json
import re
from pathlib import Path

import pytest

from torchbrdf.accuracy import Ladder, Row

ROOT = Path(__file__).parents[1]
SOURCES = [path for package in ("torchbrdf", "inverse", "examples") for path in sorted((ROOT / package).rglob("*.py"))]
NAMED = re.compile(r"\b((?:examples|docs|tests|torchbrdf|inverse)/[\w/]+\.(?:py|md|json|png))\b")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCKS = [
    pytest.param(page, code, id=f"{page.name} {k}")
    for page in PAGES
    for k, code in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.DOTALL))
]


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def test_there_is_code_to_run():
    pages = [block.values[0].name for block in BLOCKS]
    assert pages.count("README.md") == 2
    assert {"CONTRIBUTING.md", "accuracy.md", "fitting.md", "models.md", "planning.md"} <= set(pages)


@pytest.mark.parametrize(("page", "code"), BLOCKS)
def test_code_block_runs(page, code, capsys):
    names = {}
    exec(compile(code, page.name, "exec"), names)
    assert capsys.readouterr().out.strip()
    if "result" in names:
        result, truth = names["result"], names["truth"]
        miss = result.parameters["sigma"] - truth.sigma
        assert miss.abs() < 4 * result.standard_error["sigma"]


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_and_named_files_exist(page):
    text = page.read_text()
    for link in re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", text):
        assert (page.parent / link).exists(), link
    for name in NAMED.findall(text):
        assert (ROOT / name).exists(), name


def test_files_named_in_the_code_exist():
    for path in SOURCES:
        for name in NAMED.findall(path.read_text()):
            assert (ROOT / name).exists(), f"{named(path)}: {name}"


def test_readme_is_short_and_shows_five_figures_at_most():
    text = PAGES[0].read_text()
    assert len(text.splitlines()) < 150
    assert text.count("![") <= 5


def test_table_of_the_ladder_is_the_record_that_its_figure_shows():
    record = json.loads((ROOT / "docs" / "figures" / "ladder.json").read_text())
    fields = Row.__dataclass_fields__
    table = Ladder(tuple(Row(**{key: row[key] for key in fields}) for row in record["rows"])).to_markdown()
    assert table in (ROOT / "docs" / "accuracy.md").read_text()
    for row in record["rows"]:
        line = f"| {row['name']} | {row['image_error']:.2%} | {row['sigma_bias']:.2f} | {row['rho_bias']:.4f} |"
        assert line in (ROOT / "docs" / "accuracy.md").read_text()
