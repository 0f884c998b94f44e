"""Light that leaves a Lambertian surface after 1, 2, ... bounces: all lights and views from one set of paths.

With b_i(x) the irradiance of point x by a light of unit irradiance across its rays (cosine where seen, else 0), A the
projected area, and f = rho f_1 + rho^2 f_2 + ...,

    f_{n+1}(i, r) = 1/(pi A cos_i cos_r)  integral b_r(x_0) E[b_i(x_n)] dA,

where x_0, x_1, ... is a path of cosine-distributed steps. So a path that starts at a random point of the surface needs
b at each of its points, toward all directions at once (next-event estimation), and every pair is a product of two
numbers that are already there. The sum over paths is a matrix product, and f_1 is reciprocal by construction.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from surfaces import Array
from terrain import Terrain

BLOCK = 1 << 15  # paths traced at once: 20 MB of irradiances


@dataclass(frozen=True)
class Directions:
    """Polar angles times equal azimuths; the zenith is traced once.

    unit: (D, 3) distinct directions; column: (polar, azimuth) -> its row.
    """

    polar: Array
    unit: Array
    column: NDArray[np.intp]

    @classmethod
    def of(cls, polar: Array, azimuths: int) -> "Directions":
        unit, column = [], np.zeros((len(polar), azimuths), np.intp)
        for i, theta in enumerate(polar):
            for k in range(azimuths):
                if k == 0 or theta > 0:
                    phi = 2 * np.pi * k / azimuths
                    unit.append([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
                column[i, k] = len(unit) - 1
        return cls(polar, np.array(unit), column)


@dataclass(frozen=True)
class Traced:
    """One surface, rho = 1: f[n, d, e] of n + 1 bounces between directions, alb[n, d] the share that then leaves."""

    f: Array
    alb: Array


def irradiances(terrain: Terrain, positions: Array, facets: NDArray[np.intp], directions: Directions) -> Array:
    """b (P, D) [-]"""
    cosines = terrain.normals[facets] @ directions.unit.T
    b = np.zeros(cosines.shape, np.float32)
    for d, direction in enumerate(directions.unit):
        facing = np.flatnonzero(cosines[:, d] > 0)
        hidden = terrain.blocked(positions[facing], facets[facing], direction)
        b[facing, d] = np.where(hidden, 0, cosines[facing, d])
    return b


def cosine_steps(normals: Array, sphere: Array) -> Array:
    """Directions with density cos/pi about the normals (P, 3): the normal plus a point of the unit sphere."""
    steps = normals + sphere
    return steps / np.linalg.norm(steps, axis=1, keepdims=True)


def on_sphere(count: int, rng: np.random.Generator) -> Array:
    """Random points of the unit sphere (count, 3)."""
    z, phi = rng.uniform(-1, 1, count), rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])


def trace(terrain: Terrain, start: Array, directions: Directions, bounces: int, rng: np.random.Generator) -> Traced:
    """Paths from the points under `start` (P, 2), which cover the period evenly.

    A path keeps its random numbers whatever becomes of the others: two meshes of one surface, traced with the same
    start and seed, differ by what the meshes do.
    """
    count = len(directions.unit)
    f, alb = np.zeros((bounces, count, count)), np.zeros((bounces, count))
    for block in np.array_split(start, -(-len(start) // BLOCK)):
        positions, facets = terrain.drop(block)
        b = irradiances(terrain, positions, facets, directions)
        first = b * terrain.area[facets, None].astype(np.float32)
        path = np.arange(len(block))
        for n in range(bounces):
            f[n] += first.T @ b
            sphere = on_sphere(len(block), rng)[path]
            positions, facets = terrain.meet(positions, facets, cosine_steps(terrain.normals[facets], sphere))
            alive = facets >= 0
            alb[n] += first[~alive].sum(0, dtype=float)
            first, path, positions, facets = first[alive], path[alive], positions[alive], facets[alive]
            b = irradiances(terrain, positions, facets, directions)
    cosines = directions.unit[:, 2]
    return Traced(f / (np.pi * len(start) * cosines[:, None] * cosines), alb / (len(start) * cosines))
