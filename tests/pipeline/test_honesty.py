"""The fit does not claim what the photographs do not say, and refuses what would broadcast into nonsense."""

import math

import pytest
import torch
from torch import nn

from inverse import Ambient, Distant, Scene, Sensor, bootstrap, fit, plane, render, sphere
from torchbrdf import BRDF, Lambert, OrenNayar, QualitativeOrenNayar, fixed

DOUBLE = torch.float64


def photographed(angles, *, surface=None, noise=0.01, sigma=0.5, albedo=0.7, exposure=3.0, seed=0):
    surface = sphere(48, 48, dtype=DOUBLE) if surface is None else surface
    scene = Scene(surface, [Distant.from_angle(a) for a in angles], Sensor(exposure=exposure, read_noise=noise))
    truth = OrenNayar(albedo=torch.tensor(albedo, dtype=DOUBLE), sigma=torch.tensor(sigma, dtype=DOUBLE))
    return scene, scene.sensor.expose(render(scene, truth), torch.Generator().manual_seed(seed)).detach()


def per_texel(scene, channels=1):
    return torch.full((int(scene.surface.mask.sum()), channels), 0.5, dtype=DOUBLE)


def test_an_unlit_object_says_nothing():
    scene, photographs = photographed([180])
    found = fit(scene, photographs, OrenNayar())
    assert found.status == "not identified"
    assert "changes nothing" in found.reason
    assert not any(error.isfinite().any() for error in found.standard_error.values())


def test_an_image_left_out_says_nothing_of_its_exposure():
    scene, photographs = photographed([0, 20, -30])
    valid = scene.surface.mask.repeat(3, 1, 1)
    valid[2] = False
    found = fit(scene, photographs, OrenNayar(), valid=valid, free_exposure=True)
    assert found.status == "not identified"
    assert "exposure[2]" in found.reason
    assert found.standard_error["exposure"].isfinite().tolist() == [True, False]


def test_every_random_start_ends_at_the_optimum_or_says_it_did_not():
    surface = sphere(24, 24, dtype=DOUBLE)
    scene, photographs = photographed([0, 20], surface=surface, sigma=0.7)
    best = fit(scene, photographs, OrenNayar()).residual_rms
    generator = torch.Generator().manual_seed(0)
    for _ in range(30):
        albedo, share = torch.rand(2, generator=generator, dtype=DOUBLE) * 0.98 + 0.01
        found = fit(scene, photographs, OrenNayar(albedo=albedo, sigma=share * math.pi / 2))
        assert found.residual_rms == pytest.approx(best, rel=1e-6)
        assert found.status == "converged"


@pytest.mark.parametrize("exposure", [60.0, 300.0])
def test_a_start_far_too_bright_does_not_stop_early(exposure):
    surface = sphere(96, 96)
    scene, photographs = photographed([0, 20], surface=surface, noise=1e-3, albedo=2.1 / exposure, exposure=exposure)
    found = fit(scene, photographs.float(), OrenNayar(), valid=photographs[..., 0] > 0.02)
    assert abs(found.parameters["sigma"].item() - 0.5) < 4 * found.standard_error["sigma"].item()


def test_texels_that_explain_everything_leave_nothing_for_sigma():
    scene, photographs = photographed([20, 20, 20])  # one light three times
    found = fit(scene, photographs, OrenNayar(albedo=per_texel(scene)))
    assert found.status == "not identified"
    assert "sigma from the albedo of each texel" in found.reason


def test_sigma_and_albedo_of_each_texel_need_several_lights():
    scene, photographs = photographed([0, 40])
    start = OrenNayar(albedo=per_texel(scene), sigma=per_texel(scene)[:, 0])
    found = fit(Scene(scene.surface, scene.lights[:1], scene.sensor), photographs[:1], start)
    assert not found.standard_error["sigma"].isfinite().any()
    assert "1468 of 1468 texels not identified" in found.reason


def test_texels_on_a_bound_are_counted():
    scene, photographs = photographed([0, 30, -30], noise=0.0, exposure=2.0)
    photographs[:, 20:22, 20:22] *= 1.6  # brighter than albedo 1 allows: 0.7 times 1.6
    found = fit(scene, photographs, QualitativeOrenNayar(albedo=per_texel(scene)))
    assert "4 of 1468 texels on a bound" in found.reason


def test_bootstrap_refuses_to_average_what_no_refit_determined():
    surface = plane(12, 12, dtype=DOUBLE)
    scene, photographs = photographed([0, 0, 0], surface=surface, exposure=2.0)
    with pytest.raises(ValueError, match="only 0 of 4 bootstrap refits"):
        bootstrap(scene, photographs, OrenNayar(), samples=4)


def test_per_texel_albedo_under_ambient_light():
    surface = sphere(16, 16, dtype=DOUBLE)
    points = int(surface.mask.sum())
    albedo = torch.linspace(0.2, 0.9, points, dtype=DOUBLE)[:, None]
    image = render(Scene(surface, [Ambient(2.0)]), Lambert(albedo=albedo))[0]
    torch.testing.assert_close(image[surface.mask], 2 * albedo, rtol=1e-12, atol=0)


def test_result_carries_no_graph():
    scene, photographs = photographed([0, 20])
    found = fit(scene, photographs.requires_grad_(), OrenNayar())
    tensors = [*found.parameters.values(), *found.standard_error.values(), found.correlation]
    assert not any(t.requires_grad for t in tensors)


class Tinted(BRDF):
    def __init__(self):
        super().__init__()
        self.k = nn.Parameter(torch.tensor(0.5))
        self.inner = Lambert()

    def evaluate_components(self, cosines):
        return {"all": self.k * self.inner.evaluate(cosines)}


def test_shapes_that_would_broadcast_into_nonsense_are_named():
    scene, photographs = photographed([0, 20])
    points = int(scene.surface.mask.sum())
    cases = [
        (OrenNayar(albedo=torch.full((3,), 0.5)), "1 channels, and model and lights 3"),
        (OrenNayar(albedo=torch.full((points,), 0.5)), "1 channels, and model and lights 1468"),
        (OrenNayar(albedo=torch.full((points + 1, 1), 0.5)), r"albedo must be per texel \(1468, channel\)"),
        (OrenNayar(albedo=torch.full((48, 48, 1), 0.5)), r"found shape \(48, 48, 1\)"),
        (OrenNayar(sigma=torch.full((points, 1), 0.5)), r"sigma must be per texel \(1468,\)"),
        (Tinted(), "outside its table: k"),
    ]
    for model, message in cases:
        with pytest.raises(ValueError, match=message):
            fit(scene, photographs, model)
    with pytest.raises(ValueError, match="per-texel sigma"):
        render(scene, OrenNayar(sigma=torch.full((points, 1), 0.5)))
    coloured = Scene(scene.surface, [Distant(torch.tensor([0.0, 0.0, 1.0]), torch.tensor([1.0, 0.5, 0.2]))] * 2)
    with pytest.raises(ValueError, match="model and lights 3"):
        fit(coloured, photographs, Lambert())


def test_a_computed_parameter_is_refused():
    w = torch.zeros(3, requires_grad=True)
    with pytest.raises(ValueError, match="its gradient would be lost"):
        OrenNayar(albedo=torch.sigmoid(w))


def test_wrong_types_are_named():
    scene, photographs = photographed([0, 20])
    with pytest.raises(TypeError, match=r"floating-point torch\.Tensor with full scale 1; found ndarray"):
        fit(scene, photographs.numpy(), OrenNayar())  # pyright: ignore
    with pytest.raises(TypeError, match=r"found torch\.uint8"):
        fit(scene, (photographs * 255).to(torch.uint8), OrenNayar())
    with pytest.raises(TypeError, match="model must be a BRDF"):
        fit(scene, photographs, OrenNayar)  # pyright: ignore
    with pytest.raises(TypeError, match="found a single light"):
        Scene(scene.surface, Distant.from_angle(0))  # pyright: ignore
    with pytest.raises(ValueError, match="finite and not negative"):
        Distant.from_angle(0, math.inf)
    with pytest.raises(ValueError, match="positive and finite"):
        Sensor(exposure=math.inf)
    assert Distant(torch.tensor([0, 0, 2])).direction.tolist() == [0, 0, 1]
    weight_held = 0.5 * OrenNayar(albedo=0.9)
    weight_held.weights = fixed(torch.tensor([0.5]))
    assert "weights" not in fit(scene, photographs, weight_held).parameters
