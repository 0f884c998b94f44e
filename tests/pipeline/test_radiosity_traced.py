"""Light between the parts of the vase, against a path tracer that knows nothing but the profile."""

import itertools
import math

import numpy as np
import pytest
import torch

from inverse import Distant, vase
from inverse.scene.surface import vase_profile
from inverse.transport.radiosity import bounced


class Tracer:
    """Paths between white Lambert walls of the vase; crossings by marching and bisection."""

    def __init__(self):
        self.profile, self.rng = vase_profile(), np.random.default_rng(0)
        heights = np.linspace(-0.92, 0.92, 20001)
        self.heights, self.radii = heights, self.profile(heights)

    def inside(self, p):
        radius = np.interp(p[..., 1], self.heights, self.radii, left=0.0, right=0.0)
        return p[..., 0] ** 2 + p[..., 2] ** 2 < radius**2

    def first_hit(self, p, d):
        """Distance to where rays from outside enter; inf where they leave."""
        result, left = np.full(len(p), np.inf), np.arange(len(p))
        tried = np.concatenate((np.arange(0, 0.12, 0.004), np.geomspace(0.12, 2.0, 100)))
        for before, after in itertools.pairwise(tried):
            q = p[left] + after * d[left]
            entered = self.inside(q)
            low, high = np.full(entered.sum(), before), np.full(entered.sum(), after)
            rays = left[entered]
            for _ in range(30):
                mid = (low + high) / 2
                deep = self.inside(p[rays] + mid[:, None] * d[rays])
                low, high = np.where(deep, low, mid), np.where(deep, mid, high)
            result[rays] = high
            left = left[~entered & (np.abs(q[:, 1]) < 0.92) & (np.hypot(q[:, 0], q[:, 2]) < 0.6)]
        return result

    def normal(self, p):
        slope = self.profile(np.clip(p[:, 1], -0.92, 0.92), 1)
        n = np.stack((p[:, 0], -np.hypot(p[:, 0], p[:, 2]) * slope, p[:, 2]), -1)
        return n / np.linalg.norm(n, axis=-1, keepdims=True)

    def bounce(self, n, samples):
        """Directions about unit normals with density cos/pi."""
        share, turn = self.rng.random(samples), 2 * np.pi * self.rng.random(samples)
        other = np.where(np.abs(n[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
        u = np.cross(n, other)
        u /= np.linalg.norm(u, axis=-1, keepdims=True)
        flat = np.sqrt(share)[:, None] * (np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * np.cross(n, u))
        return flat + np.sqrt(1 - share)[:, None] * n

    def irradiance(self, p, n, lights, bounces, samples):
        """Means and standard errors (light, bounce) of E at the ends of paths of 1, 2, ... segments from one point."""
        p, n = np.repeat(p[None], samples, 0), np.repeat(n[None], samples, 0)
        alive, values = np.arange(samples), np.zeros((len(lights), bounces, samples))
        for b in range(bounces):
            d = self.bounce(n, len(p))
            start = p + 1e-5 * n
            t = self.first_hit(start, d)
            met = np.isfinite(t)
            alive, p = alive[met], start[met] + t[met, None] * d[met]
            n = self.normal(p)
            for k, light in enumerate(lights):
                lit = np.isinf(self.first_hit(p + 1e-5 * n, np.repeat(light[None], len(p), 0)))
                values[k, b, alive] = np.clip(n @ light, 0, None) * lit
        return values.mean(-1), values.std(-1) / math.sqrt(samples)


@pytest.mark.parametrize("samples", [20_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_vase_as_traced(samples):
    """One and two bounces of a level and a raised light at lip, neck and foot: 3 standard errors and 2 % allowed."""
    solid = vase(8, 8).solid
    y, turn = np.array([0.88, 0.68, -0.75]), np.array([0.1, -0.8, 1.2])
    r = vase_profile()(y)
    points = torch.from_numpy(np.stack((r * np.sin(turn), y, r * np.cos(turn)), -1))
    normals = solid.normal(points)
    lights = [np.array(k) / np.linalg.norm(k) for k in ((0.3, 0.0, 0.954), (0.2, 0.85, 0.487))]
    got = [bounced(solid, [Distant(torch.from_numpy(light))], points, normals)[:2, :, 0].numpy() for light in lights]
    tracer = Tracer()
    for k in range(len(points)):
        means, errors = tracer.irradiance(points[k].numpy(), normals[k].numpy(), lights, 2, samples)
        assert means[0, 0] > 0.02
        for light in range(2):
            allowed = 3 * errors[light] + 0.02 * means[:, 0].max()
            assert (np.abs(got[light][:, k] - means[light]) < allowed).all()
