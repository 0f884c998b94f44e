"""The D series: against sums in many digits, an integral, its limits, itself across hand-overs, and under autograd."""

import functools
import math

import mpmath
import pytest
import torch
from helpers.recorded import recorded
from helpers.series_inputs import F32, F64, at, bar, scattered, with_slopes
from numpy.polynomial.legendre import leggauss
from torch.testing import assert_close

from torchbrdf.models.he_torrance import series
from torchbrdf.models.he_torrance.expansion import expansion
from torchbrdf.models.he_torrance.series import first_terms_over_g, series_over_g

DATA = recorded("he_torrance_series.json")
# Of a derivative by g, which changes sign: relative to at least this share of S/max(g, 1).
FLOOR = 1e-3
# m, w of the largest term: g = m e^(-w/2), t = m^2 w/2, so that every way of summing is met with small and large t.
PLACES = [(m, w) for m in (0.2, 5.0, 33.9, 34.1, 69.9, 70.1, 250.0, 1100.0) for w in (0.0, 0.05, 0.5, 4.0)]


def direct(g, t, window):
    """S/g term by term, in the digits mpmath is set to, from the first to the last index of the window."""
    first, last = window
    term = mpmath.exp((first - 1) * mpmath.log(g) - g - mpmath.loggamma(first + 1) - t / first) / first
    total = term
    for m in range(first, last):
        term *= g * m / mpmath.mpf(m + 1) ** 2 * mpmath.exp(t / (m * (m + 1)))
        total += term
    return total


@functools.cache
def in_many_digits(g, t):
    """S/g and its first and second derivatives {(n, q): value} by differences in 60 digits, of step 1e-12."""
    with mpmath.workdps(60):
        g, t = mpmath.mpf(g), mpmath.mpf(t)
        w = mpmath.lambertw(2 * t / g**2).real
        m = g * mpmath.exp(w / 2)
        sd = mpmath.sqrt(m / (1 + w))
        window = max(1, int(m - 12 * sd - 12)), int(m + 13 * sd + 50)
        h = mpmath.mpf("1e-12")
        f = {(i, k): direct(g + i * h, t + k * h, window) for i in (-1, 0, 1) for k in (-1, 0, 1)}
        found = {
            (0, 0): f[0, 0],
            (1, 0): (f[1, 0] - f[-1, 0]) / (2 * h),
            (0, 1): (f[0, 1] - f[0, -1]) / (2 * h),
            (2, 0): (f[1, 0] - 2 * f[0, 0] + f[-1, 0]) / h**2,
            (0, 2): (f[0, 1] - 2 * f[0, 0] + f[0, -1]) / h**2,
            (1, 1): (f[1, 1] - f[1, -1] - f[-1, 1] + f[-1, -1]) / (4 * h**2),
        }
        return {order: float(value) for order, value in found.items()}


@pytest.mark.parametrize("row", DATA["series"], ids=lambda row: f"g={row['g']:g}, t={row['t']:g}")
def test_golden(row, dtype):
    g, t = (torch.tensor([row[name]], dtype=dtype) for name in ("g", "t"))
    value, by_g, by_t = (x.double() for x in with_slopes(g, t))
    S, S_g, S_t = (torch.tensor([float(row[name])], dtype=F64) for name in ("S", "dSdg", "dSdt"))
    g64 = torch.tensor([row["g"]], dtype=F64)
    allowed = bar(dtype, g64, S)
    assert ((g64 * value - S).abs() <= allowed * S).all()
    assert ((g64 * by_t - S_t).abs() <= allowed * S_t.abs()).all()
    # dS/dg = S/g + g d(S/g)/dg: both parts are rounded to the dtype, and they cancel near t = g.
    natural = S / g64.clamp(min=1)
    rounding = 4 * torch.finfo(dtype).eps * natural
    assert ((value + g64 * by_g - S_g).abs() <= allowed * S_g.abs().maximum(FLOOR * natural) + rounding).all()


@pytest.mark.parametrize(("m", "w"), PLACES)
def test_sum_in_many_digits(m, w):
    g, t = at(m, w)
    exact = in_many_digits(g.item(), t.item())
    g, t = g.requires_grad_(), t.requires_grad_()
    value = series_over_g(g, t)
    by_g, by_t = torch.autograd.grad(value, (g, t), create_graph=True)
    by_gg, by_gt = torch.autograd.grad(by_g, (g, t), retain_graph=True)
    _, by_tt = torch.autograd.grad(by_t, (g, t))
    found = {(0, 0): value, (1, 0): by_g, (0, 1): by_t, (2, 0): by_gg, (1, 1): by_gt, (0, 2): by_tt}
    for (n, q), got in found.items():
        # What has n derivatives by g changes sign, and is then told from (S/g)/max(g, 1)^n.
        floor = FLOOR * abs(exact[0, q]) / max(g.item(), 1.0) ** n if n else 0.0
        # Measured at m = 70.1: 1.5e-12 of the value, 5e-11 of first and 8e-10 of second derivatives.
        allowed = {0: 1e-11, 1: 1e-10, 2: 1e-9}[n + q]
        assert abs(got.item() - exact[n, q]) <= allowed * max(abs(exact[n, q]), floor), (n, q)


def test_hankel_transform():
    # (1/pi) times the Fourier transform of e^(-g (1 - e^(-r^2))) - e^-g at 2 sqrt(t): what the series is expanded from.
    x, weight = (torch.from_numpy(a) for a in leggauss(400))
    azimuth = math.pi / 200 * torch.arange(200, dtype=F64)  # the trapezoid is exact; torch's own J_0 errs by 1e-8
    for g, t in [(1e-3, 0.3), (0.5, 2.0), (3.0, 0.0), (8.0, 6.0), (30.0, 20.0), (60.0, 30.0), (90.0, 100.0)]:
        r = 3.5 + 3.5 * x  # g e^(-49) is nothing
        bump = math.exp(-g) * torch.expm1(g * torch.exp(-(r**2)))
        bessel = torch.cos(2 * math.sqrt(t) * r[:, None] * azimuth.cos()).mean(-1)
        expected = 2 * (3.5 * weight * bessel * bump * r).sum() / g
        assert_close(series_over_g(*torch.tensor([[g], [t]], dtype=F64))[0], expected, rtol=1e-11, atol=0)


def test_smooth_surface(dtype):
    t = torch.tensor([0.0, 0.3, 5.0, 40.0], dtype=dtype)
    value, by_g, by_t = with_slopes(torch.zeros_like(t), t)
    eps = torch.finfo(dtype).eps
    assert_close(value, torch.exp(-t), rtol=2 * eps, atol=0)
    assert_close(by_t, -torch.exp(-t), rtol=8 * eps, atol=0)
    assert_close(by_g, (torch.exp(-t.double() / 2) / 4 - torch.exp(-t.double())).to(dtype), rtol=8 * eps, atol=0)
    g = torch.full_like(t, 1e-4)
    # Higher terms lead where t > 2 ln(4/g).
    three = torch.exp(-g) * (torch.exp(-t) + g / 4 * torch.exp(-t / 2) + g**2 / 18 * torch.exp(-t / 3))
    assert_close(series_over_g(g, t)[:3], three[:3], rtol=max(1e-11, 16 * eps), atol=0)


def test_rough_surface(dtype):
    # Geometric optics: the tangent of the facet decides, u = t/g = tan^2/(2 slope^2).
    u = torch.tensor([0.0, 0.5, 2.0, 8.0], dtype=dtype)
    for g in (1e4, 1e8, 1e12):
        leading = torch.exp(-u) / g**2 * (1 + (1 - 2 * u + u**2 / 2) / g)
        assert_close(
            series_over_g(torch.full_like(u, g), g * u), leading, rtol=2e3 / g**2 + 2e-6 ** (dtype == F32), atol=0
        )


def test_multiplies_with_g_and_divides_with_m():
    # (g d/dg + g) makes m of a term, -d/dt makes 1/m: together they give S back.
    g, t = (x.requires_grad_() for x in scattered(4000, F64, g=(-3, 8)))
    value = series_over_g(g, t)
    (by_t,) = torch.autograd.grad(value.sum(), t, create_graph=True)
    (by_gt,) = torch.autograd.grad(by_t.sum(), g)
    assert_close(-(by_t + g * by_gt + g * by_t), value, rtol=1e-9, atol=torch.finfo(F64).tiny)


def hand_overs(dtype):
    scheme = series._SCHEMES[dtype]
    return (*scheme.sums, *(end for end, _ in scheme.expansions[:-1]))


@pytest.mark.parametrize("w", [0.0, 1e-3, 0.1, 1.0, 5.0])
def test_no_jump_at_a_hand_over(dtype, w):
    step = 4 * torch.finfo(dtype).eps
    for end in hand_overs(dtype):
        (g, t), (g_after, t_after) = (at(end * (1 + side * step), w, dtype) for side in (-1, 1))
        before, after = with_slopes(g, t), with_slopes(g_after, t_after)
        S = before[0].double() * g
        if S.item() < 1e3 * torch.finfo(dtype).tiny:
            continue
        moved = 16 * step * (1 + t / end)
        allowed = bar(dtype, g.double(), S) + moved
        natural = before[0] / g.clamp(min=1)
        for a, b, floor in zip(before, after, (0.0, natural, 0.0), strict=True):
            assert (b - a).abs() <= allowed * a.abs().maximum(FLOOR * torch.as_tensor(floor)) + moved * floor


def test_sums_are_handed_over_where_they_should():
    # Both ways agree where one follows the other, but not far below: there the expansion diverges.
    for m, close in ((70.0, True), (6.0, False)):
        g, t = (x[None] for x in at(m, 0.2))
        (expanded,) = expansion(g, t, [(0, 0)], degree=9)
        (summed,) = series._sum(g, t, [(0, 0)], m=m, terms=160)
        assert bool(((expanded / summed - 1).abs() < 1e-11).all()) == close


def test_float32():
    g, t = scattered(100_000, F32)
    exact = with_slopes(g.double(), t.double())
    S = exact[0] * g.double()
    seen = S > 1e-30
    floor = FLOOR * exact[0] / g.double().clamp(min=1)
    for got, expected, least in zip(with_slopes(g, t), exact, (0 * floor, floor, 0 * floor), strict=True):
        assert got.dtype == F32
        seen &= exact[0] / g.double().clamp(min=1) > 1e-30
        excess = (got.double() - expected).abs() / (bar(F32, g.double(), S) * expected.abs().maximum(least))
        assert excess[seen].max() <= 1  # measured over 5 million: 0.56 of the value, 0.05 of the derivatives


def extremes(n, dtype, seed):
    generator = torch.Generator().manual_seed(seed)
    g, t = 10 ** (-30 + 60 * torch.rand(2, n, dtype=F64, generator=generator))
    ordinary = torch.rand(n, generator=generator) < 0.5  # where all of it happens
    g = torch.where(ordinary, g**0.2, g)
    t = torch.where(ordinary, 10 ** (-3 + 6 * torch.rand(n, dtype=F64, generator=generator)) * g.clamp(min=1), t)
    denormal = torch.finfo(dtype).tiny / 8
    g[::17], t[::13], g[1::17], t[1::13] = 0, 0, denormal, denormal
    return g.to(dtype), t.to(dtype)


def assert_sound(g, t):
    for name, found in zip(("value", "d/dg", "d/dt"), with_slopes(g, t), strict=True):
        assert found.isfinite().all(), name
    value, _, by_t = with_slopes(g, t)
    assert ((value >= 0) & (value <= 1)).all()
    assert (by_t <= 0).all()


def test_extremes(dtype):
    assert_sound(*extremes(100_000, dtype, 0))


@pytest.mark.slow
def test_ten_million_extremes(dtype):
    for seed in range(10):
        assert_sound(*extremes(1_000_000, dtype, seed))


def test_first_terms_are_good_for_small_g_alone():
    g, t = torch.tensor([0.0, 0.5, 3.0, 100.0], dtype=F64), torch.tensor([0.3, 1.0, 2.0, 50.0], dtype=F64)
    few = first_terms_over_g(g, t, terms=40)
    assert_close(few[:3], series_over_g(g, t)[:3], rtol=1e-13, atol=0)
    assert few[3] < 1e-9 * series_over_g(g, t)[3]


def test_derivatives_of_the_logarithm():
    # Of order 1 everywhere, unlike the series itself; gradcheck also compares reverse, forward and batched modes.
    g, t = (x.requires_grad_() for x in at([0.2, 5.0, 30.0, 50.0, 100.0, 300.0], [3.0, 0.2, 1.0, 0.01, 0.5, 0.2]))

    def logarithm(g, t):
        return series_over_g(g, t).log()

    torch.autograd.gradcheck(logarithm, (g, t), check_forward_ad=True, check_batched_grad=True, atol=1e-7, rtol=1e-6)
    torch.autograd.gradgradcheck(logarithm, (g, t), check_fwd_over_rev=True, atol=1e-7, rtol=1e-6)


def test_forward_mode_is_reverse_mode(dtype):
    g, t = at([0.2, 5.0, 50.0, 300.0], [3.0, 0.2, 0.01, 0.2], dtype)
    _, by_g, by_t = with_slopes(g, t)
    _, tangent = torch.func.jvp(series_over_g, (g, t), (torch.full_like(g, 2.0), torch.full_like(t, -3.0)))
    assert tangent.dtype == dtype
    assert_close(tangent, 2 * by_g - 3 * by_t, rtol=1e-6, atol=0)
    _, alone = torch.func.jvp(lambda g: series_over_g(g, t), (g,), (torch.ones_like(g),))
    assert_close(alone, by_g, rtol=0, atol=0)


def test_vmap_is_a_batch(dtype):
    g, t = at([0.2, 5.0, 50.0, 300.0], [3.0, 0.2, 0.01, 0.2], dtype)
    table = series_over_g(g[:, None], t)
    nested = torch.vmap(torch.vmap(series_over_g, in_dims=(None, 0)), in_dims=(0, None))(g, t)
    assert_close(nested, table, rtol=0, atol=0)
    assert_close(torch.vmap(torch.func.grad(series_over_g))(g, t), with_slopes(g, t)[1], rtol=0, atol=0)


def test_third_derivative_is_refused():
    x = torch.tensor(0.3, dtype=F64, requires_grad=True)
    value = series_over_g(x, torch.tensor(1.0, dtype=F64))
    for _ in range(2):
        (value,) = torch.autograd.grad(value, x, create_graph=True)
    with pytest.raises(NotImplementedError, match="has 2 derivatives"):
        torch.autograd.grad(value, x)


def test_compiles_into_one_graph(dtype):
    g, t = at([0.2, 5.0, 50.0, 300.0], [3.0, 0.2, 0.01, 0.2], dtype)
    torch.compiler.reset()
    compiled = torch.compile(lambda g, t: 2 * series_over_g(g, t), fullgraph=True, backend="aot_eager")
    g, t = g.requires_grad_(), t.requires_grad_()
    got, expected = compiled(g, t), 2 * series_over_g(g, t)
    assert_close(got, expected, rtol=0, atol=0)
    for a, b in zip(torch.autograd.grad(got.sum(), (g, t)), torch.autograd.grad(expected.sum(), (g, t)), strict=True):
        assert_close(a, b, rtol=0, atol=0)


def test_operator_keeps_its_promises(dtype):
    g, t = at([0.2, 50.0], [3.0, 0.2], dtype)
    torch.library.opcheck(series._captured, (g, t, [0, 0, 1, 0]), test_utils=("test_schema", "test_faketensor"))


def test_shapes_and_pieces(monkeypatch):
    g, t = scattered(1000, F64)
    whole = series_over_g(g.reshape(8, 125).T, t.reshape(8, 125).T)
    monkeypatch.setattr(series, "_AT_A_TIME", 64)
    assert_close(series_over_g(g, t).reshape(8, 125).T, whole, rtol=1e-14, atol=0)
    assert series_over_g(g[0], t[0]).shape == ()
    assert series_over_g(g[:0], t[:0]).shape == (0,)
    assert series_over_g(g[:5, None], t[:3]).shape == (5, 3)


def test_dtype_is_checked():
    one = torch.ones(1)
    with pytest.raises(TypeError, match="float16"):
        series_over_g(one.half(), one.half())
    with pytest.raises(TypeError, match=r"float32 and torch\.float64"):
        series_over_g(one, one.double())
