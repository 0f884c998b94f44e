"""A heightfield as a triangle mesh that repeats in both directions, and rays that meet it (Embree, by `embreex`).

The mesh is one period and a margin. A ray that leaves it sideways, below the highest peak, enters again one or more
periods away, inside the margin's equivalent: no ray is ever lost to an edge, however grazing.
"""

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray
from surfaces import Array

MARGIN = 32  # cells beyond the period; even, so that diagonals continue. Any value gives the same result
LIFT = 1e-3  # cells by which a ray starts above its facet: 10 to 100 roundings of a float32 position
LOST = 1e-5  # share of rays that may slip through from a start below the surface (rounding in sharp valleys)


class Terrain:
    """Triangles over `n` x `n` cells; the diagonals alternate, so that no direction is preferred.

    Args:
        heights: (n, n), n even, any scale: they are stretched until the facets have the slope wanted.
        length: of the period, in tau; positions lie in [0, length).
        slope: rms slope of the facets per axis. [-]
    """

    def __init__(self, heights: Array, length: float, slope: float):
        n = len(heights)
        if n % 2:
            raise ValueError(f"heights must have an even number of vertices, so that the diagonals repeat; found {n}")
        self.length, self.cell, self._side = length, length / n, n + 2 * MARGIN
        axis = np.arange(-MARGIN, n + MARGIN + 1)
        x, y = np.meshgrid(axis * self.cell, axis * self.cell, indexing="ij")
        self._vertices = np.stack([x, y, heights[np.ix_(axis % n, axis % n)]], axis=-1).reshape(-1, 3)
        self._facets = _facets(self._side)
        inside = self._inside()
        scaled = slope / np.sqrt(np.mean(self._slopes(self._facets[inside]) ** 2))
        self._vertices[:, 2] *= scaled
        self.bottom, self.top = self._vertices[:, 2].min(), self._vertices[:, 2].max()
        gradient = self._slopes(self._facets)
        up = np.concatenate([-gradient, np.ones((len(gradient), 1))], axis=1)
        self.area = np.linalg.norm(up, axis=1)  # of a facet over its projection
        self.normals = up / self.area[:, None]
        self._scene = EmbreeScene(robust=True)
        self._mesh = TriangleMesh(self._scene, self._vertices.astype(np.float32), self._facets.astype(np.int32))

    def _inside(self) -> NDArray[np.intp]:
        """Facets of one period."""
        index = np.arange(len(self._facets)).reshape(self._side, self._side, 2)
        return index[MARGIN:-MARGIN, MARGIN:-MARGIN].ravel()

    def _slopes(self, facets: NDArray[np.intp]) -> Array:
        """dz/dx, dz/dy of facets (..., 2)"""
        a, b, c = np.moveaxis(self._vertices[facets], 1, 0)
        u, v = b - a, c - a
        determinant = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        x = (u[:, 2] * v[:, 1] - v[:, 2] * u[:, 1]) / determinant
        y = (v[:, 2] * u[:, 0] - u[:, 2] * v[:, 0]) / determinant
        return np.stack([x, y], axis=1)

    def drop(self, xy: Array) -> tuple[Array, NDArray[np.intp]]:
        """Points of the surface under (x, y) in [0, length): positions (P, 3) and their facets (P,)."""
        cell = np.floor(xy / self.cell).astype(np.intp) + MARGIN
        u, v = (xy / self.cell - np.floor(xy / self.cell)).T
        rising = cell.sum(1) % 2 == 0
        second = np.where(rising, u + v > 1, v > u)
        facets = 2 * (cell[:, 0] * self._side + cell[:, 1]) + second
        corner = self._vertices[self._facets[facets, 0]]
        normal = self.normals[facets]
        z = corner[:, 2] - ((xy - corner[:, :2]) * normal[:, :2]).sum(1) / normal[:, 2]
        return np.column_stack([xy, z]), facets

    def blocked(self, positions: Array, facets: NDArray[np.intp], direction: Array) -> NDArray[np.bool_]:
        """Whether rays from facets toward one direction meet the surface (P,)."""
        origins = positions + LIFT * self.cell * self.normals[facets]
        ray = direction[None].astype(np.float32)
        hidden = np.zeros(len(origins), bool)
        going = np.arange(len(origins))
        while len(going):
            hit = self._scene.run(origins.astype(np.float32), np.repeat(ray, len(origins), axis=0), query="OCCLUDED")
            hidden[going[hit >= 0]] = True
            going, origins = going[hit < 0], origins[hit < 0]
            origins, inside = self._re_enter(origins, np.broadcast_to(direction, origins.shape))
            going, origins = going[inside], origins[inside]
        return hidden

    def meet(self, positions: Array, facets: NDArray[np.intp], directions: Array) -> tuple[Array, NDArray[np.intp]]:
        """First points met by rays from facets, one direction each: positions (P, 3), facets (P,), -1 for the sky."""
        origins = positions + LIFT * self.cell * self.normals[facets]
        met, points = np.full(len(origins), -1), np.full_like(origins, np.nan)
        going, lost = np.arange(len(origins)), 0
        while len(going):
            rays = directions[going]
            hit = self._scene.run(origins.astype(np.float32), rays.astype(np.float32), output=True)
            some = hit["primID"] >= 0
            facet = hit["primID"][some].astype(np.intp)
            a, b, c = np.moveaxis(self._vertices[self._facets[facet]], 1, 0)
            u, v = (hit[name][some, None].astype(float) for name in ("u", "v"))
            met[going[some]], points[going[some]] = facet, a + u * (b - a) + v * (c - a)
            origins, inside = self._re_enter(origins[~some], rays[~some])
            going = going[~some][inside]
            below = origins[inside][:, 2] < self.bottom - self.cell
            lost += below.sum()
            going, origins = going[~below], origins[inside][~below]
        if lost > 10 + LOST * len(positions):
            raise RuntimeError(f"{lost} of {len(positions)} rays fell through the surface; at most a share {LOST} may")
        return points, met

    def _re_enter(self, origins: Array, directions: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where rays that met nothing on the mesh go on, one period back, and whether they are still below the top."""
        low, high = -MARGIN * self.cell, self.length + MARGIN * self.cell
        along = directions[:, :2]
        with np.errstate(divide="ignore"):
            distance = np.where(along > 0, (high - origins[:, :2]) / along, (low - origins[:, :2]) / along)
        distance = np.where(along == 0, np.inf, distance).min(1, initial=np.inf)
        vertical = np.isinf(distance)
        left = origins + np.where(vertical, 0, distance)[:, None] * directions
        left[:, :2] %= self.length
        inside = ~vertical & (left[:, 2] < self.top)
        return left, inside


def _facets(side: int) -> NDArray[np.intp]:
    """Corners (2 side^2, 3), anticlockwise from above, two facets a cell, the first at the cell's lower x."""
    i, j = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    origin = i * (side + 1) + j
    across, beside, opposite = origin + side + 1, origin + 1, origin + side + 2
    rising = (i + j) % 2 == 0  # cut from (1, 0) to (0, 1); otherwise from (0, 0) to (1, 1)
    first = np.where(rising, [origin, across, beside], [origin, across, opposite])
    second = np.where(rising, [across, opposite, beside], [origin, opposite, beside])
    return np.stack([first, second], axis=-1).transpose(1, 2, 3, 0).reshape(-1, 3)
