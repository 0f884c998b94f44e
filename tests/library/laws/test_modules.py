"""What torch does to modules, over the catalog: vmap, state_dict, dtypes, functional_call, compile."""

import copy
import io

import pytest
import torch
from helpers.catalog import MODELS, OTHERS, every_other
from helpers.catalog_oren_nayar import mixture
from torch.func import functional_call, vmap

from torchbrdf import BRDF, OrenNayar, QualitativeOrenNayar, fixed
from torchbrdf import testing as laws

TOLERANCE = laws.TOLERANCE
CAPTURED = [m for m in MODELS if m.captured]
# A mirror has parameters that no value of f_r shows.
TRAINED = [m for m in MODELS if m.name != "mirror" and any(True for _ in m.make(torch.float32).parameters())]


def few(n, dtype=torch.float64):
    return laws.random_directions(n, dtype=dtype, generator=torch.Generator().manual_seed(1))


def assert_same(got, expected, dtype):
    torch.testing.assert_close(got, expected, rtol=TOLERANCE[dtype].rounding, atol=TOLERANCE[dtype].rounding)


def test_keeps_dtype(model, dtype, directions):
    laws.assert_keeps_dtype(model.make(dtype), *directions)


def test_forward_mode_keeps_dtype(model, dtype):
    # Fits differentiate this way. Some products of a number and a 0-d tensor have float64 tangents in torch 2.13.
    brdf, directions = model.make(dtype), few(4, dtype)
    parameters = {name: p.detach() for name, p in brdf.named_parameters()}
    directed = {name: torch.ones_like(p) for name, p in parameters.items()}
    inputs, tangents = (parameters, *directions), (directed, *(v.roll(1, 0) for v in directions))

    def f(named, *vectors):
        return functional_call(brdf, named, vectors)

    value, tangent = torch.func.jvp(f, inputs, tangents)
    assert value.dtype == tangent.dtype == dtype


@pytest.mark.parametrize("build", [OrenNayar, QualitativeOrenNayar, lambda: 0.7 * OrenNayar() + 0.3 * OrenNayar()])
def test_numbers_make_a_model_in_the_default_dtype(build):
    laws.assert_keeps_dtype(build(), *few(4, torch.float32))


def test_vmap_over_directions_equals_batch(model, dtype, directions):
    brdf = model.make(dtype)
    assert_same(vmap(brdf)(*directions), brdf(*directions), dtype)


@pytest.mark.parametrize("model", TRAINED, ids=lambda m: m.name)
def test_vmap_over_materials_equals_loop(model):
    brdf = model.make(torch.float64)
    directions = few(5)
    shifts = torch.tensor([-0.5, 0.0, 0.7], dtype=torch.float64)

    def shifted(shift):
        return functional_call(brdf, {name: p + shift for name, p in brdf.named_parameters()}, directions)

    loop = torch.stack([shifted(s) for s in shifts])
    assert (loop[0] != loop[1]).any()
    assert_same(vmap(shifted)(shifts), loop, torch.float64)


def test_state_dict_round_trip(model, dtype, directions):
    brdf, other = model.make(dtype), model.make(dtype)
    with torch.no_grad():
        for p in other.parameters():
            p.add_(1.0)
    file = io.BytesIO()
    torch.save(brdf.state_dict(), file)
    file.seek(0)
    other.load_state_dict(torch.load(file, weights_only=True))
    assert torch.equal(other(*directions), brdf(*directions))


def test_deepcopy_is_independent(model, dtype, directions):
    brdf = model.make(dtype)
    before = brdf(*directions)
    other = copy.deepcopy(brdf)
    assert torch.equal(other(*directions), before)
    with torch.no_grad():
        for p in other.parameters():
            p.add_(1.0)
    assert torch.equal(brdf(*directions), before)


def test_to_float64(model):
    brdf = model.make(torch.float32).to(torch.float64)
    assert {t.dtype for t in (*brdf.parameters(), *brdf.buffers())} == {torch.float64}
    laws.assert_keeps_dtype(brdf, *few(4))


@pytest.mark.parametrize("parameters", [torch.float32, torch.float64], ids=["float32", "float64"])
def test_parameters_and_directions_of_two_dtypes_meet_in_the_wider(model, parameters):
    other = torch.float32 if parameters == torch.float64 else torch.float64
    brdf, directions = model.make(parameters), few(8, other)
    if not any(True for _ in (*brdf.parameters(), *brdf.buffers())):
        pytest.skip("has no numbers of its own")
    parts = brdf.components(*directions)
    albedo = brdf.directional_albedo(torch.tensor([0.3, 0.8], dtype=other))
    u = torch.rand(8, 2, dtype=other, generator=torch.Generator().manual_seed(3))
    drawn = brdf.sample(directions.normal, directions.view, u)
    assert {f.dtype for f in (brdf(*directions), albedo, drawn.weight, *parts.values())} == {torch.float64}
    assert drawn.light.dtype == other
    assert brdf.pdf(*directions).isfinite().all()
    # what is computed in the wider dtype differs by the rounding of the narrower one
    exact = copy.deepcopy(brdf).double()(*(torch.nn.functional.normalize(v.double(), dim=-1) for v in directions))
    torch.testing.assert_close(brdf(*directions), exact, rtol=2e-3, atol=1e-5)


def test_functional_call_reads_the_given_parameters(model):
    brdf, directions = model.make(torch.float64), few(4)
    moved = {name: (p + 0.3).detach() for name, p in brdf.named_parameters()}
    expected = copy.deepcopy(brdf)
    expected.load_state_dict(moved, strict=False)
    assert torch.equal(functional_call(brdf, moved, directions), expected(*directions))


@pytest.mark.parametrize("model", CAPTURED, ids=lambda m: m.name)
@pytest.mark.parametrize("backend", ["eager", "aot_eager"])
def test_captured_in_one_graph(model, backend):
    # The graph and its derivative, without code generation: what can break model by model.
    if backend == "aot_eager" and model in OTHERS:
        pytest.skip("test_others_compile differentiates one of each kind")
    assert_compiles(model.make(torch.float32), few(16, torch.float32), backend)


def test_compiles(dtype):
    assert_compiles(mixture(dtype), few(16, dtype), "inductor")  # every model at once: one is 15 s


@pytest.mark.parametrize("backend", ["aot_eager", pytest.param("inductor", marks=pytest.mark.slow)])
def test_others_compile(backend):
    assert_compiles(every_other(torch.float32), few(16, torch.float32), backend)  # code generation: minutes


IN_ONE_GRAPH_OF_ANY_SHAPE = ("lambert", "hapke")  # a bounded and an unbounded domain; the others by hand
# Of the surface the modes are constants whose sizes torch takes for unknown; of the grooves they are looked up by the
# number that the slope is.
IN_SEVERAL = pytest.mark.xfail(strict=True, reason="the modes of all bounces are found by numbers of Python")


OF_ONE_SIZE = pytest.mark.xfail(
    raises=IndexError, strict=True, reason="torch 2.13 loses track of the size of a constant table of any shape"
)


def marks(model):
    if model.name in IN_ONE_GRAPH_OF_ANY_SHAPE:
        return ()
    if model.name.startswith("interpolated"):
        return (pytest.mark.slow, OF_ONE_SIZE)
    several = model.name in ("rough surface, white, all bounces", "grooves, white, all bounces")
    return (pytest.mark.slow, IN_SEVERAL) if several else (pytest.mark.slow,)


@pytest.mark.parametrize(
    "model",
    [pytest.param(m, marks=marks(m)) for m in MODELS],
    ids=lambda m: m.name,
)
def test_captured_in_one_graph_of_any_shape(model):
    torch.compiler.reset()
    brdf = model.make(torch.float32)
    captured = torch.compile(brdf, fullgraph=True, dynamic=True, backend="eager")
    for count in (16, 33):
        directions = few(count, torch.float32)
        assert_same(captured(*directions), brdf(*directions), torch.float32)


def assert_compiles(brdf: BRDF, directions: laws.Directions, backend: str) -> None:
    torch.compiler.reset()
    compiled = torch.compile(brdf, fullgraph=True, backend=backend)
    dtype = directions.normal.dtype
    got, expected = compiled(*directions), brdf(*directions)
    assert_same(got, expected, dtype)
    if expected.requires_grad:
        parameters = list(brdf.parameters())
        for a, b in zip(
            torch.autograd.grad(got.sum(), parameters), torch.autograd.grad(expected.sum(), parameters), strict=True
        ):
            assert_same(a, b, dtype)


def test_fixed_parameters_are_not_trained():
    brdf = OrenNayar(sigma=fixed(0.4))
    assert [name for name, _ in brdf.named_parameters()] == ["raw_albedo"]
