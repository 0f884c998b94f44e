"""Points of an image and their shares of the pixels; shadows and light between parts, rendered and fitted."""

import math
from dataclasses import replace

import pytest
import torch

from inverse import (
    Ambient,
    Disc,
    Distant,
    Point,
    Scene,
    Sensor,
    everything,
    fit,
    from_depth,
    render,
    sphere,
    vase,
)  # fmt: skip
from inverse.fitting.prediction import predictor
from inverse.scene.footprints import Footprints
from inverse.transport.radiosity import bounced, sky_share
from inverse.transport.shadows import unshadowed
from torchbrdf import EON, Coupled, Lambert, OrenNayar

D = torch.float64
RAISED = Distant(torch.tensor([0.3, 1.6, 0.6], dtype=D))


def number(value):
    return torch.tensor(value, dtype=D)


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_shares_of_a_pixel_are_its_coverage(samples):
    surface = vase(20, 16, samples=samples, dtype=D)
    for detail in (None, torch.zeros(20, 16, dtype=torch.bool), torch.rand(20, 16) < 0.5):
        where = Footprints.of(surface, detail)
        found = where.to_image(torch.ones(len(where.points), 1, dtype=D))[..., 0]
        torch.testing.assert_close(found, surface.coverage())
        torch.testing.assert_close(where.normals.norm(dim=-1), torch.ones(len(where.points), dtype=D))


def test_one_point_a_pixel_errs_with_the_square_of_the_pixel():
    model, light = OrenNayar(albedo=number(0.7), sigma=number(0.5)), Distant.from_angle(20)
    errors = []
    for size in (32, 64, 128):
        surface = sphere(size, size, samples=2, dtype=D)
        scene = Scene(surface, [light])
        merged = replace(scene, fully_sampled=torch.zeros(size, size, dtype=torch.bool))
        inner = surface.normals[..., 2].unflatten(0, (size, 2)).unflatten(2, (size, 2)).amin((1, 3)) > 0.6
        difference = (render(scene, model) - render(merged, model))[0, ..., 0].abs()
        # in the mean: on the few pixels that a kink of the model crosses the error falls more slowly
        errors.append(difference[inner & (surface.coverage() == 1)].mean().item())
        assert len(merged.footprints().points) < 0.4 * len(scene.footprints().points)
    assert errors[0] / errors[1] > 3
    assert errors[1] / errors[2] > 3


def test_a_shadow_takes_the_light_and_nothing_else():
    """Pixel by pixel: the image without shadows where the ray to the light is free, 0 where it is not."""
    surface = vase(48, 40, dtype=D)
    model = Lambert(albedo=number(0.6))
    lit, plain = (render(Scene(surface, [RAISED], shadows=k), model)[0, ..., 0] for k in (True, False))
    assert surface.solid is not None
    points, normals = surface.points[surface.mask], surface.normals[surface.mask]
    clear = unshadowed(surface.solid, points, normals, RAISED.direction)
    assert 20 < int((~clear).sum()) < len(clear) / 2
    assert torch.equal(lit[surface.mask], plain[surface.mask] * clear)


def test_light_between_parts_adds_its_bounces():
    """Lambert: rho/pi (E + rho T_1 + rho^2 T_2 + ...), with ambient light dimmed by what the solid hides."""
    surface = vase(32, 28, dtype=D)
    lights = (RAISED, Ambient(number([0.1, 0.3])))
    model = Lambert(albedo=number([0.9, 0.5]))
    found = render(Scene(surface, [lights], between_parts=True), model)[0][surface.mask]
    solid, points, normals = surface.solid, surface.points[surface.mask], surface.normals[surface.mask]
    assert solid is not None
    cosine = (normals @ RAISED.direction).clamp(min=0) * unshadowed(solid, points, normals, RAISED.direction)
    sky = sky_share(solid, points, normals)
    received = cosine[:, None] + math.pi * sky[:, None] * number([0.1, 0.3])
    rho = model.albedo
    for order, image in enumerate(bounced(solid, lights, points, normals), start=1):
        received = received + rho**order * image
    torch.testing.assert_close(found, rho / math.pi * received, rtol=1e-5, atol=1e-12)
    dark = render(Scene(surface, [lights]), model)[0][surface.mask]
    assert ((found - dark).abs().amax(-1) > 1e-3).any()


MODELS = {
    "linear": lambda: OrenNayar(albedo=number([0.7, 0.4]), sigma=number(0.5)),
    "general": lambda: EON(albedo=number(0.7), roughness=number(0.5)),
    "with a mirror lobe": lambda: Coupled(albedo=number(0.6)),
}


@pytest.mark.parametrize(("samples", "psf"), [(2, 0.8), (3, 0.0), (1, 0.0)])
@pytest.mark.parametrize("name", MODELS)
def test_a_fit_predicts_what_is_rendered(name, samples, psf):
    """With everything on: shadows, parts, a disc, a lamp, ambient light, merged pixels, focus."""
    model = MODELS[name]()
    surface = vase(24, 24, samples=2, dtype=D)
    lights = [
        [RAISED, Ambient(0.05)],
        [Disc(torch.tensor([0.5, 0.5, 1.0]), 0.1), Point(torch.tensor([1.0, 2, 3]), 4.0)],
    ]
    sensor = Sensor(exposure=1.7, psf_sigma=psf)
    scene = Scene(surface, lights, sensor, between_parts=True, fully_sampled=torch.rand(24, 24) < 0.5)
    pixels = surface.coverage() == 1
    predicted = predictor(scene, model, pixels, per_texel=False)(dict(model.named_parameters()))
    recorded = sensor.focus(render(scene, model)) * sensor.exposure
    torch.testing.assert_close(predicted, recorded[:, pixels].expand_as(predicted), rtol=1e-9, atol=1e-12)


def test_what_parts_send_each_other_is_not_taken_for_paint():
    """Photographs of a white vase with everything on: fitted as such they give its albedo, without they do not."""
    scene = Scene(vase(40, 40, dtype=D), [Distant.from_angle(0), RAISED])
    truth = OrenNayar(albedo=number(0.9), sigma=number(0.4))
    photographs = 0.8 * render(everything(scene), truth).detach()
    right = fit(replace(everything(scene), sensor=Sensor(exposure=0.8)), photographs, OrenNayar())
    wrong = fit(replace(scene, sensor=Sensor(exposure=0.8)), photographs, OrenNayar())
    assert right.parameters["albedo"].item() == pytest.approx(0.9, rel=1e-6)
    assert right.parameters["sigma"].item() == pytest.approx(0.4, rel=1e-5)
    assert abs(wrong.parameters["sigma"].item() - 0.4) > 0.01


def test_per_texel_materials_exchange_no_light():
    surface = vase(16, 16, dtype=D)
    model = Lambert(albedo=torch.full((int(surface.mask.sum()), 1), 0.5, dtype=D))
    with pytest.raises(ValueError, match="light between parts needs one material"):
        render(Scene(surface, [RAISED], between_parts=True), model)


def test_a_relief_shadows_itself():
    """A dome of known height over a plane, from a depth map: a low light leaves a shadow behind it."""
    x = torch.arange(81, dtype=D) - 40
    height = (400 - x[:, None] ** 2 - x**2).clamp(min=0).sqrt()
    surface = from_depth(100 - height)
    light = Distant(torch.tensor([1.0, 0.0, 0.4], dtype=D))
    lit, plain = (render(Scene(surface, [light], shadows=k), Lambert())[0, ..., 0] for k in (True, False))
    assert lit[40, 8] == 0 < plain[40, 8]  # on the far side, within the shadow's 50 pixels
    assert lit[8, 40] == plain[8, 40] > 0
