"""Directions: what is refused and how, and what the cosines derive."""

import copy
import math

import pytest
import torch
from torch.testing import assert_close

from torchbrdf import EON, GGX, Cosines, Hapke, Lambert, OrenNayar
from torchbrdf._numerics import horizon, unit_tolerance
from torchbrdf.testing import TOLERANCE, random_directions

NAMES = ["normal", "light", "view"]


def up(dtype=torch.float64):
    return {name: torch.tensor([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]], dtype=dtype) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("call", [Cosines.of, Lambert(), Lambert().components], ids=["Cosines.of", "forward", "parts"])
class TestRefused:
    """Each refusal names the argument, whoever is asked."""

    def refuse(self, call, name, bad, error, match, **options):
        with pytest.raises(error, match=match):
            call(**(up() | {name: bad}), **options)

    @pytest.mark.parametrize(
        ("bad", "error", "match"),
        [
            ([0.0, 0.0, 1.0], TypeError, r"must be a torch.Tensor of shape \(..., 3\); found list"),
            (torch.ones(2, 2).double(), ValueError, r"must have shape \(..., 3\); found \(2, 2\)"),
            (torch.tensor(1.0).double(), ValueError, r"must have shape \(..., 3\); found \(\)"),
            (torch.tensor([[0, 0, 1]]), TypeError, r"must be float32 or float64; found torch.int64"),
            (
                up(torch.float16)["view"],
                TypeError,
                r"must be float32 or float64; found torch.float16. Convert with .float\(\)",
            ),
            (up(torch.bfloat16)["view"], TypeError, r"must be float32 or float64; found torch.bfloat16"),
        ],
        ids=["list", "trailing 2", "scalar", "int", "half", "bfloat"],
    )
    def test_whatever_normalize_says(self, call, name, bad, error, match):
        for normalize in (False, True):
            self.refuse(call, name, bad, error, f"{name} {match}", normalize=normalize)

    def test_mixed_dtype(self, call, name):
        match = rf"must share one dtype; found .*{name} torch.float32"
        self.refuse(call, name, up(torch.float32)[name], TypeError, match)

    def test_shapes_that_do_not_broadcast(self, call, name):
        bad = up()[name][[0, 0, 0]]
        self.refuse(call, name, bad, ValueError, rf"normal, light and view must broadcast; found .*{name} \(3, 3\)")

    def test_not_unit(self, call, name):
        bad = torch.tensor([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]], dtype=torch.float64)
        match = rf"{name} must hold finite unit vectors; 1 of 2 do not \(lengths 2 to 2\).*normalize=True"
        self.refuse(call, name, bad, ValueError, match)

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
    def test_not_finite(self, call, name, value):
        bad = torch.tensor([[0.0, 0.0, 1.0], [0.0, value, 1.0]], dtype=torch.float64)
        self.refuse(call, name, bad, ValueError, rf"{name} must hold finite unit vectors; 1 of 2 .*1 are not finite")
        match = f"{name} must hold finite vectors of non-zero length; 1 of 2 do not"
        self.refuse(call, name, bad, ValueError, match, normalize=True)

    def test_zero_vector(self, call, name):
        bad = torch.zeros(1, 3, dtype=torch.float64)
        self.refuse(call, name, bad, ValueError, f"{name} must hold finite unit vectors")
        self.refuse(call, name, bad, ValueError, f"{name} must hold .* non-zero length; 1 of 1", normalize=True)


def test_unit_tolerance_separates_rounding_from_six_digits(dtype):
    unit = {name: v[0] for name, v in up(dtype).items()}
    within, beyond = (1 + k * unit_tolerance(dtype) / 2 for k in (0.9, 1.1))  # lengths; the tolerance is on |v|^2
    Cosines.of(**(unit | {"light": unit["light"] * within}))
    with pytest.raises(ValueError, match="light must hold finite unit vectors"):
        Cosines.of(**(unit | {"light": unit["light"] * beyond}))
    assert unit_tolerance(dtype) == 64 * torch.finfo(dtype).eps


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_normalize_makes_length_irrelevant(dtype, scale):
    directions = random_directions(100, dtype=dtype, generator=torch.Generator().manual_seed(0))
    brdf = OrenNayar().to(dtype)
    got = brdf(*(scale * v for v in directions), normalize=True)
    assert_close(got, brdf(*directions), rtol=TOLERANCE[dtype].rounding, atol=0)


def test_empty_batch():
    none = torch.zeros(0, 3)
    assert OrenNayar()(none, none, none).shape == (0, 1)


def polar(theta, phi):
    return torch.stack([theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()], -1)


def test_derived_quantities_against_angles():
    generator = torch.Generator().manual_seed(0)
    theta_i, theta_r = (1.4 * torch.rand(500, dtype=torch.float64, generator=generator) + 0.05 for _ in range(2))
    dphi = 2 * math.pi * torch.rand(500, dtype=torch.float64, generator=generator)
    normal = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    g = Cosines.of(normal, polar(theta_i, torch.zeros_like(dphi)), polar(theta_r, dphi))
    alpha, beta = torch.maximum(theta_i, theta_r), torch.minimum(theta_i, theta_r)
    expected = {
        "light": theta_i.cos(),
        "view": theta_r.cos(),
        "phase": theta_i.cos() * theta_r.cos() + theta_i.sin() * theta_r.sin() * dphi.cos(),
        "alpha": alpha.cos(),
        "beta": beta.cos(),
        "sin_alpha": alpha.sin(),
        "sin_beta": beta.sin(),
        "in_plane": alpha.sin() * beta.sin() * dphi.cos(),
        "across_plane": alpha.sin() * beta.sin() * (1 - dphi.cos().abs()),
        "sine_ratio": beta.sin() / alpha.sin(),
        "alpha_over_sine": alpha / alpha.sin(),
        "beta_over_sine": beta / beta.sin(),
    }
    assert g.above_horizon.all()
    for name, value in expected.items():
        # 1 - cos^2 at 0.05 rad has lost 1/0.05^2 of its digits
        assert_close(getattr(g, name), value, rtol=1e-13, atol=2e-15, msg=lambda m, name=name: f"{name}: {m}")


def test_derived_quantities_are_computed_once():
    g = Cosines.of(**up())
    assert g.sin_alpha is g.sin_alpha


@pytest.mark.parametrize("moved", ["normal", "light", "view"])
@pytest.mark.parametrize("quiet", [torch.no_grad, torch.inference_mode])
def test_what_is_kept_has_the_derivatives_a_later_reader_asks_for(quiet, moved):
    """Also where one vector alone has derivatives, and the others' cosines none."""
    directions = random_directions(20, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    vectors = {name: v.requires_grad_(name == moved) for name, v in directions._asdict().items()}
    g, brdf = Cosines.of(**vectors), OrenNayar().double()
    with quiet():
        brdf.evaluate(g)
        _ = g.half_phase, g.azimuth_sine, g.lit
    late = torch.autograd.grad((brdf.evaluate(g)[:, 0] * g.half_phase[0]).sum(), vectors[moved])
    fresh = Cosines.of(**vectors)
    assert_close(late, torch.autograd.grad((brdf.evaluate(fresh)[:, 0] * fresh.half_phase[0]).sum(), vectors[moved]))


def test_cosines_serve_many_materials(dtype):
    directions = random_directions(50, dtype=dtype, generator=torch.Generator().manual_seed(0))
    g = Cosines.of(*directions)
    for brdf in (Lambert(), OrenNayar(sigma=0.2), OrenNayar(sigma=0.7), EON(), GGX()):
        assert torch.equal(brdf.to(dtype).evaluate(g), brdf(*directions))


@pytest.mark.parametrize("model", [OrenNayar, EON, GGX, Hapke])
def test_many_directions_are_a_loop_over_few(model):
    """Images go in pieces, few directions together: other operations, the same numbers to rounding."""
    directions = random_directions(140_000, generator=torch.Generator().manual_seed(0))
    brdf = model()
    with torch.no_grad():
        every = brdf(*directions)
        for start in (0, 70_000, 139_900):
            few = brdf(*(v[start : start + 100] for v in directions))
            assert_close(every[start : start + 100], few, rtol=1e-5, atol=1e-7)


def test_one_vector_among_many_is_looked_at():
    directions = dict(random_directions(140_000, generator=torch.Generator().manual_seed(0))._asdict())
    for name in directions:
        for spoilt in (1.001, math.nan):
            bad = {key: v.clone() for key, v in directions.items()}
            bad[name][131_072, 1] *= spoilt
            bad[name][131_072, 0] += 0.01
            with pytest.raises(ValueError, match=f"{name} must hold finite unit vectors; 1 of 140000"):
                Lambert()(**bad)


def test_horizon_is_one_rounding_error(dtype):
    eps = torch.finfo(dtype).eps
    assert horizon(dtype) == eps
    cosine = torch.tensor([-1.0, -eps, 0.0, eps, 2 * eps, 1.0], dtype=dtype)
    one = torch.ones_like(cosine)
    for light, view in ((cosine, one), (one, cosine)):
        g = Cosines.from_products(light, view, 0.5 * one)
        assert g.above_horizon.tolist() == [False, False, False, False, True, True]
        below = ~g.above_horizon
        for replaced in (g.light, g.view, g.phase):
            assert (replaced[below] == 1).all()
        assert g.zero_below_horizon(torch.ones(6, 2, dtype=dtype)).sum() == 4


def test_from_products_broadcasts():
    g = Cosines.from_products(torch.rand(4, 1), torch.rand(5), torch.tensor(0.5))
    assert g.light.shape == g.view.shape == g.phase.shape == g.above_horizon.shape == (4, 5)


def test_across_plane_is_never_negative(dtype):
    # With light, view and normal in one plane it is 0 up to rounding of either sign, and multiplies tan(89 deg).
    normal, light, _ = random_directions(2000, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    mirrored = 2 * (normal * light).sum(-1, keepdim=True) * normal - light
    for view in (light, mirrored):
        g = Cosines.of(*(v.to(dtype) for v in (normal, light, view)))
        assert (g.across_plane >= 0).all()
        assert (g.in_plane.abs() > g.sin_alpha * g.sin_beta).any()  # rounding did go below


def test_normalize_takes_any_finite_length():
    n = torch.tensor([0.0, 0.0, 1.0])
    for length in (1e-30, 1e30):
        found = Cosines.of(n, torch.tensor([0.6 * length, 0.0, 0.8 * length]), n, normalize=True)
        torch.testing.assert_close(found.light.item(), 0.8, rtol=1e-6, atol=0)


class TestOfComponents:
    """The same cosines from x, y and z that lie apart: equal values and derivatives, the same refusals."""

    def directions(self, dtype, count=200):
        g = torch.Generator().manual_seed(7)
        vectors = (torch.randn(count, 3, generator=g, dtype=torch.float64) for _ in range(3))
        return [torch.nn.functional.normalize(v, dim=-1).to(dtype) for v in vectors]

    @pytest.mark.parametrize("brdf", [OrenNayar(sigma=0.5), GGX(alpha=0.4)], ids=["Oren-Nayar", "GGX"])
    def test_values_and_derivatives_of_any_frame(self, brdf, dtype):
        # random normals: a third of the triples is above the horizon
        brdf, vectors = copy.deepcopy(brdf).to(dtype), self.directions(dtype)
        apart = [[part.clone().requires_grad_() for part in v.unbind(-1)] for v in vectors]
        whole = [v.clone().requires_grad_() for v in vectors]
        got, expected = brdf.evaluate(Cosines.of_components(*apart)), brdf(*whole)
        assert (expected > 0).sum() > 20
        eps = torch.finfo(dtype).eps
        # strided memory is summed in another order: a rounding of each product, relative to the smallest
        cosines = Cosines.of(*vectors)
        smallest = float(torch.minimum(cosines.light, cosines.view).min())
        torch.testing.assert_close(got, expected, rtol=4 * eps / smallest, atol=0)
        by_part = torch.autograd.grad(got.sum(), [part for v in apart for part in v])
        by_whole = torch.autograd.grad(expected.sum(), whole)
        for v, g in enumerate(by_whole):
            torch.testing.assert_close(torch.stack(by_part[3 * v : 3 * v + 3], -1), g, rtol=1e3 * eps, atol=1e2 * eps)

    def test_components_broadcast(self):
        zero, one = torch.zeros(()).double(), torch.ones(()).double()
        x = torch.linspace(0, 0.9, 4).double()
        z = (1 - x * x).sqrt()
        cosines = Cosines.of_components((zero, zero, one), (x, zero, z), (x[:, None], zero, z[:, None]))
        assert cosines.phase.shape == (4, 4)
        torch.testing.assert_close(cosines.phase, x * x[:, None] + z * z[:, None])

    def test_nothing_at_all(self):
        none = (torch.zeros(0),) * 3
        assert Cosines.of_components(none, none, none).light.shape == (0,)

    @pytest.mark.parametrize("name", NAMES)
    @pytest.mark.parametrize(
        ("change", "error", "match"),
        [
            (lambda parts: parts[:2], ValueError, "must have three components x, y, z"),
            (lambda parts: [2 * part for part in parts], ValueError, "must hold finite unit vectors; 200 of 200"),
            (lambda parts: [part[:3] if k else part for k, part in enumerate(parts)], ValueError, "that broadcast"),
            (lambda parts: [0.0, 0.0, 1.0], TypeError, "must be three tensors"),
            (lambda parts: [part.float() for part in parts], TypeError, "must share one dtype"),
            (lambda parts: [part.half() for part in parts], TypeError, "must be float32 or float64"),
        ],
        ids=["two", "long", "shapes", "numbers", "mixed", "half"],
    )
    def test_refuses_what_vectors_are_refused_for(self, name, change, error, match):
        given = dict(zip(NAMES, (v.unbind(-1) for v in self.directions(torch.float64)), strict=True))
        with pytest.raises(error, match=match) as caught:
            Cosines.of_components(**given | {name: change(given[name])})
        assert name in str(caught.value)
