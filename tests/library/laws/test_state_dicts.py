"""What version 0.1 saved loads, and means the same."""

import pytest
import torch
from helpers.catalog import MODELS
from helpers.recorded import recorded

from torchbrdf.parameters import declared

SAVED = recorded("state_dicts_0_1.json")


@pytest.mark.parametrize("row", [row for row in MODELS if row.name in SAVED], ids=lambda row: row.name)
def test_saved_states_load_and_read_as_they_did(row):
    model = row.make(torch.float64)
    saved = SAVED[row.name]
    state = {name: torch.tensor(value, dtype=torch.float64) for name, value in saved["state"].items()}
    model.load_state_dict(state, strict=True)
    material = {
        f"{prefix}.{entry.name}".lstrip("."): getattr(child, entry.name)
        for prefix, child in model.named_modules()
        for entry in declared(child)
    }
    assert set(material) == set(saved["material"])
    for name, value in material.items():
        expected = torch.tensor(saved["material"][name], dtype=torch.float64)
        torch.testing.assert_close(value.detach(), expected, rtol=1e-12, atol=0)


def test_every_saved_row_is_still_in_the_catalog():
    assert set(SAVED) <= {row.name for row in MODELS}
