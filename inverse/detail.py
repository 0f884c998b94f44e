"""Which pixels need all their samples: where the radiance may vary inside a pixel."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import torch
from torch import Tensor

from inverse.footprints import footprints
from inverse.geometry import pixel_average
from inverse.scene import Scene
from inverse.shading import arrivals
from inverse.simplify import beams

# Shares of the pixels, smoothest first, that are tried with one sample.
_SHARES = (1.0, 0.98, 0.95, 0.9, 0.8, 0.6, 0.4)


def details(scene: Scene) -> Iterator[tuple[str, Callable[[Scene], Scene]]]:
    """Ways to leave samples out, from the cheapest on: what is done instead, and the change of the scene.

    Ever more pixels keep all their samples: first those where the normals spread most, and always those that the
    edge of an attached or cast shadow may cross.
    """
    surface, s = scene.surface, scene.surface.samples
    mean = pixel_average(surface.normals, s)
    length = mean.norm(dim=-1)
    full = surface.coverage() == 1
    where = footprints(surface, torch.zeros_like(full))
    edge = torch.zeros_like(full)
    for light in beams(scene):
        arrival = next(arrivals(light, where if scene.shadows else replace(where, solid=None)))
        cosine = (where.normals * arrival.direction).sum(-1)
        width = torch.sin(torch.acos(length.clamp(max=1)).clamp(max=math.pi / 2)).flatten()[where.pixel] * 2
        on_edge = where.to_image((cosine.abs() < width).to(mean)[:, None])[..., 0] > 0
        dark = where.to_image((arrival.irradiance.amax(-1) <= 0).expand(cosine.shape).to(mean)[:, None])
        edge = edge | on_edge | borders(dark[..., 0] > 0)
    for share in _SHARES:
        limit = torch.quantile(1 - length[full & ~edge].double(), share) if (full & ~edge).any() else 0.0
        detail = full & (edge | (1 - length.double() > limit))
        merged = float((full & ~detail).sum() / full.sum())
        choice = f"one sample in {merged:.0%} of the pixels, where the radiance hardly varies"
        yield choice, partial(replace, detail=detail)


def borders(mask: Tensor) -> Tensor:
    """Pixels within one of where a mask (rows, columns) changes."""
    fields = torch.stack((mask, ~mask)).to(torch.float32)[:, None]
    near = torch.nn.functional.max_pool2d(fields, 3, stride=1, padding=1)[:, 0] > 0
    return near.all(0)
