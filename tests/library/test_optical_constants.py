"""Tables of refractive indices: published values, fits of dielectrics, the range."""

import math
from pathlib import Path

import pytest
import torch
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import ACRYLIC, ALUMINIUM, COPPER, CROWN_GLASS, FUSED_SILICA, GOLD, MAGNESIUM_OXIDE, SILVER, conductor

DATA = Path(__file__).parents[3] / "shared" / "data" / "optical_constants"
METALS = [ALUMINIUM, COPPER, GOLD, SILVER]
TRANSPARENT = [ACRYLIC, CROWN_GLASS, FUSED_SILICA, MAGNESIUM_OXIDE]


@pytest.mark.parametrize("metal", METALS, ids=lambda m: m.name)
def test_measured_values_and_what_lies_between(metal):
    ascending = doubles(metal.wavelengths)
    assert (ascending.diff() > 0).all()
    assert len(metal.eta) == len(metal.k) == len(metal.wavelengths)
    eta, k = metal(ascending)
    assert_close(eta, doubles(metal.eta))
    assert_close(k, doubles(metal.k))
    middle, _ = metal((ascending[1:] + ascending[:-1]) / 2)
    assert_close(middle, (eta[1:] + eta[:-1]) / 2)
    assert metal.wavelengths[0] < 0.38
    assert metal.wavelengths[-1] > 1.9


@pytest.mark.parametrize(
    ("material", "wavelength", "eta", "k"),
    [
        # He et al. 1991; McPeak et al. 2015; Babar & Weaver 2015: films differ by up to 0.05 in reflectance
        (ALUMINIUM, 0.5, 0.77, 6.08),
        (ALUMINIUM, 2.0, 2.15, 20.7),
        (ALUMINIUM, 0.555, 0.8084, 5.905),
        (GOLD, 0.6525, 0.1091, 3.529),
        (GOLD, 0.5636, 0.2452, 2.569),
        (GOLD, 0.4592, 1.457, 1.736),
        (SILVER, 0.6525, 0.04964, 4.432),
        (SILVER, 0.4592, 0.052, 2.765),
    ],
)
def test_metals_are_as_others_find_them(material, wavelength, eta, k):
    got = material(doubles([wavelength]))
    one = doubles([1.0])
    reflected, expected = conductor(one, eta=got[0], k=got[1]), conductor(one, eta=doubles([eta]), k=doubles([k]))
    assert_close(reflected, expected, rtol=0, atol=0.06)
    assert_close(got[1], doubles([k]), rtol=0.15, atol=0)


@pytest.mark.parametrize(
    ("material", "eta"),
    # at the helium d line: catalogue n_d of N-BK7, fused silica, PMMA and periclase
    [(CROWN_GLASS, 1.5168), (FUSED_SILICA, 1.4585), (ACRYLIC, 1.4906), (MAGNESIUM_OXIDE, 1.7375)],
    ids=lambda x: getattr(x, "name", None),
)
def test_dielectrics_at_the_yellow_line(material, eta):
    got, k = material(doubles([0.58756]))
    assert_close(got, doubles([eta]), rtol=0, atol=5e-4)
    assert k == 0


def test_magnesium_oxide_agrees_with_the_fit_of_the_visible():
    squared = torch.linspace(0.41, 0.76, 50).double() ** 2
    visible = (2.957019 + 0.0216485 / (squared - 0.0158650) - 0.0101373 * squared).sqrt()
    assert_close(MAGNESIUM_OXIDE(squared.sqrt())[0], visible, rtol=0, atol=2e-4)


def test_colours_of_metals():
    # red, green, blue: gold and copper reflect red, silver and aluminium are white
    light = doubles([0.65, 0.55, 0.46])
    reflected = {m.name: conductor(torch.ones(3).double(), eta=m(light)[0], k=m(light)[1]) for m in METALS}
    assert reflected["GOLD"][0] > 0.9
    assert reflected["GOLD"][2] < 0.5
    assert reflected["COPPER"][0] > 0.9
    assert reflected["COPPER"][2] < 0.7
    assert reflected["SILVER"].min() > 0.95
    assert 0.88 < reflected["ALUMINIUM"].min() < reflected["ALUMINIUM"].max() < 0.95


@pytest.mark.parametrize("material", METALS + TRANSPARENT, ids=lambda m: m.name)
def test_range_and_dtype(material):
    low, high = (
        (material.wavelengths[0], material.wavelengths[-1]) if material in METALS else (material.low, material.high)
    )
    for dtype in (torch.float32, torch.float64):
        eta, k = material(torch.tensor([low, high], dtype=dtype))
        assert eta.dtype == k.dtype == dtype
        assert ((eta > 0) & (k >= 0)).all()
    with pytest.raises(
        ValueError, match=rf"{material.name}: wavelength must lie in \[{low:g}, {high:g}\] um; 1 of 2 do"
    ):
        material(doubles([low, 550.0]))
    with pytest.raises(ValueError, match="1 of 1 do not"):
        material(doubles([math.nan]))


def test_derivative_in_the_wavelength():
    wavelength = doubles([0.51, 0.6]).requires_grad_()
    for material in (GOLD, CROWN_GLASS):
        assert torch.autograd.gradcheck(lambda w, m=material: m(w)[0], wavelength)


@pytest.mark.skipif(not DATA.exists(), reason="the published tables are not part of the repository")
@pytest.mark.parametrize(("metal", "file"), [(ALUMINIUM, "Al_nk_Rakic.yml"), (COPPER, "Cu_nk_Johnson.yml")])
def test_tables_are_the_published_ones(metal, file):
    rows = [line.split() for line in (DATA / file).read_text().splitlines() if line.startswith("        ")]
    published = {float(w): (float(n), float(k)) for w, n, k in rows}
    for w, n, k in zip(metal.wavelengths, metal.eta, metal.k, strict=True):
        assert published[w] == (n, k)
