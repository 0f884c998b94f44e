"""Figures of fits, returned: `figure.savefig(path)` is the caller's. Needs matplotlib (the `plots` extra).

No pyplot: nothing here chooses a backend, opens a window or keeps a figure alive.
"""

from collections.abc import Sequence
from itertools import pairwise

import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from torch import Tensor

from inverse.profiles import cross_section
from inverse.scene import Scene, Surface, pixel_average

_LINES = ("tab:red", "tab:blue", "tab:green", "tab:purple")


def fit_figure(
    surface: Surface,
    photographs: Tensor,
    renderings: dict[str, Tensor],
    lights: Sequence[str],
    *,
    title: str,
) -> Figure:
    """Photographs and renderings side by side, and their cross-sections below.

    Args:
        photographs: (image, rows, columns, channel); at most two images are shown.
        renderings: label -> images of the same shape, in the same units.
        lights: one caption an image.
    """
    images = min(len(photographs), 2)
    columns = 1 + len(renderings)
    figure = Figure(figsize=(1.8 * columns * images, 5.4), dpi=100, layout="constrained")
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
    return figure


def residual_figure(scene: Scene, photographs: Tensor, renderings: dict[str, Tensor], valid: Tensor) -> Figure:
    """What each model leaves unexplained: in one image, and over all images against the angle of the light.

    Args:
        photographs: (image, rows, columns, channel).
        renderings: label -> images of the same shape, in the same units.
        valid: the samples that were fitted, bool (image, rows, columns); the others are left white.
    """
    figure = Figure(figsize=(3.2 * (len(renderings) + 2), 3.2), dpi=100, layout="constrained")
    axes = figure.subplots(1, len(renderings) + 2)
    seen = scene.surface.coverage() > 0
    window = tuple(slice(int(k.nonzero()[0]), int(k.nonzero()[-1]) + 1) for k in (seen.any(1), seen.any(0)))
    axes[0].imshow(photographs[0].mean(-1)[window].numpy(), cmap="gray")
    axes[0].set_title("photograph 0", fontsize=10)
    limit = 3 * (photographs - next(iter(renderings.values())))[valid].square().mean().sqrt().item()
    angles = torch.stack([_light_angle(scene, k) for k in range(scene.images)])
    edges = torch.linspace(0, 75, 16)
    for axis, colour, (label, stack) in zip(axes[1:], _LINES, renderings.items(), strict=False):
        residual = (photographs - stack).mean(-1)
        shown = residual[0].masked_fill(~valid[0], torch.nan)[window]
        axis.imshow(shown.numpy(), cmap="RdBu_r", vmin=-limit, vmax=limit)
        rms = residual[valid].square().mean().sqrt().item()
        axis.set_title(f"minus {label}, rms {rms:.4f}", fontsize=10)
        means = [residual[valid & (angles >= low) & (angles < high)].mean().item() for low, high in pairwise(edges)]
        axes[-1].plot((edges[:-1] + edges[1:]) / 2, means, ".-", color=colour, label=label)
    figure.colorbar(axes[1].images[0], ax=axes[len(renderings)], shrink=0.8, label="of full scale")
    for axis in axes[:-1]:
        axis.set_axis_off()
    axes[-1].set(xlabel="angle of the light [deg]", ylabel="of full scale", title="mean residual, all images")
    axes[-1].title.set_fontsize(10)
    axes[-1].axhline(0, color="k", linewidth=0.5)
    axes[-1].legend(fontsize=8)
    return figure


def measurement_figure(
    curves: dict[str, dict[str, tuple[Tensor, Tensor]]], shares: dict[str, dict[str, float]]
) -> Figure:
    """Measured and fitted reflectance along a line of directions, and what each model leaves unexplained.

    Args:
        curves: title -> label -> (viewing angle [deg], f_r [1/sr]); the first label's are drawn as dots.
        shares: model -> material or part of it -> residual in percent.
    """
    figure = Figure(figsize=(3.6 * len(curves), 4 + 0.27 * len(shares)), dpi=80, layout="constrained")
    grid = figure.add_gridspec(2, len(curves), height_ratios=(4, 0.27 * len(shares)))
    for column, (title, lines) in enumerate(curves.items()):
        axis = figure.add_subplot(grid[0, column])
        for style, (label, (angle, brdf)) in zip(("k.", *_LINES), lines.items(), strict=False):
            order = angle.argsort()
            axis.semilogy(angle[order].numpy(), brdf[order].numpy(), style, label=label)
        axis.set(xlabel="viewing angle [deg]", ylim=(1e-4, 100))
        axis.set_title(title, fontsize=10)
        axis.grid(alpha=0.3)
    figure.axes[0].set_ylabel("f_r [1/sr]")
    figure.axes[0].legend(fontsize=8)
    axis = figure.add_subplot(grid[1, :])
    table = torch.tensor([list(row.values()) for row in shares.values()])
    axis.imshow(table.numpy(), cmap="viridis_r", vmin=0, vmax=100, aspect="auto")
    for i, row in enumerate(table.tolist()):
        for j, share in enumerate(row):
            axis.text(j, i, f"{share:.0f}", ha="center", va="center", color="w" if share > 40 else "k", fontsize=9)
    axis.set_xticks(range(table.shape[1]), list(next(iter(shares.values()))), fontsize=8)
    axis.set_yticks(range(table.shape[0]), list(shares))
    axis.set_title("residual rms, in percent of the rms of the data", fontsize=10)
    return figure


def _light_angle(scene: Scene, image: int) -> Tensor:
    """Polar angle of an image's first light at each pixel (rows, columns). [deg]"""
    beam = scene.lights[image][0].beams()[0]
    surface = scene.surface
    points, normals = (pixel_average(k, surface.samples) for k in (surface.points, surface.normals))
    direction = next(beam.arrivals(points.flatten(0, 1))).direction.expand(normals.flatten(0, 1).shape)
    return torch.rad2deg((normals * direction.unflatten(0, normals.shape[:2])).sum(-1).clamp(-1, 1).acos())


def _plot_cross_section(axis: Axes, surface: Surface, photograph: Tensor, renderings: dict[str, Tensor]) -> None:
    position, brightness = cross_section(photograph, surface)
    every = max(1, len(position) // 100)
    axis.plot(position[::every], brightness[::every], "k.", markersize=3, label="photograph")
    for colour, (label, image) in zip(_LINES, renderings.items(), strict=False):
        axis.plot(*cross_section(image, surface), color=colour, label=label)
    axis.set(xlabel="position, left limb (-1) to right limb (1)", ylabel="brightness (full scale = 1)", xlim=(-1, 1))
    axis.set_ylim(bottom=0)
    axis.legend(fontsize=9, loc="lower center")
    axis.grid(alpha=0.3)
