"""Both Oren-Nayar approximations against the paper's own trigonometry and against golden values.

Golden values: tests/data/README.md says where they come from.
"""

import json
import math
from itertools import product
from pathlib import Path

import pytest
import torch
from paper_form import NORMAL, PI, by_angles, direction, qualitative_by_angles
from torch.testing import assert_close

from torchbrdf import Cosines, Lambert, OrenNayar, QualitativeOrenNayar, fixed, oren_nayar, qualitative
from torchbrdf.testing import magnitude, random_directions

GOLDEN = json.loads((Path(__file__).parents[2] / "data" / "oren_nayar.json").read_text())["values"]

ANGLES = [0.0, 0.2, 0.7, 1.2, math.radians(85)]
AZIMUTHS = [0.0, 0.6, PI / 2, 2.5, PI, -2.0, 3.5]
CONFIGURATIONS = list(product(ANGLES, ANGLES, AZIMUTHS))
SIGMAS = [0.0, 0.1, 0.5, 1.2]


def directions_of(configurations):
    light = torch.tensor([direction(i) for i, _, _ in configurations], dtype=torch.float64)
    view = torch.tensor([direction(r, dphi) for _, r, dphi in configurations], dtype=torch.float64)
    return NORMAL, light, view


def doubles(values):
    return torch.tensor(values, dtype=torch.float64)


def held(value):
    """Exactly this number: a trained one goes through its raw coordinate and back."""
    return fixed(doubles(value))


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


@pytest.mark.parametrize("constant", [0.33, 0.57])
@pytest.mark.parametrize("sigma", SIGMAS)
def test_qualitative_matches_paper(sigma, constant):
    brdf = QualitativeOrenNayar(albedo=held(0.7), sigma=held(sigma), a_constant=constant)
    expected = doubles([qualitative_by_angles(*c, 0.7, sigma, constant=constant) for c in CONFIGURATIONS])
    assert_close(brdf(*directions_of(CONFIGURATIONS))[:, 0], expected, rtol=1e-12, atol=0)


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


def test_lambert_is_albedo_over_pi():
    directions = random_directions(10, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    assert_close(Lambert(albedo=held([0.5, 1.0]))(*directions), doubles([[0.5 / PI, 1 / PI]]).expand(10, 2))


@pytest.mark.parametrize(
    "brdf",
    [
        OrenNayar(albedo=held([0.7, 0.2]), sigma=held(0.6)),
        OrenNayar(albedo=held([0.7, 0.2]), sigma=held(0.6), interreflection=False),
        QualitativeOrenNayar(albedo=held([0.7, 0.2]), sigma=held(0.6)),
        Lambert(albedo=held([0.7, 0.2])),
    ],
    ids=["functional", "direct only", "qualitative", "lambert"],
)
def test_forward_is_basis_times_coefficients(brdf):
    directions = random_directions(500, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    basis = brdf.basis(Cosines.of(*directions))
    coefficients = brdf.coefficients()
    assert basis.shape == (500, coefficients.shape[-1])
    assert coefficients.shape[:-1] == (2,)
    got = (basis[..., None, :] * coefficients).sum(-1)
    assert ((got - brdf(*directions)).abs() <= 1e-15 * magnitude(brdf, *directions)).all()


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


@pytest.mark.parametrize("constant", [0.0, -0.33, math.nan])
def test_constant_in_a_must_be_positive(constant):
    with pytest.raises(ValueError, match=r"QualitativeOrenNayar.a_constant must be positive \(0.33 or 0.57\)"):
        QualitativeOrenNayar(a_constant=constant)


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
