"""What models of a table share: they are linear, per texel as in a loop, and contracted as not."""

import torch
from helpers.coarse_tables import COARSE_ROUGH
from torch.testing import assert_close

from torchbrdf import Cosines, InterpolatedRoughSurface, fixed
from torchbrdf.testing import random_directions

F64 = torch.float64
COSINES = Cosines.of(*random_directions(40, dtype=F64, generator=torch.Generator().manual_seed(4)))


def surface(albedo, sigma):
    return InterpolatedRoughSurface(albedo=albedo, sigma=sigma, grid=COARSE_ROUGH)


def test_images_times_coefficients():
    brdf = surface(torch.tensor([0.3, 0.8], dtype=F64), torch.tensor(0.5, dtype=F64))
    basis = brdf.basis(COSINES)
    assert basis.shape == (40, 1 + COARSE_ROUGH.images)
    assert (basis[:, 0] == 1).all()
    assert_close(basis @ brdf.coefficients().mT, brdf.evaluate(COSINES))
    assert_close(torch.stack(brdf.terms(COSINES), -1), basis)


def test_contracted_first_or_not():
    brdf = surface(torch.tensor([0.3, 0.8], dtype=F64), torch.tensor(0.5, dtype=F64))
    with torch.no_grad():
        assert_close(brdf.evaluate(COSINES), brdf.evaluate(COSINES))
        contracted = brdf.evaluate(COSINES)
    assert_close(brdf.evaluate(COSINES).detach(), contracted, rtol=1e-12, atol=1e-12)


def test_per_texel_is_a_loop():
    generator = torch.Generator().manual_seed(5)
    albedo, sigma = (0.1 + 0.8 * torch.rand(shape, dtype=F64, generator=generator) for shape in ((40, 3), (40,)))
    together = surface(albedo, sigma).evaluate(COSINES)
    for k in range(0, 40, 7):
        alone = surface(albedo[k], sigma[k]).evaluate(COSINES)[k]
        assert_close(together[k], alone.detach(), rtol=1e-12, atol=1e-12, check_stride=False)


def test_a_texture_of_albedo_alone():
    albedo = torch.linspace(0.1, 0.9, 80, dtype=F64).reshape(40, 2)
    brdf = surface(albedo, fixed(torch.tensor(0.5, dtype=F64)))
    alone = surface(albedo[9], torch.tensor(0.5, dtype=F64))
    assert_close(brdf.evaluate(COSINES)[9], alone.evaluate(COSINES)[9], rtol=1e-12, atol=1e-12)
