"""The code of the README runs as it stands."""

import re
from pathlib import Path

import pytest

README = (Path(__file__).parents[1] / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


@pytest.mark.parametrize("code", BLOCKS, ids=["library", "wave optics", "pipeline", "plan"])
def test_code_block_runs(code, capsys):
    names = {}
    exec(compile(code, "README.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "tensor" in printed or "+-" in printed or "left out altogether" in printed
    if "result" in names:
        result, truth = names["result"], names["truth"]
        miss = result.parameters["sigma"] - truth.sigma
        assert miss.abs() < 4 * result.standard_error["sigma"]
