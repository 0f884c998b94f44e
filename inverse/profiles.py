"""Brightness along a horizontal line across the object, as in the cross-sections of a vase by Oren & Nayar 1994 (DOI
10.1145/192161.192213; figure 23 of the long version).
"""

import numpy as np
import torch
from torch import Tensor

from inverse.scene import Surface


def belly_row(surface: Surface) -> int:
    """Image row in which the object is widest; the middle one of several."""
    widths = surface.coverage().sum(1)
    widest = (widths >= widths.max() - 0.5).nonzero()[:, 0]
    return int(widest[len(widest) // 2])


def cross_section(image: Tensor, surface: Surface, *, rows: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Brightness across the belly, mean over the channels and over `rows` neighbouring rows.

    Args:
        image: (rows, columns, channel).
    Returns: position in units of the half width, -1 at the left limb and 1 at the right; brightness there.
    """
    from skimage.measure import profile_line  # deferred: draws in parts of SciPy

    row = belly_row(surface)
    covered = (surface.coverage()[row] > 0.5).nonzero()[:, 0]
    left, right = int(covered[0]), int(covered[-1])
    grey = image.detach().mean(-1).to(torch.float64).numpy()
    values = profile_line(grey, (row, left), (row, right), linewidth=rows, mode="reflect")
    return np.linspace(-1, 1, len(values)) * (1 - 1 / len(values)), values


def peak_position(position: np.ndarray, brightness: np.ndarray) -> float:
    """Where a cross-section is brightest, after a cubic Savitzky-Golay filter over a sixth of it."""
    from scipy.signal import savgol_filter  # deferred: importing it takes as long as torch

    window = max(5, len(brightness) // 6 | 1)
    smooth = np.asarray(savgol_filter(brightness, window, 3))
    return float(position[smooth.argmax()])
