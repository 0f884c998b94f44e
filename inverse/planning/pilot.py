"""A stratified sample of a scene's own pixels, on which effects are measured."""

from dataclasses import replace

import torch
from torch import Tensor

from inverse.planning.sampling_detail import borders
from inverse.scene import Scene, pixel_average
from inverse.transport import Shadows, unhidden

# Bins of a polar angle, from along the axis to perpendicular, and beyond.
_VIEW_BINS, _LIGHT_BINS = 6, 9
# Only so many lights are told apart.
_LIGHTS = 3


def stratified_sample(scene: Scene, count: int, seed: int, *, extremes: bool) -> tuple[Scene, Tensor, Tensor]:
    """A scene that shows `count` of the object's pixels, which they are (rows, columns), and for how many each stands.

    The pixels are drawn evenly from strata of incidence for each light, of obliqueness to the view, of cast shadow and
    its edge, of the side of the object, and of full or partial coverage: what effects depend on. With
    `extremes` the most curved pixel of each stratum comes first: the sample is then no longer fair.
    """
    surface = scene.surface
    strata, shown = _strata(scene)
    generator = torch.Generator().manual_seed(seed)
    order = torch.randperm(int(shown.sum()), generator=generator)
    _, stratum, sizes = torch.unique(strata[shown][order], return_inverse=True, return_counts=True)
    # the n-th of each stratum comes before the n+1-th of any
    by_stratum = stratum.argsort(stable=True)
    rank = torch.empty_like(by_stratum)
    rank[by_stratum] = torch.cat([torch.arange(int(k)) for k in sizes])
    if extremes:
        by_curvature = surface.spread_of_normals()[shown][order].argsort(descending=True)
        places = torch.arange(len(order))
        first = torch.zeros_like(sizes).scatter_reduce(0, stratum[by_curvature], places, "amin", include_self=False)
        rank[by_curvature[first]] = -1
    taken = rank.argsort(stable=True)[:count]
    stands_for = torch.zeros(len(order), dtype=surface.normals.dtype)
    share = sizes / stratum[taken].bincount(minlength=len(sizes)).clamp(min=1)
    stands_for[order[taken]] = share[stratum[taken]].to(stands_for)
    pixels = torch.zeros_like(shown).masked_scatter(shown, stands_for > 0)
    fine = pixels.repeat_interleave(surface.samples, 0).repeat_interleave(surface.samples, 1)
    return replace(scene, surface=replace(surface, mask=surface.mask & fine)), pixels, stands_for[stands_for > 0]


def _strata(scene: Scene) -> tuple[Tensor, Tensor]:
    """A number for each pixel's stratum, and the pixels that show the object, both (rows, columns)."""
    surface, s = scene.surface, scene.surface.samples
    coverage = surface.coverage()
    shown = coverage > 0
    share = surface.mask.to(surface.normals.dtype)[..., None]

    def mean(field: Tensor) -> Tensor:
        total = pixel_average(torch.where(surface.mask[..., None], field, 0 * field) * share, s)[shown]
        return total / coverage[shown][:, None]

    points, normals = mean(surface.points), torch.nn.functional.normalize(mean(surface.normals), dim=-1)
    view = surface.view if surface.view.ndim == 1 else mean(surface.view)
    number = _bin((normals * view).sum(-1), _VIEW_BINS) * 2 + (coverage[shown] == 1)
    number = number * 4 + 2 * (normals[:, 0] > 0) + (normals[:, 1] > 0)
    shadows = Shadows(surface.solid, points, normals)
    for light in scene.beams()[:_LIGHTS]:
        arrival = next(unhidden(light, shadows))
        number = number * (_LIGHT_BINS + 1) + _bin((normals * arrival.direction).sum(-1), _LIGHT_BINS)
        if light.why_shadowless(surface.solid) is None:
            lit = arrival.irradiance.amax(-1) > 0
            edge = borders(torch.zeros_like(shown).masked_scatter(shown, lit))[shown]
            number = number * 4 + 2 * lit + edge
    return torch.zeros_like(shown, dtype=torch.long).masked_scatter(shown, number.long()), shown


def _bin(cosine: Tensor, bins: int) -> Tensor:
    """Number of the polar angle's bin; `bins` below the horizon."""
    angle = torch.rad2deg(torch.acos(cosine.clamp(-1, 1)))
    return (angle * bins / 90).long().clamp(max=bins)
