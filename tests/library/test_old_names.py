"""Names of an earlier version still work and say what they are now."""

import pytest
from helpers.two_channels import material

import torchbrdf
from torchbrdf import OrenNayar


def test_options_is_an_old_name():
    with pytest.warns(DeprecationWarning, match="stand_ins"):
        options = torchbrdf.options
    assert list(options(material(OrenNayar))) == ["rung"]


@pytest.mark.parametrize(("name", "what"), [("sampling_laws", "assert_weights"), ("accuracy_series", "series_ladder")])
def test_modules_that_moved_are_found_under_their_old_names(name, what):
    with pytest.warns(DeprecationWarning, match="is now part of"):
        assert callable(getattr(getattr(torchbrdf, name), what))
