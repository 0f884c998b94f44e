"""What tracing gives: BRDFs by bounce with standard errors between surfaces, on disk and against each other.

A file (.npz) holds `s` (rms slope per axis), `theta` (polar angles), `f[n, i, r, k]` (f_{n+1} of light i, view r and
dphi = k 2 pi/16; dphi = 0 and equal angles: retro), `f_se`, `alb[n, i]` (the share of the light that leaves after n + 1
bounces, rho = 1), `alb_se`; `f_each[m, n, i, r, k]` of the single surfaces, where they are kept.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from surfaces import Array
from tracing import Directions, Traced


@dataclass(frozen=True)
class Sample:
    slope: float
    polar: Array
    f: Array
    f_se: Array
    alb: Array
    alb_se: Array
    each: Array | None = None

    @classmethod
    def of(cls, slope: float, polar: Array, f: Array, alb: Array) -> "Sample":
        """From f (M, n, i, r, k) and alb (M, n, i) of M independent surfaces."""
        root = np.sqrt(len(f))
        errors = f.std(0, ddof=1) / root, alb.std(0, ddof=1) / root
        return cls(slope, polar, f.mean(0), errors[0], alb.mean(0), errors[1], f)

    @classmethod
    def load(cls, path: Path) -> "Sample":
        with np.load(path) as file:
            each = file["f_each"].astype(float) if "f_each" in file else None
            return cls(float(file["s"]), *(file[name] for name in ("theta", "f", "f_se", "alb", "alb_se")), each)

    def save(self, path: Path) -> None:
        each = {} if self.each is None else {"f_each": self.each.astype(np.float32)}
        np.savez_compressed(
            path, s=self.slope, theta=self.polar, f=self.f, f_se=self.f_se, alb=self.alb, alb_se=self.alb_se, **each
        )

    def total(self, rho: float) -> Array:
        """f of all bounces at an albedo (i, r, k). [1/sr]"""
        return np.tensordot(rho ** np.arange(1, len(self.f) + 1), self.f, axes=1)


def by_azimuth(traced: Traced, directions: Directions) -> tuple[Array, Array]:
    """f (n, i, r, k) and alb (n, i): means over what an isotropic surface cannot tell apart.

    Those are rotations about the normal, light and view exchanged, and mirror images.
    """
    column, count = directions.column, directions.column.shape[1]
    turned = [
        np.mean([traced.f[:, column[:, j]][:, :, column[:, (j + k) % count]] for j in range(count)], axis=0)
        for k in range(count)
    ]
    f = np.stack(turned, axis=-1)
    f = (f + f.swapaxes(1, 2)) / 2
    return (f + f[..., -np.arange(count) % count]) / 2, traced.alb[:, column].mean(-1)


def without_mesh(coarse: Array, fine: Array, ratio: float) -> Array:
    """The limit of vanishing cells from meshes of cells in a ratio; their bias falls with the square of the cell."""
    return fine + (fine - coarse) / (ratio**2 - 1)


def distinct(f: Array) -> Array:
    """The entries (..., P) of (..., i, r, k) that symmetry and the zenith leave: i <= r, dphi in [0, pi]."""
    polar, azimuths = f.shape[-2:]
    triples = [
        (i, r, k) for i in range(polar) for r in range(i, polar) for k in range(1 if i == 0 else azimuths // 2 + 1)
    ]
    i, r, k = np.array(triples).T
    return f[..., i, r, k]


def chi_square(one: Sample, other: Sample, bounce: int) -> float:
    """Mean square of the difference over its standard error, distinct entries of f_bounce.

    1 is expected of equal truths, a little more from few surfaces; entries of one surface err together, so that it
    scatters far more than that of as many independent numbers would.
    """
    n = bounce - 1
    variance = distinct(one.f_se[n]) ** 2 + distinct(other.f_se[n]) ** 2
    return float(np.mean((distinct(one.f[n]) - distinct(other.f[n])) ** 2 / variance))
