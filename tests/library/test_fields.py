"""Models made of fields of geometry and roughness: their parts, their sum, and what a user's own becomes."""

import math

import pytest
import torch
from helpers.probes import doubles, few, held
from torch.testing import assert_close

from torchbrdf import EON, Cosines, FastRoughSurface, FujiiOrenNayar, OrenNayar, QualitativeOrenNayar
from torchbrdf.fields import FieldBRDF

RHO = [0.7, 0.4, 0.1]
MODELS = [
    OrenNayar(albedo=held(RHO), sigma=held(0.6)),
    OrenNayar(albedo=held(RHO), sigma=held(0.6), direct=False),
    QualitativeOrenNayar(albedo=held(RHO), sigma=held(0.6)),
    FujiiOrenNayar(albedo=held(RHO), roughness=held(0.6)),
    EON(albedo=held(RHO), roughness=held(0.6)),
]


@pytest.mark.parametrize("brdf", MODELS, ids=lambda brdf: type(brdf).__name__)
def test_sum_is_the_sum_of_parts_that_are_linear_in_each_field(brdf):
    fields = [field[..., None] for field in brdf.fields(Cosines.of(*few()))]
    assert all(field.shape == (200, 1) for field in fields)
    parts = brdf.parts_of(*fields)
    assert_close(brdf.sum_of(*fields), sum(parts.values()), rtol=1e-13, atol=1e-16)
    for place, field in enumerate(fields):
        scaled = {k: brdf.parts_of(*fields[:place], k * field, *fields[place + 1 :]) for k in (0.0, 3.0)}
        for name, part in parts.items():
            assert_close(scaled[3.0][name] - scaled[0.0][name], 3 * (part - scaled[0.0][name]), rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize("brdf", MODELS, ids=lambda brdf: type(brdf).__name__)
def test_fields_say_what_images_and_coefficients_say(brdf):
    cosines = Cosines.of(*few())
    parts = brdf.evaluate_components(cosines)
    assert parts.keys() == brdf.component_coefficients().keys()
    for part, coefficients in zip(parts.values(), brdf.component_coefficients().values(), strict=True):
        by_images = (brdf.basis(cosines)[..., None, :] * coefficients).sum(-1)
        assert_close(cosines.zero_below_horizon(part), by_images, rtol=1e-13, atol=1e-15)
    by_images = (brdf.basis(cosines)[..., None, :] * brdf.coefficients()).sum(-1)
    assert_close(brdf.evaluate(cosines), by_images, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("bounces", [2, "all"])
def test_later_bounces_are_no_linear_field_but_vanish_below_the_horizon(bounces):
    brdf = FastRoughSurface(albedo=held(RHO), sigma=held(0.6), bounces=bounces)
    fields = [field[..., None] for field in brdf.fields(Cosines.of(*few()))]
    assert_close(brdf.sum_of(*fields), sum(brdf.parts_of(*fields).values()), rtol=1e-13, atol=1e-16)
    assert all((part == 0).all() for part in brdf.parts_of(*(0 * field for field in fields)).values())
    normal, light, view = few()
    assert (brdf(normal, -light, view) == 0).all()


class Sheen(FieldBRDF):
    """(rho + 0.1 |h|^-2)/pi with h = light + view; neither field is 0 below the horizon."""

    def fields(self, cosines):
        return torch.ones_like(cosines.phase), 1 / (2 + 2 * cosines.phase)

    def parts_of(self, flat, far):
        return {"body": doubles(RHO) / math.pi * flat, "sheen": 0.1 / math.pi * far}


def test_own_model_of_two_fields():
    normal, light, view = few()
    by_hand = (doubles(RHO) + 0.1 / (light + view).square().sum(-1, keepdim=True)) / math.pi
    assert_close(Sheen()(normal, light, view), by_hand)
    parts = Sheen().components(normal, light, view)
    assert_close(parts["body"], (doubles(RHO) / math.pi).expand(200, 3))
    assert_close(parts["body"] + parts["sheen"], by_hand)


@pytest.mark.parametrize("sunk", ["light", "view"])
def test_fields_are_dark_and_flat_below_the_horizon(sunk):
    vectors = dict(zip(("normal", "light", "view"), few(), strict=True))
    vectors[sunk] = -vectors[sunk]
    vectors = {name: vector.requires_grad_() for name, vector in vectors.items()}
    f = Sheen()(**vectors)
    assert (f == 0).all()
    slopes = torch.autograd.grad(f.sum(), list(vectors.values()), materialize_grads=True)
    assert all((slope == 0).all() for slope in slopes)
    for part in Sheen().components(**vectors).values():
        assert (part == 0).all()
