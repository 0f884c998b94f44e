"""The reference of random heightfields: traced surfaces, limits, derivatives, draws."""

import math

import pytest
import torch
from helpers.heightfields import (
    F64,
    all_azimuths,
    cosines,
    f64,
    held,
    rms,
    rotation,
    traced,
    vectors,
    weights,
)
from torch.testing import assert_close

from torchbrdf import (
    MESHED_HEIGHTFIELD,
    SMOOTH_HEIGHTFIELD,
    Cosines,
    GaussianHeightfield,
    Lambert,
    fixed,
    gaussian_heightfield,
)
from torchbrdf.testing import hard_directions, random_directions


@pytest.mark.parametrize(
    ("name", "constants", "bar"),
    [
        ("own_0.3", MESHED_HEIGHTFIELD, 0.003),
        ("own_0.67", MESHED_HEIGHTFIELD, 0.008),
        ("own_1", MESHED_HEIGHTFIELD, 0.011),
        ("t12_0.3", SMOOTH_HEIGHTFIELD, 0.003),
        ("t12_0.67", SMOOTH_HEIGHTFIELD, 0.008),
        ("t12_1", SMOOTH_HEIGHTFIELD, 0.011),
    ],
)
def test_traced_surfaces_look_like_this(name, constants, bar):
    slope, directions, truth = traced(name)
    brdf = GaussianHeightfield.from_rms_slope(held(slope), albedo=held(0.9), constants=constants)
    error = brdf.evaluate(directions)[..., 0] / truth["full_0.9"] - 1
    assert rms(all_azimuths(error)) < bar
    direct, two = (brdf.fields(directions)[..., n] / truth[f"f{n + 1}"] - 1 for n in (0, 1))
    assert rms(all_azimuths(direct)) < 0.0045
    assert rms(all_azimuths(two)) < 0.025
    smith = GaussianHeightfield.from_rms_slope(held(slope), albedo=held(0.9), occlusion=held(0.0), constants=constants)
    assert rms(all_azimuths(smith.fields(directions)[..., 0] / truth["f1"] - 1)) > 5 * rms(all_azimuths(direct))


def test_two_scales_are_a_larger_occlusion():
    slope, directions, truth = traced("acf_two_0.67")

    def error(occlusion):
        brdf = GaussianHeightfield.from_rms_slope(held(slope), occlusion=held(occlusion), constants=MESHED_HEIGHTFIELD)
        return rms(all_azimuths(brdf.fields(directions)[..., 0] / truth["f1"] - 1))

    assert error(1.6) < 0.008
    assert error(1.0) > 0.06
    assert error(0.0) > 0.1


def test_without_roughness_it_is_lambert():
    directions = random_directions(200, dtype=F64, generator=torch.Generator().manual_seed(0))
    albedo = f64([0.2, 0.9])
    for occlusion in (0.0, 1.0, 1.8):
        brdf = GaussianHeightfield(albedo=fixed(albedo), sigma=held(0.0), occlusion=held(occlusion))
        assert_close(brdf(*directions), Lambert(albedo=fixed(albedo))(*directions), rtol=4e-15, atol=0)


def test_light_along_the_normal_knows_no_azimuth():
    turns = torch.linspace(0, 2 * math.pi, 25, dtype=F64)
    for sigma in (0.2, 0.9):
        for nodes in (240, 560):
            brdf = GaussianHeightfield(albedo=held(0.8), sigma=held(sigma), nodes=nodes)
            f = brdf(*vectors(0.0, 1.2, turns))[:, 0]
            assert_close(f, f[:1].expand_as(f), rtol=1e-12, atol=0)
            tilted = brdf(*vectors(1e-6, 1.2, turns))[:, 0]  # no jump beside it
            assert_close(tilted, f, rtol=1e-6, atol=0)


@pytest.mark.parametrize("sigma", [5, 20, 40, 60])
def test_white_facets_lose_no_light(sigma):
    # between the nodes of the table, where the balance is interpolated
    brdf = GaussianHeightfield(albedo=held(1.0), sigma=held(math.radians(sigma)))
    angles = torch.linspace(0, 89, 30, dtype=F64).deg2rad()
    lost = 1 - brdf.directional_albedo(angles.cos(), nodes=48)[:, 0]
    assert lost.abs().max() < 1e-3


def test_every_pixel_has_its_sigma():
    # direct light at no more cost; bounces by a table a value
    generator = torch.Generator().manual_seed(3)
    directions = random_directions(6, dtype=F64, generator=generator)
    sigma, occlusion = (
        0.1 + torch.rand(6, dtype=F64, generator=generator),
        torch.rand(6, dtype=F64, generator=generator),
    )
    settings = {"nodes": 160, "polar_nodes": 6, "table_orders": 4}
    field = GaussianHeightfield(albedo=held([0.3, 0.9]), sigma=fixed(sigma), occlusion=fixed(occlusion), **settings)
    f = field(*directions)
    for k in range(6):
        one = GaussianHeightfield(
            albedo=held([0.3, 0.9]), sigma=fixed(sigma[k]), occlusion=fixed(occlusion[k]), **settings
        )
        assert_close(f[k], one(*(v[k] for v in directions)), rtol=1e-12, atol=0)


def test_bounces_add_up():
    directions = random_directions(50, dtype=F64, generator=torch.Generator().manual_seed(4))
    models = {n: GaussianHeightfield(albedo=held(0.7), sigma=held(0.6), bounces=n) for n in (1, 2, 5, "all")}
    f = {n: m(*directions) for n, m in models.items()}
    parts = models["all"].components(*directions)
    assert list(models[1].components(*directions)) == ["direct"]
    assert list(models[2].components(*directions)) == ["direct", "two_bounce"]
    assert_close(parts["direct"], f[1], rtol=1e-14, atol=0)
    assert_close(parts["direct"] + parts["two_bounce"], f[2], rtol=1e-13, atol=0)
    assert (f[1] < f[2]).all()
    assert (f[5] < f["all"]).all()
    assert_close(
        models["all"].fields(models["all"].cosines(*directions))[:, :5] @ (0.7 ** torch.arange(1, 6)).double(),
        f[5][:, 0],
    )
    rest = f["all"] / f[5] - 1  # rho^6 f_6 ..
    assert rest.max() < 0.02


@pytest.mark.parametrize("name", ["albedo", "sigma", "occlusion"])
def test_derivatives_by_the_material(name):
    directions = random_directions(7, dtype=F64, generator=torch.Generator().manual_seed(5))
    point = {"albedo": f64(0.8), "sigma": f64(0.6), "occlusion": f64(0.9)}
    c = Cosines.of(*directions, normalize=True)

    def f(x):
        return gaussian_heightfield(c, **(point | {name: x}), nodes=160)[:, 0]

    slope = torch.autograd.functional.jacobian(f, point[name])
    step = 1e-5
    assert_close(slope, (f(point[name] + step) - f(point[name] - step)) / (2 * step), rtol=2e-7, atol=1e-9)


# A name of the hard directions above the horizon; the retro cone and its neighbours have no two-sided derivative.
SMOOTH = [
    name
    for name in hard_directions()
    if not any(word in name for word in ("retro", "below", "opposite", "90 deg", "normal = light = view"))
]


@pytest.mark.parametrize("where", SMOOTH)
@pytest.mark.parametrize("sigma", [0.15, 0.7])
def test_derivatives_by_the_directions(where, sigma):
    # along random turns of both, in a random frame; the nodes of the slopes move with the directions
    generator = torch.Generator().manual_seed(6)
    turn = rotation(generator)
    normal, light, view = (v.to(F64) @ turn.T for v in hard_directions(F64)[where])
    brdf = GaussianHeightfield(albedo=held(0.8), sigma=held(sigma), nodes=560)
    steps = torch.randn(6, 2, 3, dtype=F64, generator=generator)
    steps = steps - (steps * torch.stack((light, view))).sum(-1, keepdim=True) * torch.stack((light, view))
    steps = steps / steps.norm(dim=(-1, -2), keepdim=True)
    h = 1e-5 * min(float(normal @ light), float(normal @ view))

    def f(t):
        moved = torch.stack((light, view)) + t[:, None, None] * steps
        return brdf(normal.expand(6, 3), moved[:, 0], moved[:, 1], normalize=True)[:, 0]

    zero = torch.zeros(6, dtype=F64, requires_grad=True)
    (slope,) = torch.autograd.grad(f(zero).sum(), zero)
    difference = (f(zero.detach() + h) - f(zero.detach() - h)) / (2 * h)
    # at equal polar angles the two directions change places, and with them the rule's error
    assert_close(slope, difference, rtol=5e-5, atol=1e-5 * difference.abs().max().item())


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"GaussianHeightfield: nodes must be one of 160, 240, 384, 560; found 200"):
        GaussianHeightfield(nodes=200)
    with pytest.raises(ValueError, match=r'GaussianHeightfield: bounces must be 1 to 25 or "all"; found 26'):
        GaussianHeightfield(bounces=26)
    for bounces in (0, True, "two"):
        with pytest.raises(ValueError, match="bounces must be"):
            GaussianHeightfield(bounces=bounces)
    with pytest.raises(ValueError, match=r"polar_nodes and table_orders must be at least 2; found \(1, 24\)"):
        GaussianHeightfield(polar_nodes=1)
    with pytest.raises(ValueError, match=r"GaussianHeightfield\.occlusion must lie in \[0, 1\.8\]"):
        GaussianHeightfield(occlusion=held(1.9))
    with pytest.raises(ValueError, match=r"from_rms_slope: rms_slope must lie in \[0, 1\.482\]"):
        GaussianHeightfield.from_rms_slope(1.5)
    with pytest.raises(ValueError, match=r"gaussian_heightfield: sigma must lie in \[0, 1\.571\] rad"):
        gaussian_heightfield(cosines(0.1, 0.2, 0.3), albedo=f64(0.5), sigma=f64(2.0), occlusion=f64(1.0))


def test_rms_slope_is_another_name_of_sigma():
    brdf = GaussianHeightfield.from_rms_slope(0.3975, albedo=0.5)
    assert brdf.sigma.item() == pytest.approx(math.radians(20), rel=1e-4)
    assert "raw_sigma" in dict(brdf.named_parameters())
    assert "raw_sigma" not in dict(GaussianHeightfield.from_rms_slope(fixed(0.4)).named_parameters())


def test_the_reference_draws_alike():
    brdf = GaussianHeightfield(albedo=held(0.9), sigma=held(0.7), nodes=160)
    for degrees in (30, 85):
        w = weights(brdf, degrees, 4000)
        assert w.var() < 0.05 * w.mean() ** 2
        assert w.max() < 2.5 * w.mean()
