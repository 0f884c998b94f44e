"""The ladder: its errors are those of the sheet, its table says what was measured, models of users join it."""

import json
import math

import pytest
import torch

from torchbrdf import BRDF, Cosines, Lambert, Option, OrenNayar
from torchbrdf.accuracy import RUNGS, Ladder, Row, ladder, relative_errors, rungs_of
from torchbrdf.testing import random_directions

DOUBLE = torch.float64


def directions(n, seed=0):
    return Cosines.of(*random_directions(n, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed)))


def test_errors_of_the_fitted_forms_are_those_of_the_sheet():
    # rms over theta in 0..85 degrees at rho 0.7 against two bounces: 6.5 % functional, 15.8 % qualitative (sigma 20)
    rungs = [rung for rung in RUNGS if rung.name in ("functional", "qualitative (0.33)", "exact, K = 48, 2 bounces")]
    cosines = directions(1500, seed=1)
    errors = relative_errors(rungs, [math.radians(20)], [0.7], cosines)
    assert errors["functional"][1] == pytest.approx(0.065, abs=0.02)
    assert errors["qualitative (0.33)"][1] == pytest.approx(0.158, abs=0.04)
    # more bounces than two are small at this slope and albedo
    assert errors["exact, K = 48, 2 bounces"][1] < 0.02


def test_ladder_measures_every_rung():
    rungs = [rung for rung in RUNGS if rung.name in ("Lambert", "functional")]
    table = ladder(0.5, [0.3, 0.9], directions(200), rungs=rungs, repeats=1)
    assert [row.name for row in table.rows] == ["Lambert", "functional"]
    assert table.rows[0].forward == 1
    assert table.rows[1].saved_bytes > table.rows[0].saved_bytes
    assert table.rows[1].rms_error < table.rows[0].rms_error
    assert json.loads(table.to_json())[1]["name"] == "functional"
    assert table.to_markdown().count("\n") == 3


def test_pareto_front_holds_what_nothing_beats():
    rows = [
        Row("cheap", 1, 0.3, 1, 1, 0),
        Row("bad", 1, 0.3, 2, 1, 0),
        Row("good", 1, 0.1, 5, 1, 0),
        Row("worse", 1, 0.2, 6, 1, 0),
    ]
    assert [row.name for row in Ladder(tuple(rows)).pareto()] == ["cheap", "good"]


def test_ladder_refuses_directions_below_the_horizon():
    below = Cosines.from_products(*(torch.full((3,), k) for k in (-0.5, 0.5, 0.0)))
    with pytest.raises(ValueError, match="above the horizon"):
        ladder(0.3, 0.5, below)


def test_saved_bytes_are_counted_once():
    cosines = directions(1000)
    (functional,) = (rung for rung in RUNGS if rung.name == "functional")
    (row,) = ladder(0.5, 0.5, cosines, rungs=[functional], repeats=1).rows
    # a float64 tensor a point is 8 bytes; the functional model has about forty intermediate ones
    assert 8 * 10 < row.saved_bytes < 8 * 120
    assert isinstance(functional.build(torch.tensor(0.5), torch.tensor(0.5)), OrenNayar)


class Velvet(BRDF):
    """Somebody's own model: Lambert with a sheen of width sigma, which it says it could do without."""

    def __init__(self, albedo, sigma):
        super().__init__()
        self.body, self.sigma = Lambert(albedo=albedo), sigma

    def evaluate_components(self, cosines):
        sheen = 0.01 * ((1 - cosines.light) * (1 - cosines.view)) ** (1 / self.sigma)
        return {"body": self.body.evaluate(cosines), "sheen": sheen[..., None]}

    def stand_ins(self):
        return {"sheen": [Option("no sheen", ("sheen",), self.body)]}


def test_a_model_of_your_own_joins_the_ladder():
    rungs = rungs_of("velvet", Velvet)
    cosines = directions(200)
    table = ladder(0.5, 0.6, cosines, rungs=rungs, against=Velvet, repeats=1)
    bottom, top = table.rows
    assert (bottom.name, top.name) == ("no sheen", "velvet")
    assert top.rms_error == 0
    sheen = 0.01 * ((1 - cosines.light) * (1 - cosines.view)) ** 2
    assert bottom.max_error == pytest.approx(float((sheen / (0.6 / math.pi + sheen)).max()), rel=1e-6)


def test_the_ladder_is_the_stand_ins_of_its_exact_model():
    """And beside them only what leaves nothing out of another."""
    names = [rung.name for rung in RUNGS]
    assert len(names) == len(set(names))
    exact = RUNGS[-1].build(torch.tensor(0.5), torch.tensor(0.3))
    added = set(names) - {option.choice for option in exact.stand_ins()["rung"]}
    beside = {"qualitative (0.57)", "closed form, K = 16", "interpolated, all bounces"}
    assert added == beside | {"exact, K = 48, all bounces"}
    for rung in RUNGS:
        model = rung.build(torch.tensor(0.7, dtype=DOUBLE), torch.tensor(0.4, dtype=DOUBLE))
        assert model.albedo.item() == pytest.approx(0.7)
        assert isinstance(model, Lambert) or model.sigma.item() == pytest.approx(0.4)
