"""The He-Torrance module: what it refuses, warns of and returns in which shape, and what may be left out of it."""

import math
import warnings

import pytest
import torch
from helpers.he_torrance_surfaces import UP, material
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import EFFECTS, Cosines, HeTorrance, fixed, he_torrance, simulated
from torchbrdf.testing import random_directions

PART_OF = {
    "specular": "specular",
    "directional diffuse": "directional_diffuse",
    "uniform diffuse": "uniform_diffuse",
}


def surface(**parts):
    return HeTorrance(
        sigma0=torch.tensor(0.1), tau=torch.tensor(1.5), wavelength=fixed(torch.tensor([0.65, 0.55])),
        eta=torch.tensor([1.4, 1.5]), diffuse=fixed(0.2), solid_angle=0.3, **parts,
    )  # fmt: skip


def parts_of(model):
    """Its options to leave a part out."""
    return {effect: options for effect, options in model.stand_ins().items() if effect != "wave optics"}


def test_each_part_is_an_effect():
    model = surface()
    assert simulated(model) == ("wave optics", *PART_OF)
    assert set(PART_OF) <= set(EFFECTS)
    directions = random_directions(50, generator=torch.Generator().manual_seed(0))
    whole = model.components(*directions)
    for effect, (option,) in parts_of(model).items():
        assert option.skips == (effect,)
        left = option.model.components(*directions)
        assert set(left) == set(whole) - {PART_OF[effect]}
        for name, part in left.items():
            assert_close(part, whole[name], rtol=1e-6, atol=0)


def test_parameters_stay_trainable_or_held():
    model = surface()
    for (option,) in parts_of(model).values():
        stand_in = option.model
        assert isinstance(stand_in, HeTorrance)
        assert {name for name, _ in stand_in.named_parameters()} == {name for name, _ in model.named_parameters()}
        assert stand_in.solid_angle == model.solid_angle
    (facets,) = model.stand_ins()["wave optics"]
    assert [name for name, _ in facets.model.named_parameters()] == ["raw_eta"]
    assert "wave optics" not in facets.model.stand_ins()


@pytest.mark.parametrize("left_out", ["specular", "directional_diffuse", "uniform_diffuse"])
def test_the_last_part_stays(left_out):
    model = surface(**{left_out: False})
    assert model.parts == tuple(name for name in HeTorrance.PARTS if name != left_out)
    for (option,) in parts_of(model).values():
        assert isinstance(option.model, HeTorrance)
        assert len(option.model.parts) == 1
        assert parts_of(option.model) == {}
    assert len(parts_of(model)) == 2
    assert ("wave optics" in model.stand_ins()) == (left_out != "directional_diffuse")


def model(sigma0, tau, wavelength, index, **more):
    return HeTorrance(
        **{name: fixed(value) for name, value in material(sigma0, tau, wavelength, index).items()}, **more
    )


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


def test_only_ratios_of_lengths_count():
    # raw lengths are logarithms: what one unit more for all of them changes is nothing
    surface = material(0.05, 0.7, 0.5, 0.77 + 6.08j)
    model = HeTorrance(**surface, diffuse=doubles([0.02]), solid_angle=0.5)
    f = model(*random_directions(50, dtype=torch.float64, generator=torch.Generator().manual_seed(0))).sum()
    raw = [model.raw_sigma0, model.raw_tau, model.raw_wavelength]
    slopes = torch.stack([g.sum() for g in torch.autograd.grad(f, raw)])
    assert slopes.sum().abs() < 1e-9 * slopes.abs().max()


def test_shapes():
    directions = random_directions(6, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    per_pixel = {"sigma0": torch.linspace(0.1, 0.6, 6).double(), "tau": torch.linspace(1.0, 2.0, 6).double()}
    channels = {"wavelength": doubles([0.6, 0.5, 0.4]), "eta": doubles([1.5, 1.6, 1.7]), "k": doubles(0.0)}
    cosines = Cosines.of(*directions)
    together = he_torrance(cosines, diffuse=doubles(0.1), **per_pixel, **channels)
    assert together.shape == (6, 3)
    for i in range(6):
        one = Cosines.of(*(v[i] for v in directions))
        alone = he_torrance(one, diffuse=doubles(0.1), **{n: v[i] for n, v in per_pixel.items()}, **channels)
        assert_close(together[i], alone, rtol=1e-13, atol=0)
    model = HeTorrance(**{n: fixed(v) for n, v in (per_pixel | channels).items()})
    assert model.directional_albedo(doubles([0.5] * 6), nodes=8).shape == (6, 3)
    with pytest.raises(ValueError, match="parameters are per pixel"):
        model.energy_bound()
