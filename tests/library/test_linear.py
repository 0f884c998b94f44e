"""Models that are sums of images of the geometry times coefficients of the material."""

import pytest
import torch
from helpers.planes import UP, f64, unit
from helpers.probes import held

from torchbrdf import Cosines, Lambert, OrenNayar, QualitativeOrenNayar, RoughSurface
from torchbrdf.testing import magnitude, random_directions


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


def test_many_pixels_are_what_each_is_alone():
    """Pieces of 4096 pixels, one sigma or one per pixel."""
    generator = torch.Generator().manual_seed(0)
    directions = [
        torch.nn.functional.normalize(torch.rand(91, 90, 3, generator=generator) + 0.1, dim=-1) for _ in "nlv"
    ]
    sigma = torch.full((91, 90), 0.4)
    sigma[0, 0] = 0.9
    shared = RoughSurface(sigma=0.4, nodes=4, order=2)(*directions)
    own = RoughSurface(sigma=sigma, nodes=4, order=2)(*directions)
    torch.testing.assert_close(own[1:], shared[1:])
    alone = RoughSurface(sigma=0.9, nodes=4, order=2)(*(v[0, 0] for v in directions))
    torch.testing.assert_close(own[0, 0], alone)


def test_a_new_sigma_reads_the_same_images():
    cosines = Cosines.of(UP, unit(1.0, 0.0), unit(0.9, 2.0))
    surface = RoughSurface(albedo=f64(0.3, 0.9)[1], sigma=f64(0.2)[0], nodes=5, order=2, bounces="all")
    images = surface.basis(cosines)
    surface.sigma = 0.7
    torch.testing.assert_close((images[..., None, :] * surface.coefficients()).sum(-1), surface.evaluate(cosines))
