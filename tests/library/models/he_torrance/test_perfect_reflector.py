"""The first-surface reflection without its Fresnel factor: facets are what it becomes for short waves."""

import math

import pytest
import torch
from torch.testing import assert_close

from torchbrdf import Beckmann, Dielectric, HeTorrance, fixed


def rough(height, ratio, **more):
    """A surface of height sigma0 [wavelengths] and sigma0/tau."""
    lengths = {"sigma0": height, "tau": height / ratio, "wavelength": 1.0, "eta": 1.5}
    return HeTorrance(**{k: fixed(torch.tensor(v, dtype=torch.float64)) for k, v in lengths.items()}, **more)


@pytest.mark.filterwarnings("ignore:HeTorrance.tau")
@pytest.mark.parametrize(
    ("height", "degrees", "most"),
    [(1.0, 0, 0.0065), (1.0, 60, 0.039), (1.0, 80, 0.35), (3.0, 60, 0.0043), (10.0, 60, 0.00039)],
)
def test_facets_are_the_limit_of_wave_optics(height, degrees, most):
    """Largest error of f cos in the plane of incidence, of its peak, as the docstring says; at 0 degrees it is 1/g."""
    up = torch.tensor([0.0, 0, 1], dtype=torch.float64)
    angle = torch.deg2rad(torch.linspace(-85, 85, 1701, dtype=torch.float64))
    views = torch.stack((angle.sin(), 0 * angle, angle.cos()), -1)
    incidence = -math.radians(degrees)
    light = up.new_tensor([math.sin(incidence), 0, math.cos(incidence)])
    worst = 0.0
    for ratio in (0.05, 0.1, 0.2):
        model = rough(height, ratio, specular=False)
        (option,) = model.stand_ins()["wave optics"]
        whole, facets = (k(up, light, views)[..., 0] * angle.cos() for k in (model, option.model))
        worst = max(worst, float((facets - whole).abs().max() / whole.max()))
    assert most * 0.95 < worst < most
    if degrees == 0:
        assert worst == pytest.approx((4 * math.pi * height) ** -2, rel=0.02)


@pytest.mark.filterwarnings("ignore:HeTorrance.tau")
def test_facets_are_those_of_beckmann():
    """D of width alpha = 2 sigma/tau, Fresnel and Smith's S_1 with its numerator; steep, so that sigma is sigma0."""
    alpha = 0.2
    model = rough(1.0, alpha / 2, specular=False, wave_optics=False)
    up = torch.tensor([0.0, 0, 1], dtype=torch.float64)
    light = torch.nn.functional.normalize(torch.tensor([0.3, 0.1, 1.0], dtype=torch.float64), dim=0)
    view = torch.nn.functional.normalize(torch.tensor([-0.1, 0.2, 1.0], dtype=torch.float64), dim=0)
    twin = Beckmann(alpha=fixed(torch.tensor(alpha, dtype=torch.float64)), fresnel=Dielectric(eta=fixed(model.eta)))
    assert_close(model(up, light, view), twin(up, light, view), rtol=1e-6, atol=0)


def test_facets_return_what_their_quadrature_says():
    """The directional albedo against a plain quadrature over the hemisphere."""
    model = rough(0.5, 0.2, specular=False, wave_optics=False)
    cosine = torch.tensor([0.9, 0.5], dtype=torch.float64)
    assert_close(
        model.directional_albedo(cosine),
        super(HeTorrance, model).directional_albedo(cosine, nodes=200),
        rtol=1e-4,
        atol=0,
    )


def test_a_surface_without_height_has_no_facets():
    smooth = HeTorrance(sigma0=fixed(0.0), tau=1.0, wavelength=fixed(0.5))
    assert "wave optics" not in smooth.stand_ins()
    with pytest.raises(ValueError, match="sigma0 above 0"):
        HeTorrance(sigma0=fixed(0.0), tau=1.0, wavelength=fixed(0.5), wave_optics=False)
