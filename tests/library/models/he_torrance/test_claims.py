"""What the paper says of its Figures 7 to 11, where it holds and where it does not."""

import math

import pytest
import torch

from torchbrdf import HeTorrance, fixed, specular_reflectivity

F64 = torch.float64
UP = torch.tensor([0.0, 0.0, 1.0], dtype=F64)
VIEWS = torch.linspace(0, 89.9, 8991, dtype=F64)
ALUMINIUM = {2.0: 2.15 + 20.7j, 0.5: 0.77 + 6.08j}  # index by wavelength [um]


def surface(sigma0, tau, wavelength, index, a=0.0):
    """With the specular part averaged over cones of pi/1024 sr, as the figures have it."""
    names = ("sigma0", "tau", "wavelength", "eta", "k", "diffuse")
    values = (sigma0, tau, wavelength, complex(index).real, complex(index).imag, a)
    held = {name: fixed(torch.tensor(value, dtype=F64)) for name, value in zip(names, values, strict=True)}
    return HeTorrance(**held, solid_angle=math.pi / 1024)


def aluminium(wavelength):
    return surface(0.28, 1.77, wavelength, ALUMINIUM[wavelength])


def forward(model, theta_i, theta_r):
    """Parts of f_r (view,) for views (view,) [degree] on the far side of the normal."""
    angles = (
        -torch.deg2rad(torch.tensor(theta_i, dtype=F64)),
        torch.deg2rad(torch.atleast_1d(torch.as_tensor(theta_r, dtype=F64))),
    )
    light, view = (torch.stack((t.sin(), torch.zeros_like(t), t.cos()), -1) for t in angles)
    return {name: part[:, 0] for name, part in model.components(UP, light, view).items()}


def total(model, theta_i, theta_r):
    return sum(forward(model, theta_i, theta_r).values())


def specular_over_the_rest(model, theta):
    parts = forward(model, theta, theta)
    return (parts["specular"] / (parts["directional_diffuse"] + parts["uniform_diffuse"])).item()


def mirrored(wavelength, theta):
    index = ALUMINIUM[wavelength]
    values = {"sigma0": 0.28, "tau": 1.77, "wavelength": wavelength, "eta": index.real, "k": index.imag}
    cos = torch.tensor(math.cos(math.radians(theta)), dtype=F64)
    return specular_reflectivity(cos, **{name: torch.tensor(x, dtype=F64) for name, x in values.items()}).item()


@pytest.mark.parametrize(("theta", "rho", "ratio"), [(10, 0.049, 16), (45, 0.208, 77), (75, 0.569, 2600)])
def test_aluminium_at_long_wavelengths_is_specular(theta, rho, ratio):
    assert mirrored(2.0, theta) == pytest.approx(rho, abs=6e-4)
    assert specular_over_the_rest(aluminium(2.0), theta) == pytest.approx(ratio, rel=0.03)


@pytest.mark.parametrize(
    ("theta", "peak", "rise"), [(10, 13.2, 1.005), (30, 41.9, 1.06), (45, 67.4, 1.25), (60, 80.9, 1.57)]
)
def test_maximum_beyond_the_specular_angle(theta, peak, rise):
    curve = total(aluminium(0.5), theta, VIEWS)
    assert VIEWS[curve.argmax()].item() == pytest.approx(peak, abs=0.1)
    assert (curve.max() / total(aluminium(0.5), theta, theta)).item() == pytest.approx(rise, abs=6e-3)


def test_specular_peak_of_aluminium_emerges_at_75_degrees():
    model = aluminium(0.5)
    assert specular_over_the_rest(model, 60) < 0.1
    assert specular_over_the_rest(model, 75) == pytest.approx(3.9, abs=0.06)
    assert VIEWS[total(model, 75, VIEWS).argmax()].item() == pytest.approx(75, abs=0.02)
    assert mirrored(0.5, 75) == pytest.approx(0.032, abs=6e-4)


@pytest.mark.parametrize("theta", [10, 45, 75])
def test_specular_part_grows_with_wavelength(theta):
    assert mirrored(2.0, theta) > 10 * mirrored(0.5, theta)


def test_magnesium_oxide_is_directional_diffuse_and_not_specular():
    with pytest.warns(UserWarning, match="exceeds the energy bound 0.78"):
        model = surface(1.45, 13.2, 0.5, 1.74, a=0.9)
    near_normal = total(model, 10, torch.linspace(-85, 85, 341, dtype=F64))
    assert 0.68 < near_normal.min() / near_normal.max() < 0.72
    curve = total(model, 75, VIEWS)
    assert VIEWS[curve.argmax()].item() == pytest.approx(87.4, abs=0.1)
    assert (curve.max() / total(model, 75, 75)).item() == pytest.approx(4.1, abs=0.05)
    assert specular_over_the_rest(model, 75) < 1e-30  # the paper speaks of a specular peak


def test_sandpaper_is_brightest_at_grazing():
    model = surface(44.0, 10.0, 0.55, 1.5)
    curve = total(model, 0, [0.0, 30, 60, 75, 85, 89])
    expected = torch.tensor([1, 0.41, 0.45, 0.77, 1.85, 4.2], dtype=F64)
    torch.testing.assert_close(curve / curve[0], expected, rtol=0.012, atol=0)


@pytest.mark.parametrize("tau", [0.5, 5.0, 50.0])
def test_sandpaper_depends_on_the_slope_alone(tau):
    scaled, reference = (total(surface(4.4 * t, t, 0.55, 1.5), 0, 89.0) for t in (tau, 10.0))
    assert (scaled / reference).item() == pytest.approx(1, abs=7e-3)


def test_plastic_is_a_specular_part_over_a_flat_base():
    model = surface(0.0, 1.0, 0.46, 1.5, a=0.15)
    for theta, peak in ((15, 13.6), (30, 15.7), (45, 23.2), (60, 58.2)):
        parts = forward(model, theta, theta)
        assert total(model, theta, theta).item() == pytest.approx(peak, abs=0.06)
        assert parts["directional_diffuse"].item() == 0
        off = total(model, theta, [theta - 20.0, theta + 20.0])
        torch.testing.assert_close(off, torch.full_like(off, 0.15 / math.pi), rtol=1e-14, atol=0)


def test_plastic_reflects_what_was_measured():
    # a = 0.15 and 0.195 in all go together with a/pi, and with an index of 1.538
    model = surface(0.0, 1.0, 0.46, 1.538, a=0.15)
    assert model.directional_albedo(torch.ones((), dtype=F64)).item() == pytest.approx(0.195, abs=2e-4)
