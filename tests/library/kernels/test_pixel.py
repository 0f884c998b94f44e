"""Models at one pixel: what they are stored in, what their formula depends on, their programs."""

import pytest
import torch
from helpers.kernels import EVALUATED, frames, made
from helpers.probes import doubles, held
from torch.testing import assert_close

from torchbrdf import EON, GGX, OrenNayar, QualitativeOrenNayar, fixed
from torchbrdf.fields import FieldBRDF
from torchbrdf.kernels.pixel import form_of, formula, record, stored, with_stored
from torchbrdf.kernels.recording import RecordingError


def test_stored_tensors_are_those_of_the_declared_parameters():
    model = OrenNayar(albedo=0.3, sigma=fixed(0.5))
    assert list(stored(model)) == ["raw_albedo", "fixed_sigma"]
    assert stored(model)["raw_albedo"] is model.raw_albedo


def test_a_model_on_other_tensors_leaves_the_first_alone():
    model = OrenNayar(albedo=held(0.3), sigma=held(0.5))
    other = with_stored(model, {"fixed_albedo": doubles(0.6)})
    assert other.albedo == 0.6
    assert other.sigma == model.sigma == 0.5
    assert model.albedo == 0.3


def test_form_tells_formulas_apart_and_not_materials():
    assert form_of(OrenNayar(sigma=0.2)) == form_of(OrenNayar(sigma=torch.full((5,), 0.7)))
    different = [OrenNayar(), OrenNayar(c3=False), OrenNayar(direct=False), OrenNayar(interreflection=False)]
    different += [OrenNayar(sigma=fixed(0.3)), EON(), EON(exact=False), QualitativeOrenNayar(a_constant=0.57)]
    assert len({form_of(model) for model in different}) == len(different)


def test_form_of_a_model_follows_its_settings():
    model = EON()
    before = form_of(model)
    model.exact = False
    assert form_of(model) != before


def test_no_form_for_what_is_more_than_plain_settings():
    assert form_of(GGX()) is None  # a module inside
    model = EON()
    model.table = torch.zeros(3)
    assert form_of(model) is None
    other = EON()
    other.register_buffer("table", torch.zeros(3))
    assert form_of(other) is None


def test_formula_is_the_model():
    model = made("eon", 50)
    vectors = frames(50)
    got = formula(model, list(stored(model).values()), *vectors)
    assert_close(got, model(*vectors), rtol=1e-15, atol=0)


def test_program_has_a_place_for_every_number():
    pixel = record(made("functional"), [(3,), ()], torch.float64)
    assert pixel.channels == 3
    assert [len(slope) for slope in pixel.slopes] == [3, 3, 3, 3, 1]
    operations = [step.operation for step in pixel.program.steps]
    assert operations.count("input") == 9 + 3 + 1 + 3
    assert set(operations) <= {*EVALUATED, "constant", "input"}


class Spread(FieldBRDF):
    """A field that has an axis too many."""

    def fields(self, cosines):
        return (torch.ones(2, 2, dtype=cosines.light.dtype) * cosines.light,)

    def parts_of(self, *fields):
        return {"all": fields[0]}


def test_refuses_a_value_that_is_no_row_of_channels():
    with pytest.raises(RecordingError):
        record(Spread(), [], torch.float64)
