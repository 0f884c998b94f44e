"""Models with a fixed grain."""

import torch
from helpers.probes import doubles, few
from helpers.two_channels import D, number
from torch.testing import assert_close

from torchbrdf import GGX, AnisotropicGGX, AshikhminShirley, Cosines, Dielectric, Mirror, Oriented


def test_oriented_mixture_keeps_its_mirror():
    tangent = doubles([1.0, 0.0, 0.0])
    plain = (0.5 * AshikhminShirley() + 0.4 * Mirror()).double()
    oriented = Oriented(plain, tangent)
    cosines = oriented.cosines(*few(5))
    assert_close(oriented.delta_reflectance(cosines), torch.full((5, 1), 0.4, dtype=torch.float64), rtol=1e-6, atol=0)
    assert (oriented.delta_probability(cosines) > 0).all()
    # cosines that a renderer made without the model know no tangent
    bare = Cosines.of(*few(5))
    assert_close(oriented.evaluate(bare), plain(*few(5), tangent=tangent))


def test_turned_stand_ins_know_their_former_names():
    """Bare where they have no grain, turned where they have."""
    brushed = AnisotropicGGX(alpha_x=number(0.2), alpha_y=number(0.4), fresnel=Dielectric(eta=number(1.5)))
    model = Oriented(brushed, torch.tensor([1.0, 0, 0.3], dtype=D))
    (rounded,) = model.stand_ins()["anisotropy"]
    assert rounded.renamed == {"fresnel.eta": "brdf.fresnel.eta"}
    (flat,) = model.stand_ins()["Fresnel variation"]
    assert isinstance(flat.model, Oriented)
    assert flat.renamed == {}
    pair = 0.3 * brushed + 0.7 * GGX(alpha=number(0.1))
    (dropped,) = Oriented(pair, model.direction).stand_ins()["part 1"]
    assert dropped.renamed == {
        "parts.0.alpha": "brdf.parts.1.alpha",
        "parts.0.fresnel.f0": "brdf.parts.1.fresnel.f0",
        "weights": "brdf.weights",
    }
    (dropped,) = Oriented(pair, model.direction).stand_ins()["part 2"]
    assert dropped.renamed == {}
