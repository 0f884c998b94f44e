"""`unchecked()`: changes nothing but the checks, and is over when its block is left."""

import threading

import pytest
import torch
from helpers.probes import doubles, few

from torchbrdf import EON, Cosines, Lambert, OrenNayar, burley, oren_nayar, unchecked
from torchbrdf.testing import laws, random_directions

UP = torch.tensor([0.0, 0.0, 1.0])
LONG = 2 * UP


def refuses_long_vectors():
    with pytest.raises(ValueError, match="view must hold finite unit vectors"):
        Lambert()(UP, UP, LONG)
    return True


def test_changes_no_value_and_no_derivative(model):
    brdf = model.make(torch.float64)
    directions = random_directions(2, dtype=torch.float64, generator=torch.Generator().manual_seed(7))
    value, gradients = laws.value_and_gradients(brdf, directions)
    with unchecked():
        same, same_gradients = laws.value_and_gradients(brdf, directions)
    assert torch.equal(value, same)
    assert gradients.keys() == same_gradients.keys()
    for name, gradient in gradients.items():
        assert torch.equal(gradient, same_gradients[name]), name


def test_looks_at_neither_directions_nor_domains():
    with unchecked():
        assert (Lambert()(UP, UP, LONG) > 0).all()
        cosines = Cosines.of(*few())
        assert (oren_nayar(cosines, albedo=doubles(1.5), sigma=doubles(0.3)) > 1 / torch.pi).any()
        burley(cosines, albedo=doubles(0.5), roughness=doubles(1.5))
        # a tangent parallel to the normal, vectors without direction
        assert not Cosines.of(UP, UP, UP, tangent=UP).tangent_plane[0].isfinite()
        assert not Cosines.of(UP, UP, 0 * UP, normalize=True).view.isfinite()
    assert refuses_long_vectors()
    with pytest.raises(ValueError, match="albedo must lie in"):
        oren_nayar(cosines, albedo=doubles(1.5), sigma=doubles(0.3))


def test_what_is_stored_is_looked_at_all_the_same():
    with unchecked():
        with pytest.raises(ValueError, match=r"OrenNayar.sigma must lie in \(0, 1.571\) rad"):
            OrenNayar(sigma=2.0)
        brdf = EON()
        with pytest.raises(ValueError, match=r"EON.albedo must lie in"):
            brdf.albedo = 1.5
        assert (Lambert()(UP, UP, LONG) > 0).all()


def test_checks_are_back_after_an_exception():
    with pytest.raises(RuntimeError, match="midway"), unchecked():
        raise RuntimeError("midway")
    assert refuses_long_vectors()


def test_nests_and_decorates():
    with unchecked():
        with unchecked():
            Lambert()(UP, UP, LONG)
        Lambert()(UP, UP, LONG)

    @unchecked()
    def shade():
        return Lambert()(UP, UP, LONG)

    assert (shade() > 0).all()
    assert refuses_long_vectors()


def test_belongs_to_one_thread():
    refused = []
    with unchecked():
        thread = threading.Thread(target=lambda: refused.append(refuses_long_vectors()))
        thread.start()
        thread.join()
        Lambert()(UP, UP, LONG)
    assert refused == [True]


def test_a_compiled_function_may_enter_it():
    brdf = Lambert()

    def shade(normal, light, view):
        with unchecked():
            return 2 * brdf(normal, light, view)

    directions = random_directions(4, generator=torch.Generator().manual_seed(0))
    compiled = torch.compile(shade, backend="eager", fullgraph=True)
    torch.testing.assert_close(compiled(*directions), shade(*directions))
    assert refuses_long_vectors()
