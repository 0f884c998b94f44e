"""Photographs of known materials for fits."""

import torch

from inverse import Distant, Scene, Sensor, render, sphere
from torchbrdf import OrenNayar, sigma_from_degrees

D = torch.float64
LIGHTS = [Distant.from_angle(0), Distant.from_angle(20)]


def clay(cls=OrenNayar, albedo=0.7, degrees=40.0, dtype=D):
    return cls(albedo=torch.tensor(albedo, dtype=dtype), sigma=sigma_from_degrees(torch.tensor(degrees, dtype=dtype)))


def photographed(scene, model, seed=0):
    return scene.sensor.expose(render(scene, model), torch.Generator().manual_seed(seed)).detach()


def scene_and_photographs(angles, *, surface=None, noise=0.01, sigma=0.5, albedo=0.7, exposure=3.0, seed=0):
    surface = sphere(48, 48, dtype=D) if surface is None else surface
    scene = Scene(surface, [Distant.from_angle(a) for a in angles], Sensor(exposure=exposure, read_noise=noise))
    truth = OrenNayar(albedo=torch.tensor(albedo, dtype=D), sigma=torch.tensor(sigma, dtype=D))
    return scene, scene.sensor.expose(render(scene, truth), torch.Generator().manual_seed(seed)).detach()


def per_texel(scene, channels=1):
    return torch.full((int(scene.surface.mask.sum()), channels), 0.5, dtype=D)
