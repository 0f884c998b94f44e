"""Recorded values of tests/data; its README says where they come from."""

import json
from pathlib import Path
from typing import Any

DATA = Path(__file__).parents[1] / "data"


def recorded(name: str) -> Any:
    return json.loads((DATA / name).read_text())
