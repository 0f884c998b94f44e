"""rms height and correlation length from scans in the plane of incidence: when they are known, and when their ratio is.

The noise is a share of each value, so the knee lies below the values that count: far above it logarithms are compared.
"""

import math
from typing import final

import pytest
import torch

from inverse import FitResult, Measurements, fit_measurements
from torchbrdf import ALUMINIUM, BRDF, Constrained, Cosines, HeTorrance, Interval, fixed

F64 = torch.float64
NOISE = 0.01
KNEE = 1e-3  # [1/sr]


def aluminium(sigma0: float, tau: float, wavelengths: tuple[float, ...], **details) -> HeTorrance:
    """Lengths in um; the wavelengths set the scale and are held."""
    wavelength = torch.tensor(wavelengths, dtype=F64)
    eta, k = (fixed(x) for x in ALUMINIUM(wavelength))
    lengths = {"sigma0": torch.tensor(sigma0, dtype=F64), "tau": torch.tensor(tau, dtype=F64)}
    return HeTorrance(**lengths, wavelength=fixed(wavelength), eta=eta, k=k, **details)


def scans(model: HeTorrance, *, seed: int = 0) -> Measurements:
    """Light from 10, 30, 45 and 60 degrees, viewed every 2.7 degrees from -80 to 80."""
    light, view = torch.deg2rad(
        torch.cartesian_prod(
            torch.tensor([-10.0, -30.0, -45.0, -60.0], dtype=F64), torch.linspace(-80, 80, 61, dtype=F64)
        )
    ).unbind(-1)
    vectors = [torch.stack((theta.sin(), torch.zeros_like(theta), theta.cos()), -1) for theta in (light, view)]
    with torch.no_grad():
        values = model(torch.tensor([0.0, 0.0, 1.0], dtype=F64), *vectors)
    values = values * (1 + NOISE * torch.randn(values.shape, dtype=F64, generator=torch.Generator().manual_seed(seed)))
    return Measurements(*vectors, values, 1000 * model.wavelength)


def fitted(truth: tuple[float, float], start: tuple[float, float], wavelengths: tuple[float, ...], seed=0) -> FitResult:
    measured = scans(aluminium(*truth, wavelengths), seed=seed)
    return fit_measurements(measured, aluminium(*start, wavelengths), knee=KNEE)


@pytest.mark.parametrize("start", [(0.1, 3.0), (0.5, 3.0), (1.0, 1.0)])
def test_two_wavelengths_tell_height_and_length(start):
    found = fitted((0.28, 1.77), start, (0.5, 2.0))
    assert found.status == "converged"
    for name, truth in (("sigma0", 0.28), ("tau", 1.77)):
        error = found.standard_error[name].item()
        assert abs(found.parameters[name].item() - truth) < 4 * error
        assert error < 2e-3 * truth


@pytest.mark.parametrize(("truth", "wavelengths"), [((20.0, 126.0), (0.5, 2.0)), ((4.0, 25.2), (0.5,))])
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_rough_in_every_wavelength_tells_the_ratio_alone(truth, wavelengths, seed):
    # g of 1000 and more: what depends on the height itself is a share 1/g of the lobe
    found = fitted(truth, (1.0, 5.0), wavelengths, seed)
    assert found.status == "not identified"
    assert "ratio of sigma0 and tau, and hardly either" in found.reason
    ratio = found.parameters["sigma0"] / found.parameters["tau"]
    assert ratio.item() == pytest.approx(truth[0] / truth[1], rel=2e-3)


def test_a_longer_wavelength_tells_them_apart():
    found = fitted((4.0, 25.2), (1.0, 5.0), (0.5, 2.0))
    assert found.status == "converged"
    assert abs(found.parameters["sigma0"].item() - 4) < 4 * found.standard_error["sigma0"].item()


def test_specular_part_alone_pulls_no_start_that_is_too_rough():
    # e^-g underflows, and with it the gradient: the fit says so instead of calling the start an answer
    parts = {"solid_angle": 0.01, "directional_diffuse": False}
    measured = scans(aluminium(0.05, 1.77, (0.5, 2.0), **parts))
    found = fit_measurements(measured, aluminium(40.0, 200.0, (0.5, 2.0), **parts))
    assert found.status == "not identified"
    near = fit_measurements(measured, aluminium(0.1, 2.0, (0.5, 2.0), **parts))
    assert near.parameters["sigma0"].item() == pytest.approx(0.05, rel=0.05)


def test_lengths_have_no_scale_of_their_own():
    free = aluminium(0.28, 1.77, (0.5, 2.0))
    free.wavelength = torch.tensor([0.5, 2.0], dtype=F64)
    found = fit_measurements(scans(aluminium(0.28, 1.77, (0.5, 2.0))), free, knee=KNEE)
    assert found.status == "not identified"
    assert found.reason == "the data cannot tell sigma0 from tau"  # nor from the wavelengths, which weigh less


@final
class Factors(BRDF):
    """Known by the product of two positive numbers alone."""

    a: Constrained = Constrained(Interval(0.0, math.inf))
    b: Constrained = Constrained(Interval(0.0, math.inf))

    def __init__(self):
        super().__init__()
        self.a, self.b = torch.tensor(0.5, dtype=F64), torch.tensor(2.0, dtype=F64)

    def evaluate_components(self, cosines: Cosines) -> dict[str, torch.Tensor]:
        return {"all": (self.a * self.b * cosines.light / math.pi)[..., None]}


def test_a_product_is_called_one():
    found = fit_measurements(scans(aluminium(0.28, 1.77, (0.5,))), Factors())
    assert found.status == "not identified"
    assert found.reason == "the data tell the product of a and b, and hardly either"
