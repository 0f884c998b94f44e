"""Which pixels need all their samples: where the radiance may vary inside a pixel."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import torch
from torch import Tensor

from inverse.scene import Footprints, Scene
from inverse.transport import Shadows, render, unhidden
from torchbrdf import BRDF

# Shares of the pixels, smoothest first, that are tried with one sample.
_SHARES = (1.0, 0.98, 0.95, 0.9, 0.8, 0.6, 0.4)


def sampling_options(scene: Scene, model: BRDF) -> Iterator[tuple[str, Callable[[Scene], Scene]]]:
    """Ways to leave samples out, from the cheapest on: what is done instead, and the change of the scene.

    Ever more pixels keep all their samples: first those where the normals spread most or where the image of one sample
    a pixel bends most from pixel to pixel, and always those that the edge of a shadow may cross.
    """
    surface = scene.surface
    full = surface.coverage() == 1
    none = torch.zeros_like(full)
    with torch.no_grad():
        bend = _bend(render(replace(scene, fully_sampled=none), model))
    edge = _shadow_edges(scene, Footprints.of(surface, none))
    rest = full & ~edge
    signs = [bend.double(), surface.spread_of_normals().double()]
    for share in _SHARES if rest.any() else ():
        above = [sign > torch.quantile(sign[rest], share) for sign in signs]
        kept = full & (edge | above[0] | above[1])
        merged = float((full & ~kept).sum() / full.sum())
        choice = f"one sample in {merged:.0%} of the pixels, where the radiance hardly varies"
        yield choice, partial(replace, fully_sampled=kept)


def _bend(images: Tensor) -> Tensor:
    """Largest second difference (rows, columns) of any image (image, rows, columns, channel) in both directions."""
    wide = torch.nn.functional.pad(images.movedim(-1, 1), (1, 1, 1, 1), mode="replicate")
    middle = 2 * wide[..., 1:-1, 1:-1]
    across = wide[..., 1:-1, 2:] + wide[..., 1:-1, :-2] - middle
    along = wide[..., 2:, 1:-1] + wide[..., :-2, 1:-1] - middle
    return (across.abs() + along.abs()).amax((0, 1))


def _shadow_edges(scene: Scene, footprints: Footprints) -> Tensor:
    """Pixels (rows, columns) that the edge of an attached or a cast shadow may cross."""
    spread = scene.surface.spread_of_normals()
    edge = torch.zeros_like(spread, dtype=torch.bool)
    normals = footprints.normals
    shadows = Shadows(footprints.solid if scene.shadows else None, footprints.points, normals)
    for light in scene.beams():
        arrival = next(unhidden(light, shadows))
        cosine = (normals * arrival.direction).sum(-1)
        # normals that spread by an angle a leave a mean of length about 1 - a^2/4 at most
        width = 2 * (2 * spread).sqrt().flatten()[footprints.pixel]
        near = (cosine.abs() < width).to(spread)
        dark = (arrival.irradiance.amax(-1) <= 0).expand(cosine.shape).to(spread)
        near, dark = (footprints.to_image(k[:, None])[..., 0] > 0 for k in (near, dark))
        edge = edge | near | borders(dark)
    return edge


def borders(mask: Tensor) -> Tensor:
    """Pixels within one of where a mask (rows, columns) changes."""
    fields = torch.stack((mask, ~mask)).to(torch.float32)[:, None]
    near = torch.nn.functional.max_pool2d(fields, 3, stride=1, padding=1)[:, 0] > 0
    return near.all(0)
