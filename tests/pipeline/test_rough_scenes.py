"""Pictures of rough objects flatten, as the paper's spheres and three-object scene do."""

import torch

from inverse import Distant, Scene, cuboid, render, sphere
from torchbrdf import RoughSurface, fixed, sigma_from_degrees


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
