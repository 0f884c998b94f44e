"""Models given by fields: their sum is what the images and coefficients of the same model say, and users' own work."""

import math

import pytest
import torch

from torchbrdf import (
    EON,
    Cosines,
    FieldBRDF,
    FujiiOrenNayar,
    LinearBRDF,
    OrenNayar,
    QualitativeOrenNayar,
)
from torchbrdf import testing as laws

D = torch.float64
ALBEDO = torch.tensor([0.9, 0.4, 0.1], dtype=D)


def number(value):
    return torch.tensor(value, dtype=D)


MODELS = {
    "functional": lambda: OrenNayar(albedo=ALBEDO, sigma=number(0.6)),
    "direct alone": lambda: OrenNayar(albedo=ALBEDO, sigma=number(0.6), interreflection=False),
    "bounced alone": lambda: OrenNayar(albedo=ALBEDO, sigma=number(0.6), direct=False),
    "without c3": lambda: OrenNayar(albedo=ALBEDO, sigma=number(0.6), c3=False),
    "qualitative": lambda: QualitativeOrenNayar(albedo=ALBEDO, sigma=number(0.6)),
    "Fujii": lambda: FujiiOrenNayar(albedo=ALBEDO, roughness=number(0.7)),
    "EON": lambda: EON(albedo=ALBEDO, roughness=number(0.7)),
    "EON, quartic": lambda: EON(albedo=ALBEDO, roughness=number(0.7), exact=False),
}


@pytest.mark.parametrize("name", MODELS)
def test_fields_say_what_images_and_coefficients_say(name):
    model = MODELS[name]()
    cosines = Cosines.of(*laws.random_directions(500, dtype=D, generator=torch.Generator().manual_seed(3)))
    assert isinstance(model, LinearBRDF)
    by_images = (model.basis(cosines)[..., None, :] * model.coefficients()).sum(-1)
    torch.testing.assert_close(model.evaluate(cosines), by_images, rtol=1e-13, atol=1e-15)
    parts = model.evaluate_components(cosines)
    assert parts.keys() == model.component_coefficients().keys()
    for part, coefficients in zip(parts.values(), model.component_coefficients().values(), strict=True):
        by_images = (model.basis(cosines)[..., None, :] * coefficients).sum(-1)
        torch.testing.assert_close(cosines.zero_below_horizon(part), by_images, rtol=1e-13, atol=1e-15)


class Powder(FieldBRDF):
    """A user's own: a flat field and one that grows towards the light, the albedo squared in the second."""

    def __init__(self, albedo, sigma):
        super().__init__()
        self.albedo, self.sigma = albedo, sigma

    def fields(self, cosines):
        flat = torch.full_like(cosines.light, 1 / math.pi)
        return flat, self.sigma * cosines.phase.relu() / math.pi

    def parts_of(self, *fields):
        return {"flat": self.albedo * fields[0], "backward": self.albedo**2 * fields[1]}


def test_own_model_by_fields():
    model = Powder(ALBEDO, number(0.5))
    drawn = torch.randn(3, 200, 3, dtype=D, generator=torch.Generator().manual_seed(4))
    normal, light, view = torch.nn.functional.normalize(drawn, dim=-1)
    lit = ((normal * light).sum(-1) > 0) & ((normal * view).sum(-1) > 0)
    wanted = (ALBEDO + ALBEDO**2 * 0.5 * (light * view).sum(-1, keepdim=True).relu()) / math.pi * lit[:, None]
    assert lit.any()
    assert not lit.all()
    torch.testing.assert_close(model(normal, light, view), wanted, rtol=1e-12, atol=0)
    torch.testing.assert_close(sum(model.components(normal, light, view).values()), wanted, rtol=1e-12, atol=0)


def test_nothing_below_the_horizon_and_no_gradient():
    model = OrenNayar(albedo=ALBEDO, sigma=number(0.6))
    normal = torch.tensor([0.0, 0.0, 1.0], dtype=D)
    light = torch.tensor([0.6, 0.0, -0.8], dtype=D, requires_grad=True)
    f = model(normal, light, torch.tensor([0.0, 0.6, 0.8], dtype=D))
    assert (f == 0).all()
    gradients = torch.autograd.grad(f.sum(), [light, *model.parameters()])
    assert all((g == 0).all() for g in gradients)
