"""Which pixels keep all their samples: by looking at every pixel's neighbours, and at those a shadow's edge crosses."""

from itertools import pairwise

import torch

from inverse import Distant, Scene, plane, sphere, vase
from inverse.planning.sampling_detail import borders, sampling_options
from inverse.transport.shadows import Shadows
from torchbrdf import Lambert

RAISED = Distant(torch.tensor([0.3, 1.6, 0.6]))


def mixed(mask):
    """Pixels that see both values in the three by three about them, one by one."""
    rows, columns = mask.shape
    out = torch.zeros_like(mask)
    for r in range(rows):
        for c in range(columns):
            around = mask[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2]
            out[r, c] = around.any() and not around.all()
    return out


def test_borders_are_where_neighbours_differ():
    for share in (0.05, 0.5, 0.95):
        mask = torch.rand(17, 23, generator=torch.Generator().manual_seed(0)) < share
        assert torch.equal(borders(mask), mixed(mask))
    for same in (torch.zeros(5, 4, dtype=torch.bool), torch.ones(5, 4, dtype=torch.bool)):
        assert not borders(same).any()


def test_the_edge_of_a_cast_shadow_is_never_merged():
    """A pixel of the vase whose samples are not all lit or all dark keeps them, however much else is merged."""
    surface = vase(40, 40, samples=4)
    scene = Scene(surface, [RAISED])
    lit = torch.zeros_like(surface.mask)
    points, normals = surface.points[surface.mask], surface.normals[surface.mask]
    clear = Shadows(surface.solid, points, normals).clear(RAISED.direction)
    lit[surface.mask] = clear & (normals @ RAISED.direction > 0)
    blocks = lit.unflatten(0, (40, 4)).unflatten(2, (40, 4)).sum((1, 3))
    crossed = (surface.coverage() == 1) & (blocks > 0) & (blocks < 16)
    assert crossed.sum() > 10
    options = [apply(scene).fully_sampled for _, apply in sampling_options(scene, Lambert(albedo=0.7))]
    assert len(options) > 3
    assert (~options[0]).sum() > 100
    for kept in options:
        assert kept[crossed].all()


def test_ever_more_pixels_keep_their_samples():
    scene = Scene(sphere(32, 32, samples=2), [Distant.from_angle(20)])
    options = [apply(scene).fully_sampled for _, apply in sampling_options(scene, Lambert(albedo=0.7))]
    for fewer, more in pairwise(options):
        assert not (fewer & ~more).any()
    full = scene.surface.coverage() == 1
    assert all(not (kept & ~full).any() for kept in options)


def test_an_evenly_lit_plane_needs_one_sample():
    scene = Scene(plane(12, 12, samples=3), [Distant.from_angle(30)])
    choice, apply = next(sampling_options(scene, Lambert(albedo=0.7)))
    assert "100%" in choice
    assert not apply(scene).fully_sampled.any()
