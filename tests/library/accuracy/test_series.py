"""The ladder of schemes for the He-Torrance series: what it says of each, and of a scheme of known error."""

import pytest

from torchbrdf.accuracy import SCHEMES, SeriesLadder, SeriesRow, series_ladder
from torchbrdf.models.he_torrance.series import series_over_g


def test_every_scheme_where_it_is_good():
    table = series_ladder(points=4000, repeats=1)
    rows = {row.name: row for row in table.rows}
    assert list(rows) == list(SCHEMES)
    assert rows["as shipped"].wrong == 0
    assert max(rows["as shipped"].largest) < 3e-6
    below = {
        name: [e for e, end in zip(row.largest, table.edges[1:], strict=True) if end < 1] for name, row in rows.items()
    }
    beyond = {name: [e for e, g in zip(row.largest, table.edges, strict=False) if g > 40] for name, row in rows.items()}
    for name, row in rows.items():
        if name.startswith("first"):
            assert max(below[name]) < 1e-6
            assert min(beyond[name]) > 0.1
            assert row.wrong > 0.3
    assert max(beyond["expansion alone"]) < 3e-6
    assert min(below["expansion alone"]) > 0.1


def test_an_error_is_found_as_large_as_it_is():
    schemes = {"too large": lambda g, t: 1.001 * series_over_g(g, t), "lost": lambda g, t: 0 / (0 * g)}
    off, lost = series_ladder(points=500, schemes=schemes, repeats=1).rows
    assert off.largest == pytest.approx((1e-3,) * 16, rel=5e-3)
    assert off.wrong == 1
    assert lost.largest == (float("inf"),) * 16


def test_table():
    edges = tuple(10 ** (-3 + k / 2) for k in range(17))
    lines = SeriesLadder((SeriesRow("x", (1e-7,) * 6 + (2e-3, 1e-4) + (5.0,) * 8, 0.25, 12.4),), edges).to_markdown()
    assert lines.splitlines()[-1] == "| x | 1.0e-07 | 2.0e-03 | > 1 | > 1 | > 1 | 25.00% | 12 x |"
