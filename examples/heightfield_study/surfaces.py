"""Random heightfields: stationary, isotropic, Gaussian heights with a given spectrum, on a square that repeats.

Heights are sums of waves with independent Gaussian amplitudes (white noise times the root of the spectrum). The waves
are drawn once, for the square; a mesh of any fineness samples the same waves. So meshes of one surface can be compared
point by point, which is how the bias of a mesh is measured and taken away.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Spectrum = Callable[[Array], Array]  # spectral density of the heights, any scale, of the wave number k [1/tau]

DRAWN = 4  # waves drawn per tau and axis: the spectra below end at e^-39 there


def gaussian(k: Array) -> Array:
    """One smooth scale: autocorrelation exp(-d^2/tau^2)."""
    return np.exp(-(k**2) / 4)


def two_scale(k: Array) -> Array:
    """Scales tau and 4 tau of equal slope variance."""
    return np.exp(-(k**2) / 4) + 4**4 * np.exp(-((4 * k) ** 2) / 4)


def power_law(k: Array) -> Array:
    """k^-4, which gives every octave the same slope variance, between 1/(8 tau) and a Gaussian end at 1/tau."""
    return np.exp(-(k**2) / 4) / (k**2 + 1 / 8**2) ** 2


@dataclass(frozen=True)
class Waves:
    """Amplitudes of one surface on a square of `length` tau, waves up to 2 pi DRAWN/2 per tau."""

    length: int
    amplitudes: NDArray[np.complex128]

    @classmethod
    def draw(cls, spectrum: Spectrum, length: int, rng: np.random.Generator) -> "Waves":
        count = DRAWN * length
        axis = 2 * np.pi * np.fft.fftfreq(count, 1 / DRAWN)
        k = np.hypot(axis[:, None], axis)
        density = spectrum(k)
        density[0, 0] = 0  # the mean height means nothing
        amplitudes = np.fft.fft2(rng.standard_normal((count, count))) * np.sqrt(density)
        amplitudes[count // 2] = amplitudes[:, count // 2] = 0  # has no partner of opposite sign
        return cls(length, amplitudes)

    def heights(self, cells: int) -> Array:
        """Heights at `cells` vertices per tau and axis (n, n), any scale; n = cells * length."""
        count, n = len(self.amplitudes), cells * self.length
        if n < count:
            raise ValueError(f"cells must be at least {DRAWN} per tau to hold the waves drawn; found {cells}")
        place = np.rint(np.fft.fftfreq(count, 1 / count)).astype(int) % n
        padded = np.zeros((n, n), complex)
        padded[np.ix_(place, place)] = self.amplitudes
        return np.fft.ifft2(padded).real
