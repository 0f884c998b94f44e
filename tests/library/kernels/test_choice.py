"""When kernels are used, and that nothing but time depends on it."""

import math
import multiprocessing

import pytest
import torch
from helpers.kernels import frames, made, with_compiler
from torch.testing import assert_close

from torchbrdf import Lambert, OrenNayar, native, oren_nayar, unchecked
from torchbrdf.directions import Cosines
from torchbrdf.kernels import by_kernel, choice

USED = "Reflectance"


def uses_kernel(model, *vectors):
    """Whether a model's value comes of the operator."""
    grown = [v.requires_grad_() for v in vectors]
    return USED in type(model(*grown).grad_fn).__name__


@with_compiler
def test_used_from_a_number_of_pixels_on():
    model = OrenNayar()
    for pixels, by_default in ((8, False), (choice.SMALLEST - 1, False), (choice.SMALLEST, True)):
        vectors = frames(pixels, torch.float32)
        assert uses_kernel(model, *vectors) == by_default
    with native():
        assert uses_kernel(model, *frames(8, torch.float32))
    with native(math.inf):
        assert not uses_kernel(model, *frames(choice.SMALLEST, torch.float32))


@with_compiler
def test_the_switch_nests_and_goes_back_after_an_error():
    vectors = frames(8, torch.float32)
    with native(), native(math.inf):
        assert not uses_kernel(OrenNayar(), *vectors)
    with pytest.raises(ValueError), native():
        raise ValueError
    assert not uses_kernel(OrenNayar(), *vectors)


@with_compiler
def test_pixels_may_be_laid_out_by_broadcasting():
    normal, light, view = frames(80, torch.float32)
    assert uses_kernel(OrenNayar(), normal[:, None], light, view)


@with_compiler
@pytest.mark.parametrize("smallest", [1, math.inf])
def test_bad_input_raises_the_same(smallest):
    normal, light, view = frames(10, torch.float32)
    model = OrenNayar()
    with native(smallest):
        with pytest.raises(ValueError, match="view must hold finite unit vectors; 10 of 10"):
            model(normal, light, 1.01 * view)
        with pytest.raises(TypeError, match="share one dtype"):
            model(normal, light, view.double())
        with pytest.raises(ValueError, match="broadcast"):
            model(normal, light[:3], view)
        with pytest.raises(ValueError, match=r"shape \(\.\.\., 3\)"):
            model(normal, light[:, :2], view)
        with pytest.raises(TypeError, match=r"torch\.Tensor"):
            model(normal, [0.0, 0.0, 1.0], view)
        with pytest.raises(RuntimeError):
            OrenNayar(sigma=torch.full((7,), 0.3))(normal, light, view)


@with_compiler
def test_unchecked_nothing_is_looked_at():
    normal, light, view = frames(10)
    with native(), unchecked():
        got = made("functional")(normal, light, 1.01 * view)
    with native(math.inf), unchecked():
        assert_close(got, made("functional")(normal, light, 1.01 * view), rtol=1e-11, atol=1e-13)


@with_compiler
def test_dtypes_that_differ_are_left_to_torch():
    vectors = frames(10, torch.float32)
    with native():
        assert OrenNayar(sigma=torch.full((10,), 0.3, dtype=torch.float64))(*vectors).dtype == torch.float64
        assert not uses_kernel(OrenNayar(sigma=torch.full((10,), 0.3, dtype=torch.float64)), *vectors)


@with_compiler
def test_lengths_are_made_one_if_asked_for():
    normal, light, view = frames(10)
    with native():
        got = made("functional")(2 * normal, 3 * light, view, normalize=True)
        assert_close(got, made("functional")(normal, light, view), rtol=1e-12, atol=1e-14)


def both(compute):
    """What is computed with and without kernels."""
    with native():
        mine = compute()
    with native(math.inf):
        return mine, compute()


@with_compiler
def test_transforms_of_functions():
    model, (normal, light, view) = made("functional"), frames(5)

    def loss(x):
        return model(normal, x, view).square().sum()

    transforms = {
        "grad": lambda: torch.func.grad(loss)(light),
        "jvp": lambda: torch.func.jvp(lambda x: model(normal, x, view), (light,), (view,))[1],
        "vmap": lambda: torch.vmap(model, (None, 0, None))(normal, light, view),
        "hessian": lambda: torch.func.hessian(loss)(light[:2].mean(0) * 0 + light[0]),
        "forward mode": lambda: dual(model, normal, light, view),
        "double backward": lambda: twice(loss, light),
        "functional call": lambda: torch.func.functional_call(
            model, {"raw_sigma": model.raw_sigma.detach() + 0.5}, (normal, light, view)
        ),
    }
    for compute in transforms.values():
        mine, expected = both(compute)
        assert_close(mine, expected, rtol=1e-10, atol=1e-12)


def dual(model, normal, light, view):
    from torch.autograd import forward_ad

    with forward_ad.dual_level():
        return forward_ad.unpack_dual(model(normal, forward_ad.make_dual(light, view), view)).tangent


def twice(loss, light):
    x = light.clone().requires_grad_()
    (slope,) = torch.autograd.grad(loss(x), x, create_graph=True)
    return torch.autograd.grad(slope.square().sum(), x)[0]


@with_compiler
def test_watched_tensors_are_left_to_torch():
    from torch.fx.experimental.proxy_tensor import make_fx

    model, vectors = made("qualitative"), frames(5)
    with native():
        graph = make_fx(model)(*vectors)
    assert not any("torchbrdf" in str(node.target) for node in graph.graph.nodes)


@with_compiler
def test_autocast_and_inference():
    model, vectors = made("qualitative", dtype=torch.float32), frames(5, torch.float32)
    with torch.autocast("cpu", torch.bfloat16):
        mine, expected = both(lambda: model(*vectors))
    assert mine.dtype == expected.dtype == torch.float32
    assert_close(mine, expected, rtol=1e-5, atol=1e-6)
    with torch.inference_mode():
        mine, expected = both(lambda: model(*vectors))
    assert_close(mine, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.slow
@with_compiler
def test_compiled_the_formula_is_fused():
    model, vectors = made("qualitative", dtype=torch.float32), frames(50, torch.float32)
    with native():
        mine, expected = both(lambda: torch.compile(model, fullgraph=True)(*vectors))
    assert_close(mine, expected, rtol=1e-5, atol=1e-6)


@with_compiler
def test_training_steps_follow_the_parameters():
    vectors, target = frames(50), made("functional", 50)(*frames(50)).detach()

    def train():
        model = OrenNayar(albedo=torch.full((3,), 0.4, dtype=torch.float64), sigma=torch.tensor(0.4).double())
        optimizer = torch.optim.SGD(model.parameters(), lr=0.5)
        for _ in range(5):
            optimizer.zero_grad()
            (model(*vectors) - target).square().sum().backward()
            optimizer.step()
        return torch.cat([p.detach().reshape(-1) for p in model.parameters()])

    mine, expected = both(train)
    assert_close(mine, expected, rtol=1e-9, atol=1e-9)


def test_without_a_compiler_it_is_the_formula(monkeypatch):
    monkeypatch.setattr(choice, "is_installed", lambda: False)
    vectors = frames(10)
    with native():
        assert by_kernel(made("functional"), *vectors) is None
        assert_close(
            made("functional")(*vectors),
            oren_nayar(Cosines.of(*vectors), albedo=made("functional").albedo, sigma=made("functional").sigma),
        )


def test_models_without_fields_are_left_alone():
    with native():
        assert Lambert()(*frames(10, torch.float32)).shape == (10, 1)


def _value_in_child(queue, name, vectors):
    with native():
        queue.put(made(name)(*vectors).detach().numpy())


@with_compiler
@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_works_in_a_child_of_a_process_that_used_it(monkeypatch):
    """As workers of a DataLoader are; threads of the parent are gone there."""
    monkeypatch.setattr("torchbrdf.kernels.kernel._PIXELS_A_THREAD", 10)
    monkeypatch.setattr(torch, "get_num_threads", lambda: 2)
    vectors = frames(50)
    with native():
        expected = made("second bounce")(*vectors).detach()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_value_in_child, args=(queue, "second bounce", vectors))
    child.start()
    got = queue.get(timeout=60)
    child.join(timeout=60)
    assert child.exitcode == 0
    assert_close(torch.from_numpy(got), expected, rtol=0, atol=0)
