"""Figures. Needs matplotlib (the `plots` extra)."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
from torch import Tensor

from inverse.geometry import Surface
from inverse.profile import cross_section

matplotlib.use("Agg")  # files only: no display is needed

_LINES = ("tab:red", "tab:blue", "tab:green", "tab:purple")


def fit_figure(
    path: Path | str,
    surface: Surface,
    photographs: Tensor,
    renderings: dict[str, Tensor],
    lights: Sequence[str],
    *,
    title: str,
) -> None:
    """Photographs and renderings side by side, and their cross-sections below.

    Args:
        photographs: (image, rows, columns, channel); at most two images are shown.
        renderings: label -> images of the same shape, in the same units.
        lights: one caption an image.
    """
    images = min(len(photographs), 2)
    columns = 1 + len(renderings)
    figure = plt.figure(figsize=(3.0 * columns * images, 7.2), layout="constrained")
    figure.suptitle(title, fontsize=11)
    grid = figure.add_gridspec(2, columns * images, height_ratios=(1.0, 1.05))
    for k in range(images):
        shown = [photographs[k], *(stack[k] for stack in renderings.values())]
        brightest = max(image.max().item() for image in shown)
        for c, (label, stack) in enumerate([("photograph", photographs), *renderings.items()]):
            axis = figure.add_subplot(grid[0, k * columns + c])
            axis.imshow(stack[k].detach().clamp(min=0).numpy() / brightest, cmap="gray", vmin=0, vmax=1)
            axis.set_title(f"{label}", fontsize=10)
            axis.set_axis_off()
        axis = figure.add_subplot(grid[1, k * columns : (k + 1) * columns])
        _plot_cross_section(axis, surface, photographs[k], {name: stack[k] for name, stack in renderings.items()})
        axis.set_title(f"({'ab'[k]}) cross-section of the belly, {lights[k]}", fontsize=10)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _plot_cross_section(axis, surface: Surface, photograph: Tensor, renderings: dict[str, Tensor]) -> None:
    position, brightness = cross_section(photograph, surface)
    every = max(1, len(position) // 100)
    axis.plot(position[::every], brightness[::every], "k.", markersize=3, label="photograph")
    for colour, (label, image) in zip(_LINES, renderings.items(), strict=False):
        axis.plot(*cross_section(image, surface), color=colour, label=label)
    axis.set(
        xlabel="position across the vase, left limb to right limb", ylabel="brightness (full scale = 1)", xlim=(-1, 1)
    )
    axis.set_ylim(bottom=0)
    axis.legend(fontsize=9, loc="lower center")
    axis.grid(alpha=0.3)
