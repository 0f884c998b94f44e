"""Energy, the averaged specular part and sampling of the He-Torrance model; what the module says and refuses."""

import math
import warnings

import pytest
import torch
from test_he_torrance import GOLDEN, UP, doubles, material
from torch.testing import assert_close

from torchbrdf import HeTorrance, fixed
from torchbrdf import testing as laws
from torchbrdf.models.he_torrance.energy import directional_diffuse_albedo
from torchbrdf.models.he_torrance.reflectance import specular_reflectivity
from torchbrdf.models.he_torrance.specular import cone_overlap

PERFECT = 1e4j  # |F| = 1 at every angle


def cosines(*degrees):
    return torch.deg2rad(doubles(degrees)).cos()


def model(sigma0, tau, wavelength, index, **more):
    return HeTorrance(
        **{name: fixed(value) for name, value in material(sigma0, tau, wavelength, index).items()}, **more
    )


def surface_albedo(cos, *parameters):
    surface = material(*parameters)
    return (directional_diffuse_albedo(cos, **surface) + specular_reflectivity(cos, **surface))[:, 0]


# figures of the equation sheet, section 10 and 2, by another quadrature
@pytest.mark.parametrize(
    ("parameters", "degrees", "expected", "atol"),
    [
        ((0.05, 3.0, 0.5, PERFECT), (0, 30, 60), (1.0, 1.0, 1.0), 5e-5),
        ((0.05, 3.0, 0.5, PERFECT), (86, 89), (1.0217, 0.44), 5e-3),
        ((1.45, 13.2, 0.5, 1.74), (0, 60, 84), (0.073, 0.115, 0.221), 6e-4),
        ((0.28, 1.77, 0.5, 0.77 + 6.08j), (0, 60), (0.919, 0.806), 5e-4),
    ],
)
def test_what_the_surface_returns(parameters, degrees, expected, atol):
    assert_close(surface_albedo(cosines(*degrees), *parameters), doubles(expected), rtol=0, atol=atol)


@pytest.mark.parametrize(
    "parameters",
    [
        (0.28, 1.77, 0.5, 0.77 + 6.08j),
        (0.05, 3.0, 0.5, PERFECT),
        (1.45, 13.2, 0.5, 1.74),
        (4.4, 1.0, 0.55, 1.5),
        (0.001, 100.0, 0.5, 1.5),
    ],
)
def test_quadrature_is_as_good_as_it_says(parameters):
    surface, cos = material(*parameters), cosines(0, 30, 60, 80, 86, 89, 89.9)
    fine = directional_diffuse_albedo(cos, nodes=80, **surface)
    assert (directional_diffuse_albedo(cos, **surface) - fine).abs().max() < 2e-7
    assert (directional_diffuse_albedo(cos, nodes=16, **surface) - fine).abs().max() < 1e-4


def test_albedo_agrees_with_monte_carlo():
    # draws of the sampler, five standard errors; the specular part is drawn apart
    for angle in (0.3, 1.4):
        brdf = model(0.1, 1.0, 0.5, 0.77 + 6.08j, diffuse=fixed(doubles([0.05])))
        with torch.no_grad():
            weight = laws.SamplingSetup.of(brdf, angle).draw(40_000, torch.Generator().manual_seed(1)).weight
        expected = brdf.directional_albedo(doubles(math.cos(angle)))
        assert abs(float(weight.mean() - expected)) < 5 * float(weight.std()) / math.sqrt(40_000)


@pytest.mark.parametrize(
    ("parameters", "degrees", "variance", "largest"),
    [
        ((0.28, 1.77, 0.5), 0, 0.13, 1.3),
        ((0.28, 1.77, 0.5), 60, 0.35, 1.6),
        ((0.28, 1.77, 0.5), 85, 1.2, 4.0),
        ((0.28, 1.77, 2.0), 60, 0.29, 2.0),
        ((0.02, 1.0, 0.5), 60, 0.04, 2.5),
        ((4.4, 1.0, 0.55), 85, 4.0, 12.0),
    ],
)
def test_sampling_variance(parameters, degrees, variance, largest):
    # variance over squared mean, largest weight over mean
    brdf = model(*parameters, 0.77 + 6.08j)
    with torch.no_grad():
        w = laws.SamplingSetup.of(brdf, math.radians(degrees)).draw(40_000, torch.Generator().manual_seed(0)).weight
    assert w.var() / w.mean() ** 2 < variance
    assert w.max() / w.mean() < largest


def test_diffuse_from_a_measured_reflectance():
    # blue plastic: rho_dh = 0.195 and a = 0.15 belong to an index of 1.538; n = 1.5 leaves 0.155
    plastic = model(0.0, 1.0, 0.46, 1.538)
    assert_close(plastic.diffuse_from_reflectance(doubles(0.195)), doubles([0.15]), rtol=0, atol=2e-4)
    plastic = model(0.0, 1.0, 0.46, 1.5)
    a = plastic.diffuse_from_reflectance(doubles(0.195))
    assert_close(a, doubles([0.155]), rtol=1e-12, atol=0)
    plastic.diffuse = a
    assert_close(plastic.directional_albedo(doubles(1.0)), doubles([0.195]), rtol=1e-12, atol=0)
    rough = model(0.2, 2.0, 0.46, 1.5)
    rough.diffuse = rough.diffuse_from_reflectance(doubles(0.4), cos_light=doubles(0.7))
    assert_close(rough.directional_albedo(doubles(0.7)), doubles([0.4]), rtol=1e-12, atol=0)
    with pytest.raises(ValueError, match=r"the surface alone reflects 0\.04 to 0\.04, which leaves -0\.03"):
        model(0.0, 1.0, 0.46, 1.5).diffuse_from_reflectance(doubles(0.01))


def test_energy_bound_and_its_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dull = model(1.45, 13.2, 0.5, 1.74, diffuse=fixed(doubles([0.7])))
    assert_close(dull.energy_bound(), doubles([0.779]), rtol=0, atol=2e-3)
    with pytest.warns(UserWarning, match=r"diffuse = 0\.9 exceeds the energy bound 0\.78.*together 1\.12"):
        model(1.45, 13.2, 0.5, 1.74, diffuse=fixed(doubles([0.9])))
    # a smooth dielectric reflects everything at 90 degrees
    glass = model(0.0, 1.0, 0.5, 1.5)
    assert glass.energy_bound(max_angle=math.pi / 2 - 1e-6) < 1e-4
    # an included part counts, one left out does not
    uniform = model(0.0, 1.0, 0.5, 1.5, specular=False, diffuse=fixed(doubles([1.0])))
    assert_close(uniform.energy_bound(), doubles([1.0]))


def test_units_that_differ_are_noticed():
    with pytest.warns(UserWarning, match=r"tau is 0\.003218 to 0\.003218 wavelengths.*one unit of length"):
        HeTorrance(sigma0=0.28, tau=1.77, wavelength=550.0)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"sigma0": fixed(-0.1)}, r"HeTorrance\.sigma0 must lie in \[0, inf\)"),
        ({"sigma0": 0.0}, r"HeTorrance\.sigma0 must lie in \(0, inf\).*fixed"),
        ({"tau": fixed(0.0)}, r"HeTorrance\.tau must lie in"),
        ({"wavelength": fixed(0.0)}, r"HeTorrance\.wavelength must lie in"),
        ({"diffuse": fixed(1.1)}, r"HeTorrance\.diffuse must lie in \[0, 1\]"),
        (
            {"wavelength": torch.ones(3), "eta": torch.full((2,), 1.5)},
            "one entry for each channel.*wavelength 3, eta 2",
        ),
        ({"solid_angle": 7.0}, r"HeTorrance\.solid_angle must lie in .* sr; found 7"),
        ({"specular": False, "directional_diffuse": False, "uniform_diffuse": False}, "all are switched off"),
    ],
)
def test_refusals(more, message):
    with pytest.raises(ValueError, match=message):
        HeTorrance(**{"sigma0": 0.28, "tau": 1.77, "wavelength": 0.5, **more})


def test_parts_can_be_left_out():
    light, view = doubles([0.6, 0.0, 0.8]), doubles([-0.48, 0.6, 0.64])
    parameters = (0.1, 1.0, 0.5, 1.5)
    material = {"diffuse": fixed(doubles([0.3])), "solid_angle": 1.0}
    whole = model(*parameters, **material).components(UP, light, view)
    assert list(whole) == ["specular", "directional_diffuse", "uniform_diffuse"]
    assert all(float(part) > 0 for part in whole.values())
    for name in whole:
        rest = model(*parameters, **material, **{name: False})
        assert list(rest.components(UP, light, view)) == [other for other in whole if other != name]
        assert_close(rest(UP, light, view), sum(part for other, part in whole.items() if other != name))
    assert (model(*parameters).components(UP, light, view)["specular"] == 0).all()


def test_mirror_lobe_is_drawn_with_its_reflectance():
    brdf = model(0.02, 1.0, 0.5, 0.77 + 6.08j)
    sample = laws.SamplingSetup.of(brdf, 0.8).draw(2000, torch.Generator().manual_seed(0))
    mirrored = sample.pdf.isinf()
    share = float(mirrored.double().mean())
    assert 0.5 < share < 1
    expected = brdf.specular_reflectivity(doubles(math.cos(0.8)))
    assert_close(
        sample.weight[mirrored].mean() * brdf._shares(doubles([math.cos(0.8)]))[0], expected, rtol=1e-9, atol=0
    )
    assert model(0.02, 1.0, 0.5, 1.5, specular=False).delta_reflectance(brdf.cosines(UP, UP, UP)) is None


# The specular part over finite cones


@pytest.mark.parametrize("case", GOLDEN["cap_overlap"])
def test_cone_overlap_reference_values(case):
    solid_angle = 4 * math.pi * math.sin(case["alpha"] / 2) ** 2
    got = cone_overlap(doubles([math.sin(case["gamma"] / 2) ** 2]), solid_angle)
    assert_close(got, doubles([float(case["fraction"])]), rtol=1e-11, atol=0)
    single = cone_overlap(doubles([math.sin(case["gamma"] / 2) ** 2]).float(), solid_angle)
    assert_close(single.double(), got, rtol=1e-3, atol=3e-7)


def test_cone_overlap_by_counting():
    alpha, gamma, n = 0.6, 0.5, 200_000
    generator = torch.Generator().manual_seed(0)
    flat = (1 - math.cos(alpha)) * torch.rand(n, dtype=torch.float64, generator=generator)
    turn = 2 * math.pi * torch.rand(n, dtype=torch.float64, generator=generator)
    along = (flat * (2 - flat)).sqrt() * turn.cos() * math.sin(gamma) + (1 - flat) * math.cos(gamma)
    counted = (along > math.cos(alpha)).double().mean()
    got = cone_overlap(doubles([math.sin(gamma / 2) ** 2]), 4 * math.pi * math.sin(alpha / 2) ** 2)
    assert abs(float(got) - float(counted)) < 5 * math.sqrt(0.25 / n)


def test_slope_of_the_cone_overlap():
    # a cone that moves loses the strip between two arcs: -2 s sqrt(1 - cos^2(arc))
    alpha = 0.0312
    solid_angle = 4 * math.pi * math.sin(alpha / 2) ** 2
    gamma = torch.linspace(0.001, 2 * alpha * (1 - 1e-9), 400, dtype=torch.float64).requires_grad_()
    (slope,) = torch.autograd.grad(cone_overlap((gamma / 2).sin() ** 2, solid_angle).sum(), gamma)
    arc = (gamma.detach() / 2).tan() / math.tan(alpha)
    assert_close(slope, -2 * math.sin(alpha) * (1 - arc**2).sqrt() / solid_angle, rtol=0, atol=1e-6)
    ends = doubles([0.0, math.sin(alpha) ** 2, 0.5]).requires_grad_()
    (slope,) = torch.autograd.grad(cone_overlap(ends, solid_angle).sum(), ends)
    assert slope.isfinite().all()


def test_specular_part_at_the_mirror_direction_and_in_all():
    # rho_s/(cos dw) at its top; all of it together is rho_s, but for the width of the cone
    solid_angle = math.pi / 1024
    brdf = model(0.28, 1.77, 2.0, 2.15 + 20.7j, solid_angle=solid_angle, directional_diffuse=False)
    for theta in (0.2, 0.8, 1.3):
        light, view = (doubles([x * math.sin(theta), 0.0, math.cos(theta)]) for x in (1, -1))
        rho_s = brdf.specular_reflectivity(light[2])
        assert_close(brdf(UP, light, view), rho_s / (math.cos(theta) * solid_angle), rtol=1e-12, atol=0)
        assert_close(brdf.directional_albedo(light[2]), rho_s, rtol=5e-3, atol=0)
