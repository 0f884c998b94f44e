"""Oren and Nayar's functional model against the paper's own trigonometry and golden values; where angles lose digits.

Golden values: tests/data/README.md says where they come from. Tables over both approximations are here, too.
"""

import math

import mpmath
import pytest
import torch
from helpers.paper_form import CONFIGURATIONS, NORMAL, PI, SIGMAS, by_angles, direction, directions_of
from helpers.probes import doubles, held
from helpers.recorded import recorded
from helpers.two_channels import D, material
from torch.testing import assert_close

from torchbrdf import Cosines, Lambert, OrenNayar, QualitativeOrenNayar, fixed, oren_nayar, qualitative
from torchbrdf.testing import magnitude, random_directions

GOLDEN = recorded("oren_nayar.json")["values"]


@pytest.mark.parametrize("sigma", SIGMAS)
@pytest.mark.parametrize("rho", [0.0, 0.3, 1.0])
def test_functional_matches_paper(sigma, rho):
    brdf = OrenNayar(albedo=held(rho), sigma=held(sigma))
    direct, bounce = zip(*(by_angles(*c, rho, sigma) for c in CONFIGURATIONS), strict=True)
    parts = brdf.components(*directions_of(CONFIGURATIONS))
    # forward grazing nearly cancels at sigma = 1.2, hence relative to the sum of the absolute terms
    scale = magnitude(brdf, *directions_of(CONFIGURATIONS))[:, 0]
    assert ((parts["direct"][:, 0] - doubles(direct)).abs() <= 1e-14 * scale).all()
    assert_close(parts["direct"][:, 0], doubles(direct), rtol=1e-12, atol=0)
    # 1 - cos(dphi) (2 beta/pi)^2 is all cancellation towards beta = 90 deg in the retro direction; 85 deg: 1e-14
    assert_close(parts["interreflection"][:, 0], doubles(bounce), rtol=1e-12, atol=0)


def test_matches_paper_with_any_normal():
    # Angles recovered from the vectors by atan2 of cross and dot product, which keeps its digits everywhere.
    normal, light, view = random_directions(300, dtype=torch.float64, generator=torch.Generator().manual_seed(5))
    angle = [
        torch.atan2(torch.linalg.cross(normal, v).norm(dim=-1), (normal * v).sum(-1)).tolist() for v in (light, view)
    ]
    side = torch.linalg.cross(normal, light), torch.linalg.cross(normal, view)
    across = (normal * torch.linalg.cross(*side)).sum(-1)
    dphi = torch.atan2(across, (side[0] * side[1]).sum(-1)).tolist()
    expected = doubles([sum(by_angles(*c, 0.7, 0.6)) for c in zip(*angle, dphi, strict=True)])
    got = OrenNayar(albedo=held(0.7), sigma=held(0.6))(normal, light, view)[:, 0]
    assert_close(got, expected, rtol=1e-12, atol=0)


@pytest.mark.parametrize(
    "row", GOLDEN, ids=lambda r: f"{r['tag']} {r['theta_i']:.2f} {r['theta_r']:.2f} {r['dphi']:.2f}"
)
def test_golden(row):
    # Beyond 89 deg the float64 cosine itself holds the angle to eps/cos = 1e-12 only (89.99 deg); what vanishes
    # there, 1 - (2 beta/pi)^2 in the retro direction, is then good to 1e-12 relative and not better.
    rtol = 1e-12 if max(row["theta_i"], row["theta_r"]) < math.radians(89) else 2e-11
    directions = directions_of([(row["theta_i"], row["theta_r"], row["dphi"])])
    for rho in (1.0, 0.4):
        material = {"albedo": held(rho), "sigma": held(row["sigma"])}
        parts = OrenNayar(**material).components(*directions)
        expected = {
            "func_d": (rho, parts["direct"]),
            "func_i": (rho**2, parts["interreflection"]),
            "qual_d": (rho, QualitativeOrenNayar(**material)(*directions)),
            "qual57_d": (rho, QualitativeOrenNayar(**material, a_constant=0.57)(*directions)),
        }
        for key, (power, got) in expected.items():
            assert_close(got[0, 0].item(), power * row[key], rtol=rtol, atol=0, msg=lambda m, key=key: f"{key}: {m}")


def test_functional_tracks_the_integral():
    # The paper's claim: measured 5.0 % rms over the directions up to 75 deg. It guards the form as a whole (a missing
    # term, a lost factor) and is too coarse to tell one empirical constant from its neighbour; the other tests do that.
    rows = [r for r in GOLDEN if max(r["theta_i"], r["theta_r"]) < 1.32 and r["sigma"] > 0.05]
    assert len(rows) > 40
    relative = []
    for row in rows:
        got = OrenNayar(albedo=held(0.9), sigma=held(row["sigma"]))(
            *directions_of([(row["theta_i"], row["theta_r"], row["dphi"])])
        ).item()
        relative.append(got / (0.9 * row["d"] + 0.81 * row["i"]) - 1)
    rms = math.sqrt(sum(e * e for e in relative) / len(relative))
    assert rms < 0.06


@pytest.mark.parametrize("build", [OrenNayar, QualitativeOrenNayar])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_sigma_zero_is_exactly_lambert(build, dtype):
    albedo = torch.tensor([0.9, 0.5, 0.1], dtype=dtype)
    directions = random_directions(500, dtype=dtype, generator=torch.Generator().manual_seed(3))
    got = build(albedo=fixed(albedo), sigma=fixed(torch.tensor(0.0, dtype=dtype)))(*directions)
    assert torch.equal(got, Lambert(albedo=fixed(albedo))(*directions))


def test_components_can_be_switched_off():
    directions = random_directions(50, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    material = {"albedo": held([0.7, 0.2]), "sigma": held(0.6)}
    both = OrenNayar(**material)
    assert list(both.components(*directions)) == ["direct", "interreflection"]
    for name, other in (("direct", "interreflection"), ("interreflection", "direct")):
        alone = OrenNayar(**material, **{other: False})
        assert list(alone.components(*directions)) == [name]
        assert torch.equal(alone(*directions), both.components(*directions)[name])


def test_both_switched_off_is_refused():
    with pytest.raises(ValueError, match="needs direct or interreflection; both are switched off"):
        OrenNayar(direct=False, interreflection=False)


@pytest.mark.parametrize("function", [oren_nayar, qualitative])
@pytest.mark.parametrize(
    ("albedo", "sigma", "match"),
    [
        (1.5, 0.3, r"albedo must lie in \[0, 1\]; 1 of 1 .*min 1.5, max 1.5"),
        (-0.1, 0.3, r"albedo must lie in \[0, 1\]"),
        (math.nan, 0.3, r"albedo must lie in .*none is finite"),
        (0.5, 1.6, r"sigma must lie in \[0, 1.571\] rad; 1 of 1 .*1.6"),
        (0.5, -0.1, r"sigma must lie in"),
    ],
)
def test_functions_refuse_materials_outside_their_domain(function, albedo, sigma, match):
    cosines = Cosines.of(NORMAL, NORMAL, NORMAL)
    with pytest.raises(ValueError, match=f"{function.__name__}: {match}"):
        function(cosines, albedo=doubles(albedo), sigma=doubles(sigma))


@pytest.mark.parametrize(("function", "build"), [(oren_nayar, OrenNayar), (qualitative, QualitativeOrenNayar)])
def test_module_forwards_to_the_function(function, build):
    directions = random_directions(50, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    albedo, sigma = doubles([0.7, 0.2]), doubles(0.6)
    got = build(albedo=fixed(albedo), sigma=fixed(sigma))(*directions)
    assert_close(got, function(Cosines.of(*directions), albedo=albedo, sigma=sigma), rtol=1e-14, atol=0)


@pytest.mark.parametrize("build", [OrenNayar, QualitativeOrenNayar])
def test_materials_per_channel_and_per_texel(build):
    generator = torch.Generator().manual_seed(4)
    normal, light, view = (v.reshape(4, 5, 3) for v in random_directions(20, dtype=torch.float64, generator=generator))
    albedo = torch.rand(4, 5, 3, dtype=torch.float64, generator=generator)
    sigma = 1.5 * torch.rand(4, 5, dtype=torch.float64, generator=generator)

    def one(row, column, channel, rho, s):
        n, li, v = (d[row, column] for d in (normal, light, view))
        return build(albedo=held(rho), sigma=held(s))(n, li, v)[0]

    cases = {
        "albedo per channel": (albedo[0, 0], sigma[0, 0], lambda r, c, k: (albedo[0, 0, k], sigma[0, 0])),
        "albedo per texel": (albedo, sigma[0, 0], lambda r, c, k: (albedo[r, c, k], sigma[0, 0])),
        "sigma per texel": (albedo[0, 0], sigma, lambda r, c, k: (albedo[0, 0, k], sigma[r, c])),
        "both per texel": (albedo, sigma, lambda r, c, k: (albedo[r, c, k], sigma[r, c])),
        "sigma per column": (albedo, sigma[0], lambda r, c, k: (albedo[r, c, k], sigma[0, c])),
        "grey, sigma per texel": (albedo[0, 0, 0], sigma, lambda r, c, k: (albedo[0, 0, 0], sigma[r, c])),
    }
    for name, (rho, s, pick) in cases.items():
        got = build(albedo=fixed(rho), sigma=fixed(s))(normal, light, view)
        channels = range(1 if name.startswith("grey") else 3)
        loop = doubles(
            [[[one(r, c, k, *(x.item() for x in pick(r, c, k))) for k in channels] for c in range(5)] for r in range(4)]
        )
        assert_close(got, loop, rtol=1e-13, atol=0, msg=lambda m, name=name: f"{name}: {m}")


def test_negative_values_begin_at_0_66_rad():
    # Documented flaw of the fit, at small albedo where no interreflection hides it.
    retro = directions_of([(t, t, PI) for t in torch.linspace(1.3, 1.5707, 200).tolist()])

    def lowest(sigma):
        return OrenNayar(albedo=held(0.01), sigma=held(sigma))(*retro).min()

    assert lowest(0.65) > 0 > lowest(0.69)


def angle_form(normal, light, view, rho, sigma, *, clamp):
    """What people write today: acos of clamped dot products, azimuth from projected vectors."""
    cosine = [(normal * v).sum(-1) for v in (light, view)]
    theta_i, theta_r = (c.clamp(-1 + clamp, 1 - clamp).acos() for c in cosine)
    flat = [v - c[..., None] * normal for v, c in zip((light, view), cosine, strict=True)]
    c = (flat[0] * flat[1]).sum(-1) / (flat[0].norm(dim=-1) * flat[1].norm(dim=-1) + 1e-8)
    alpha, beta = torch.maximum(theta_i, theta_r), torch.minimum(theta_i, theta_r)
    s2 = sigma**2
    c2 = 0.45 * s2 / (s2 + 0.09) * torch.where(c >= 0, alpha.sin(), alpha.sin() - (2 * beta / PI) ** 3)
    c3 = 0.125 * s2 / (s2 + 0.09) * (4 * alpha * beta / PI**2) ** 2
    direct = 1 - 0.5 * s2 / (s2 + 0.33) + c * c2 * beta.tan() + (1 - c.abs()) * c3 * ((alpha + beta) / 2).tan()
    return rho / PI * direct + 0.17 * rho**2 / PI * s2 / (s2 + 0.13) * (1 - c * (2 * beta / PI) ** 2)


def tilted_normal_value(x, y, theta_view, rho, sigma):
    """f by (27)-(29) with 50 digits, light (0,0,1), normal proportional to (x, y, 1)."""
    length = mpmath.sqrt(1 + x * x + y * y)
    n = [x / length, y / length, 1 / length]
    v = [mpmath.sin(theta_view), mpmath.mpf(0), mpmath.cos(theta_view)]
    light_flat = [-n[2] * n[0], -n[2] * n[1], 1 - n[2] * n[2]]
    n_view = sum(a * b for a, b in zip(n, v, strict=True))
    view_flat = [a - n_view * b for a, b in zip(v, n, strict=True)]
    sin_light, sin_view = (mpmath.sqrt(sum(a * a for a in w)) for w in (light_flat, view_flat))
    c = sum(a * b for a, b in zip(light_flat, view_flat, strict=True)) / (sin_light * sin_view)
    theta_i, theta_r = mpmath.atan2(sin_light, n[2]), mpmath.atan2(sin_view, n_view)
    return sum(by_angles(theta_i, theta_r, mpmath.acos(max(-1, min(1, c))), rho, sigma, m=mpmath))


def test_gradient_to_the_normal_where_light_is_normal():
    # f is smooth there: cos(dphi) tan(beta) is linear in the tilt, the rest of higher order.
    rho, sigma, theta_view = 0.7, 0.7, math.radians(60)
    with mpmath.workdps(50):
        h = mpmath.mpf(10) ** -12
        args = (mpmath.mpf(theta_view), mpmath.mpf(rho), mpmath.mpf(sigma))
        truth = [
            float(
                (
                    tilted_normal_value(*(h * e for e in axis), *args)
                    - tilted_normal_value(*(-h * e for e in axis), *args)
                )
                / (2 * h)
            )
            for axis in ((1, 0), (0, 1))
        ]
    # by hand: -(rho/pi) 0.45 sigma^2/(sigma^2 + 0.09) sin(alpha), straight towards the viewer
    assert_close(truth[0], -rho / PI * 0.45 * 0.49 / 0.58 * math.sin(theta_view), rtol=1e-9, atol=0)
    assert abs(truth[1]) < 1e-9
    for dtype, rtol in ((torch.float64, 1e-9), (torch.float32, 1e-6)):
        light = NORMAL.to(dtype)
        view = torch.tensor(direction(theta_view), dtype=dtype)
        normal = light.clone().requires_grad_()
        brdf = OrenNayar(albedo=torch.tensor(rho, dtype=dtype), sigma=torch.tensor(sigma, dtype=dtype))
        (ours,) = torch.autograd.grad(brdf(normal, light, view, normalize=True).sum(), normal)
        assert_close(ours, torch.tensor([truth[0], 0.0, 0.0], dtype=dtype), rtol=rtol, atol=rtol * 0.1)
        # The angle form: hundreds instead of 0.073 with the usual clamps, NaN with none.
        for clamp in (1e-6, 1e-7):
            (theirs,) = torch.autograd.grad(angle_form(normal, light, view, rho, sigma, clamp=clamp).sum(), normal)
            assert theirs.norm() > 100
        (theirs,) = torch.autograd.grad(angle_form(normal, light, view, rho, sigma, clamp=0.0).sum(), normal)
        assert theirs.isnan().all()


def test_gradient_where_light_is_a_tilted_normal():
    # Rounding leaves the cosine on either side of 1; the gradient stays the hand-derived one.
    generator = torch.Generator().manual_seed(6)
    for dtype, atol in ((torch.float64, 1e-8), (torch.float32, 1e-5)):
        normal, _, view = random_directions(2000, dtype=torch.float64, generator=generator)
        across = view - (normal * view).sum(-1, keepdim=True) * normal
        expected = -0.7 / PI * 0.45 * 0.49 / 0.58 * across
        n = normal.to(dtype, copy=True).requires_grad_()
        brdf = OrenNayar(albedo=torch.tensor(0.7, dtype=dtype), sigma=torch.tensor(0.7, dtype=dtype))
        (ours,) = torch.autograd.grad(brdf(n, normal.to(dtype), view.to(dtype), normalize=True).sum(), n)
        assert_close(ours, expected.to(dtype), rtol=0, atol=atol)


@pytest.mark.parametrize("sigma", [0.1, 0.5, 1.0, 1.2])
def test_float32_error(sigma):
    # Below 1e-6 of the sum of the absolute terms (see test_laws for the rare exceptions at sigma >= 1.2), which is
    # the value itself where nothing cancels. Forward grazing cancels at large sigma: the plain relative error reaches
    # 2e-5 at sigma = 1.2 and rho = 0.7, and has no bound at small rho, where f crosses 0.
    directions = random_directions(50_000, generator=torch.Generator().manual_seed(7))
    rho, s = torch.tensor([0.05, 0.95]), torch.tensor(sigma)
    got = OrenNayar(albedo=fixed(rho), sigma=fixed(s))(*directions).double()
    exact = OrenNayar(albedo=fixed(rho.double()), sigma=fixed(s.double()))
    upcast = [torch.nn.functional.normalize(v.double(), dim=-1) for v in directions]
    error = (got - exact(*upcast)).abs()
    assert (error <= 1e-6 * magnitude(exact, *upcast)).all()
    backward = (upcast[1] * upcast[2]).sum(-1) >= (upcast[0] * upcast[1]).sum(-1) * (upcast[0] * upcast[2]).sum(-1)
    assert (error <= 1e-6 * exact(*upcast).abs())[backward].all()  # nothing cancels on the side of the light


def test_c3_acts_across_the_plane_of_incidence_alone():
    whole, without = material(OrenNayar), material(OrenNayar, c3=False)
    up = torch.tensor([0.0, 0, 1], dtype=D)
    light = torch.tensor([0.8, 0, 0.6], dtype=D)
    along, across = torch.tensor([0.6, 0, 0.8], dtype=D), torch.tensor([0, 0.6, 0.8], dtype=D)
    torch.testing.assert_close(whole(up, light, along), without(up, light, along), rtol=1e-14, atol=0)
    # (27) at dphi = 90 deg: C3 tan((a + b)/2) with C3 = 0.125 s (4 a b/pi^2)^2
    a, b = torch.acos(light[2]), torch.acos(across[2])
    c3 = 0.125 * 0.25 / (0.25 + 0.09) * (4 * a * b / torch.pi**2) ** 2 * torch.tan((a + b) / 2)
    difference = whole(up, light, across) - without(up, light, across)
    torch.testing.assert_close(difference, whole.albedo / torch.pi * c3, rtol=1e-7, atol=0)


def test_an_interreflection_alone_has_no_stand_in():
    assert material(OrenNayar, direct=False).stand_ins() == {}
