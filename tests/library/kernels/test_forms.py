"""Forms of models and their kernels, each made once."""

import torch
from helpers.kernels import frames, made, with_compiler
from torch.testing import assert_close

from torchbrdf import GGX, OrenNayar, native
from torchbrdf.fields import FieldBRDF
from torchbrdf.kernels.forms import form_at, form_for

AT_A_PIXEL = ([(5, 3), (5,)], [(3,), ()], [(4, 5, 3), ()])


class Sorted(FieldBRDF):
    """A field by an operation that has no scalar steps."""

    def fields(self, cosines):
        return (torch.stack((cosines.light, cosines.view)).sort(0)[0][0],)

    def parts_of(self, *fields):
        return {"all": fields[0]}


class Normalised(FieldBRDF):
    """A field divided by its largest value over all pixels: no function of one pixel."""

    def fields(self, cosines):
        return (cosines.light / cosines.light.max(),)

    def parts_of(self, *fields):
        return {"all": fields[0]}


def test_models_of_one_form_share_it():
    form = form_for(OrenNayar(sigma=0.2))
    assert form is not None
    assert form is form_for(OrenNayar(sigma=0.4))
    assert form_at(form.place) is form
    assert form is not form_for(OrenNayar(c3=False))
    assert form_for(GGX()) is None


def test_a_form_holds_no_material():
    form = form_for(made("fujii", 1000))
    assert form is not None
    assert sum(t.numel() for t in form.model.state_dict().values()) == 0


def test_kernels_are_kept_by_shape_at_a_pixel_and_by_dtype():
    form = form_for(OrenNayar())
    assert form is not None
    kernels = [form.kernel([torch.zeros(size) for size in sizes], torch.float32) for sizes in AT_A_PIXEL]
    assert kernels[0] is kernels[1] is kernels[2] is not None
    assert form.kernel([torch.zeros(()), torch.zeros(())], torch.float32) is not kernels[0]
    assert form.kernel([torch.zeros(3), torch.zeros(())], torch.float64) is not kernels[0]


def test_a_formula_without_scalar_steps_has_no_kernel():
    form = form_for(Sorted())
    assert form is not None
    assert form.kernel([], torch.float32) is None


def test_a_formula_that_mixes_pixels_has_no_kernel():
    form = form_for(Normalised())
    assert form is not None
    assert form.kernel([], torch.float32) is None
    vectors = frames(20, torch.float32)
    with native():
        assert_close(Normalised()(*vectors), form.formula(*vectors, []), rtol=1e-6, atol=0)


def test_pixels_are_counted_together():
    form = form_for(OrenNayar())
    assert form is not None
    x, y = torch.zeros(4, 1, 3), torch.zeros(6, 3)
    assert form.pixels([x, y, y], [torch.zeros(3), torch.zeros(())]) == 24
    assert form.pixels([y, y, y], [torch.zeros(5, 1, 3), torch.zeros(())]) == 30
    assert form.pixels([y, y, y], [torch.zeros(5, 3), torch.zeros(())]) == 0
    assert form.pixels([y, torch.zeros(6, 2), y], [torch.zeros(3), torch.zeros(())]) == 0


def test_formula_of_a_form():
    model = made("qualitative", 20)
    form = form_for(model)
    assert form is not None
    vectors = frames(20)
    assert_close(form.formula(*vectors, list(model.parameters())), model(*vectors), rtol=1e-15, atol=0)


@with_compiler
def test_threads_get_one_kernel():
    from concurrent.futures import ThreadPoolExecutor

    form = form_for(OrenNayar(direct=False))
    assert form is not None
    with ThreadPoolExecutor(8) as pool:
        kernels = list(pool.map(lambda _: form.kernel([torch.zeros(2), torch.zeros(())], torch.float64), range(8)))
    assert len({id(kernel) for kernel in kernels}) == 1
