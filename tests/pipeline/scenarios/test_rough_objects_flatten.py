"""Pictures of rough objects flatten, as the paper's do, and their slopes can be read from photographs."""

import pytest
import torch

from inverse import Distant, Scene, Sensor, cuboid, fit, render, sphere
from torchbrdf import Oriented, RoughSurface, TabulatedRoughSurface, UnidirectionalVCavities, fixed, sigma_from_degrees

DOUBLE = torch.float64


def rough(degrees):
    return RoughSurface(albedo=fixed(0.9), sigma=fixed(sigma_from_degrees(degrees)))


def test_spheres_flatten_with_roughness():
    scene = Scene(sphere(64, 64), [Distant.from_angle(0)])
    disc = scene.surface.mask & (scene.surface.normals[..., 2] > 0.25)
    spread = []
    for sigma in (0, 10, 20, 40):
        image = render(scene, rough(sigma))[0, ..., 0]
        spread.append((image[disc].std() / image[disc].mean()).item())
    assert spread == sorted(spread, reverse=True)
    assert spread[-1] < 0.1 < spread[0] / 2  # nearly a uniform disc: the full moon


def test_contrast_between_the_faces_of_a_cube_shrinks():
    for light in (Distant.from_angle(0), Distant.from_angle(20)):
        scene = Scene(cuboid(48, 48, yaw=30), [light])
        contrast = []
        for sigma in (0, 30):
            image = render(scene, rough(sigma))[0, ..., 0]
            faces = [image[scene.surface.mask & (scene.surface.normals[..., 0] * side > 0)] for side in (1, -1)]
            assert all(torch.allclose(face, face[:1], rtol=1e-5) for face in faces)  # flat faces are uniform
            bright, dark = sorted((face.mean().item() for face in faces), reverse=True)
            contrast.append((bright - dark) / (bright + dark))
        assert contrast[1] < contrast[0]


def test_slope_distribution_is_recovered_without_assuming_a_gaussian():
    shares = torch.tensor([0.1, 0.3, 0.4, 0.15, 0.05], dtype=DOUBLE)
    lights = [Distant.from_angle(a) for a in (-60, -30, 0, 30, 60)]
    scene = Scene(sphere(32, 32, dtype=DOUBLE), lights, Sensor(exposure=2.0, read_noise=1e-4))
    rho = fixed(torch.tensor(0.8, dtype=DOUBLE))
    truth = TabulatedRoughSurface(albedo=rho, weights=fixed(shares))
    photographs = scene.sensor.expose(render(scene, truth), torch.Generator().manual_seed(0))
    start = TabulatedRoughSurface(albedo=rho, weights=torch.full((5,), 0.2, dtype=DOUBLE))
    found = fit(scene, photographs, start, valid=photographs[..., 0] > 0.02)
    z = (found.parameters["weights"] - shares) / found.standard_error["weights"]
    assert found.parameters["weights"].sum().item() == pytest.approx(1)
    assert z.abs().max() < 4
    assert found.standard_error["weights"].max() < 0.05


def test_a_grain_is_rendered_and_read_from_photographs():
    direction = torch.tensor([1.0, 0.02, 0.03], dtype=DOUBLE)
    light = Distant.from_angle(40)
    scene = Scene(sphere(16, 16, dtype=DOUBLE), [light])

    def grooved(albedo, slope):
        return Oriented(UnidirectionalVCavities(albedo=albedo, slope=slope), direction)

    image = render(scene, grooved(0.7, 0.6))[0]
    mask, normal = scene.surface.mask, scene.surface.normals[scene.surface.mask]
    grain = direction - (normal @ direction)[:, None] * normal
    brdf = UnidirectionalVCavities(albedo=0.7, slope=0.6)
    toward = light.direction.to(DOUBLE)
    values = brdf(normal, toward, torch.tensor([0.0, 0, 1], dtype=DOUBLE), tangent=grain)
    torch.testing.assert_close(image[mask], values * (normal @ toward)[:, None])
    found = fit(scene, image[None], grooved(0.5, 0.3))
    assert found.parameters["brdf.slope"].item() == pytest.approx(0.6, abs=1e-5)


def test_material_and_surface_of_two_dtypes_meet_in_the_wider():
    """As with any other model: a float32 material on a float64 surface is the float64 one to float32 digits."""
    scene = Scene(sphere(16, 16, dtype=torch.float64), [Distant.from_angle(20)])
    narrow, wide = (
        RoughSurface(albedo=torch.tensor(0.7, dtype=dtype), sigma=torch.tensor(0.6, dtype=dtype))
        for dtype in (torch.float32, torch.float64)
    )
    found = render(scene, narrow)
    assert found.dtype == torch.float64
    torch.testing.assert_close(found, render(scene, wide), rtol=1e-5, atol=1e-7)
