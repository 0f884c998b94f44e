"""Independent path tracer of real V-grooves: ray-segment intersections in numpy, none of the library's formulas.

A groove has its valley at the origin and ridges at (+-cos, sin) of the slope angle; x runs across, y along, z up. Paths
start at the viewer, enter the opening at a uniformly distributed point, and at every hit collect the light that reaches
it unblocked.
"""

import numpy as np


def trace(light, view, slope, turn, *, albedo, bounces, rng):
    """Per-path BRDF contributions (path, bounce). light, view (3,); slope, turn (path,): groove angle and azimuth of
    its across-direction. [1/sr]
    """
    light, view = _turned(light, turn), _turned(view, turn)
    half_width, depth = np.cos(slope), np.sin(slope)
    # Stand on the opening z = depth at x and walk down against the view direction until a facet is met.
    start = np.stack((rng.uniform(-1, 1, slope.size) * half_width, depth), axis=-1)
    here, side = _first_hit(start, -view, half_width, depth)
    out = np.zeros((slope.size, bounces))
    throughput = np.ones(slope.size)
    for bounce in range(bounces):
        normal = np.stack((-side * depth, np.zeros_like(depth), half_width), axis=-1)
        cosine = (normal * light).sum(-1)
        free = ~_blocked(here, light, -side, half_width, depth)
        out[:, bounce] = throughput * albedo / np.pi * np.maximum(cosine, 0) * free / light[:, 2]
        throughput = throughput * albedo
        away = _cosine_direction(normal, rng)
        onward = _blocked(here, away, -side, half_width, depth)
        throughput = throughput * onward
        here = np.where(onward[:, None], _meet(here, away, -side, half_width, depth)[1], here)
        side = np.where(onward, -side, side)
    return out


def _turned(vector, turn):
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.stack(
        (cosine * vector[0] + sine * vector[1], -sine * vector[0] + cosine * vector[1], np.full_like(turn, vector[2])),
        axis=-1,
    )


def _meet(point, direction, side, half_width, depth):
    """Parameter along the facet (0 valley, 1 ridge) and meeting point of the ray with the line of facet `side`;
    parameter nan if behind.
    """
    fx, fz = side * half_width, depth
    determinant = direction[:, 0] * fz - direction[:, 2] * fx
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (direction[:, 0] * point[:, 1] - direction[:, 2] * point[:, 0]) / determinant
        time = (fx * point[:, 1] - fz * point[:, 0]) / determinant
    along = np.where(time > 1e-12, along, np.nan)
    return along, np.stack((along * fx, along * fz), axis=-1)


def _blocked(point, direction, side, half_width, depth):
    along, _ = _meet(point, direction, side, half_width, depth)
    return (along > 0) & (along < 1)


def _first_hit(start, direction, half_width, depth):
    hits = []
    for sign in (-1.0, 1.0):
        side = np.full(len(start), sign)
        along, point = _meet(start, direction, side, half_width, depth)
        valid = (along >= 0) & (along <= 1)
        hits.append((np.where(valid, np.hypot(*(point - start).T), np.inf), point))
    nearer = hits[0][0] <= hits[1][0]
    return np.where(nearer[:, None], hits[0][1], hits[1][1]), np.where(nearer, -1.0, 1.0)


def _cosine_direction(normal, rng):
    vector = rng.normal(size=normal.shape)
    vector = vector / np.linalg.norm(vector, axis=-1, keepdims=True) + normal
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)
