"""A plan of tracing, carried out: surfaces drawn, meshed at each fineness, traced, averaged.

Deterministic per seed: surface m has generators of its own, whatever the number of processes. Each is kept in a file,
so that a long run goes on where it was stopped.
"""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from samples import Sample, by_azimuth, without_mesh
from surfaces import Array, Spectrum, Waves
from terrain import Terrain
from tracing import Directions, trace

POLAR = np.radians([0, 10, 20, 30, 40, 50, 60, 67.5, 75, 80])
AZIMUTHS = 16


@dataclass(frozen=True)
class Plan:
    """Surfaces, meshes and paths.

    Args:
        surfaces: independent realisations.
        length: of the period, in tau.
        cells: of the meshes per tau, from coarse to fine; each surface is traced on all of them.
        paths: per tau and axis, spread evenly.
        bounces: at which paths end.
    """

    surfaces: int
    length: int
    cells: tuple[int, ...]
    paths: int
    bounces: int
    seed: int = 1


def surface(number: int, plan: Plan, spectrum: Spectrum, slope: float) -> tuple[Array, Array]:
    """f (mesh, n, i, r, k) and alb (mesh, n, i) of one surface, the same points and steps on each mesh."""
    drawing, starting = (np.random.default_rng((plan.seed, number, part)) for part in range(2))
    waves = Waves.draw(spectrum, plan.length, drawing)
    count = plan.paths * plan.length
    corners = np.stack(np.meshgrid(np.arange(count), np.arange(count), indexing="ij"), axis=-1).reshape(-1, 2)
    start = (corners + starting.uniform(size=corners.shape)) / plan.paths
    directions = Directions.of(POLAR, AZIMUTHS)
    results = []
    for cells in plan.cells:
        terrain = Terrain(waves.heights(cells), plan.length, slope)
        steps = np.random.default_rng((plan.seed, number, 2))
        results.append(by_azimuth(trace(terrain, start, directions, plan.bounces, steps), directions))
    f, alb = (np.stack(values) for values in zip(*results, strict=True))
    return f, alb


@dataclass(frozen=True)
class Study:
    """Samples of one spectrum and slope: on each mesh, and their limit of vanishing cells from the two finest."""

    meshes: dict[int, Sample]
    limit: Sample


def kept_surface(number: int, plan: Plan, spectrum: Spectrum, slope: float, folder: Path) -> tuple[Array, Array]:
    """`surface`, from its file where there is one."""
    path, made_by = folder / f"{number:03d}.npz", repr(replace(plan, surfaces=0))
    if not path.exists():
        f, alb = surface(number, plan, spectrum, slope)
        part = path.with_suffix(".part.npz")
        np.savez(part, f=f, alb=alb, plan=made_by)
        part.rename(path)
    with np.load(path) as file:
        if file["plan"] != made_by:
            raise ValueError(f"{path} was traced by another plan ({file['plan']}); delete it or name another folder")
        return file["f"], file["alb"]


def carry_out(plan: Plan, spectrum: Spectrum, slope: float, *, folder: Path, processes: int) -> Study:
    """All surfaces of a plan; `folder` is theirs alone."""
    folder.mkdir(parents=True, exist_ok=True)
    work = partial(kept_surface, plan=plan, spectrum=spectrum, slope=slope, folder=folder)
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        f, alb = (np.stack(values) for values in zip(*pool.map(work, range(plan.surfaces)), strict=True))
    meshes = {cells: Sample.of(slope, POLAR, f[:, m], alb[:, m]) for m, cells in enumerate(plan.cells)}
    ratio = plan.cells[-1] / plan.cells[-2]
    limits = (without_mesh(values[:, -2], values[:, -1], ratio) for values in (f, alb))
    return Study(meshes, Sample.of(slope, POLAR, *limits))
