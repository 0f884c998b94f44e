"""Facets that know their neighbours: the integral over both, laws, surfaces that the constants were not fitted to."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from helpers.heightfields import DATA, F64, all_azimuths, cosines, f64, held, rms, smith_masking, traced
from torch.testing import assert_close

from torchbrdf import (
    INDEPENDENT_FACETS,
    NEIGHBOURING_FACETS,
    SMOOTH_HEIGHTFIELD,
    Cosines,
    GaussianHeightfield,
    NeighbouringFacets,
    gaussian_heightfield,
)
from torchbrdf.models.heightfield.direct import QUADRATURES
from torchbrdf.models.heightfield.surface import sum_of_orders
from torchbrdf.models.heightfield.transport import bounce_modes, direct_albedo, polar_nodes, smith_modes
from torchbrdf.testing import random_directions

GRID = torch.linspace(0, 89.5, 24, dtype=F64).deg2rad()


def neighbours(slope, **settings) -> GaussianHeightfield:
    return GaussianHeightfield.from_rms_slope(held(slope), transport=NEIGHBOURING_FACETS, **settings)


def two_bounces_by_facets(slope, *, across, along, shared, same_side, azimuths=16):
    """f_2 (P, P, azimuth) on 4 nodes and dphi: sums over slopes of both facets by components, no azimuth series."""
    nodes = polar_nodes(4, f64(slope))
    theta, solid = nodes.theta.numpy(), nodes.solid_angle.numpy()
    x, w = np.polynomial.legendre.leggauss(60)
    radius, psi = 4.5 * (1 + x), (np.arange(240) + 0.5) * 2 * np.pi / 240
    share = (w * radius * np.exp(-(radius**2) / 2))[:, None] * np.ones(240)
    share = (share / share.sum()).ravel()
    xi = np.stack((radius[:, None] * np.cos(psi), radius[:, None] * np.sin(psi)), -1).reshape(-1, 2)
    share = share / np.sqrt(1 + slope**2 * (xi**2).sum(-1)) / np.pi

    def facing(polar, phi, sign=1.0):  # facets' cosines over their own, towards (or against) a direction
        return np.maximum(sign * (np.cos(polar) + slope * np.sin(polar) * (xi @ [np.cos(phi), np.sin(phi)])), 0)

    phi = (np.arange(azimuths) + 0.5) * 2 * np.pi / azimuths
    masking = np.array([smith_masking(angle, slope) for angle in theta])
    f = np.zeros((4, 4, azimuths))
    for q in range(4):
        below, above = facing(theta[q], 0.0, -1.0) * share, facing(theta[q], 0.0) * share
        outer = np.stack([[facing(angle, p) for p in phi] for angle in theta])  # (P, azimuth, facet)
        # q at azimuth 0: xi[:, 0] lies along the line between the facets
        terms = ((1.0, np.ones(len(xi))), (along, xi[:, 0]), (across, xi[:, 1]))
        for c, component in terms:
            first, second = (outer @ (side * component) for side in (below, above))
            for k in range(azimuths):  # mean over the azimuth of q
                pairs = np.einsum("ip,rp->ir", first, np.roll(second, -k, 1)) / azimuths
                f[:, :, k] += c * solid[q] / np.cos(theta[q]) * pairs / (1 + masking[q] + masking)
    f = (f + f.swapaxes(0, 1)[..., -np.arange(azimuths) % azimuths]) / (1 + masking[:, None] + masking)[..., None]
    f /= np.cos(theta)[:, None, None] * np.cos(theta)[:, None]
    t = slope * np.tan(theta)
    v = t**2 / (1 + t**2)
    u, w = v**2 / (1 + masking), v * np.sin(theta) ** 5
    s2, dphi = slope**2, 2 * np.pi * np.arange(azimuths) / azimuths
    level, turn = shared * s2 / (1 + s2) * np.outer(u, u), same_side / (1 + s2) * np.outer(w, w)
    return f * np.exp(level[..., None] + turn[..., None] * np.cos(dphi)), dphi


@pytest.mark.parametrize("slope", [0.4, 1.1])
def test_two_bounces_are_integrals_over_both_facets(slope):
    constants = {"across": 0.6, "along": -0.2, "shared": 0.0, "same_side": 0.0}
    expected, dphi = two_bounces_by_facets(slope, **constants)
    nodes = polar_nodes(4, f64(slope))
    modes = NeighbouringFacets(**constants).modes(f64(slope), nodes, 2)[0]
    for m in range(3):
        mode = torch.from_numpy((expected * np.cos(m * dphi)).mean(-1))
        assert_close(modes[m], mode, rtol=1e-3, atol=1e-4 * float(modes[0].max()))


def test_rays_that_share_their_surroundings():
    # of a series that is not cut: at s = 1.1 the third azimuth mode is below 1 % of f_2
    constants = {"across": 0.5, "along": 0.0, "shared": 0.9, "same_side": 0.2}
    expected, dphi = two_bounces_by_facets(1.1, **constants)
    modes = NeighbouringFacets(**constants).modes(f64(1.1), polar_nodes(4, f64(1.1)), 2)[0]
    for m in range(3):
        mode = torch.from_numpy((expected * np.cos(m * dphi)).mean(-1))
        assert_close(modes[m], mode, rtol=3e-3, atol=1e-3 * float(modes[0].max()))


def test_without_correlation_facets_are_independent():
    slope = f64(0.7)
    nodes = polar_nodes(8, slope)
    none = NeighbouringFacets(across=0.0, along=0.0, shared=0.0, same_side=0.0).modes(slope, nodes, 3)
    smith = smith_modes(slope, nodes, 3)
    assert_close(none[:, 0], smith[:, 0], rtol=1e-12, atol=0)
    assert_close(none[1:, 1], smith[1:, 1], rtol=1e-12, atol=0)
    assert_close(0.7 * none[0, 1], smith[0, 1], rtol=1e-12, atol=1e-15)  # which independent facets are damped by
    assert not none[1:, 2].any()


@pytest.mark.parametrize("slope", [0.01, 0.3, 0.8, 1.482])
def test_two_bounces_are_positive_and_reciprocal(slope):
    c = cosines(GRID[:, None, None], GRID[:, None], torch.linspace(0, math.pi, 9, dtype=F64))
    two = neighbours(slope, bounces=2, nodes=160).fields(c)[..., 1]
    assert two.min() > 0
    assert_close(two, two.transpose(0, 1), rtol=1e-9, atol=0)


@pytest.mark.parametrize(("slope", "occlusion"), [(0.3, 1.0), (0.9, 1.6)])
def test_white_facets_lose_no_light(slope, occlusion):
    s, e = f64(slope), f64(occlusion)
    nodes = polar_nodes(14, s)
    settings = (s, e, SMOOTH_HEIGHTFIELD, QUADRATURES[240])
    modes = bounce_modes(*settings, polar=14, orders=24, transport=NEIGHBOURING_FACETS)[:, 0].sum(0)
    total = direct_albedo(*settings, nodes) + (modes * (nodes.solid_angle * nodes.cos)).sum(-1)
    assert (total - 1).abs().max() < 2e-5
    between = neighbours(slope, albedo=held(1.0), occlusion=held(occlusion), nodes=160)
    assert (1 - between.directional_albedo(GRID[::4].cos(), nodes=32)[:, 0]).abs().max() < 1.5e-3


def test_two_bounces_end_with_the_roughness():
    c = cosines(*f64([[0.3, 1.2, 1.5], [0.7, 1.1, 1.4], [0.4, 2.0, 3.0]]))
    smooth = neighbours(0.0, albedo=held(0.8))
    assert_close(smooth.evaluate(c)[:, 0], torch.full((3,), 0.8 / math.pi, dtype=F64), rtol=4e-15, atol=0)
    for s in (1e-3, 1e-2, 1e-1):
        two = neighbours(s, bounces=2, nodes=160).fields(c)[..., 1]
        assert two.abs().max() < s**2


@pytest.mark.parametrize("name", ["sigma", "occlusion"])
def test_derivatives_by_the_material(name):
    directions = random_directions(2, dtype=F64, generator=torch.Generator().manual_seed(5))
    c = Cosines.of(*directions, normalize=True)
    point = {"sigma": f64(0.6), "occlusion": f64(0.9)}
    settings = {"nodes": 160, "polar_nodes": 6, "table_orders": 3, "transport": NEIGHBOURING_FACETS}

    def f(x):
        return gaussian_heightfield(c, albedo=f64(0.8), **(point | {name: x}), **settings)

    assert torch.autograd.gradcheck(f, point[name].requires_grad_())


@dataclass(frozen=True)
class Sideways:
    """A transport of a user's own: all light turned as its third azimuth mode says."""

    strength: float

    def modes(self, slope, nodes, orders):
        flat = slope**2 * torch.ones(orders, len(nodes.theta), len(nodes.theta), dtype=slope.dtype)
        sines = (nodes.sin[:, None] * nodes.sin) ** 3
        return torch.stack((flat, 0 * flat, 0 * flat, self.strength * flat * sines), -3)


def test_a_transport_of_your_own_joins():
    dphi = torch.linspace(0, math.pi, 7, dtype=F64)
    brdf = GaussianHeightfield.from_rms_slope(held(0.5), bounces=2, nodes=160, transport=Sideways(0.4))
    two = brdf.fields(cosines(1.1, 0.9, dphi))[:, 1]
    wave = 1 + 0.8 * (math.sin(1.1) * math.sin(0.9)) ** 3 * (3 * dphi).cos()
    assert_close(two / two[3], wave / wave[3], rtol=2e-3, atol=0)
    other = GaussianHeightfield.from_rms_slope(held(0.5), bounces=2, nodes=160, transport=Sideways(0.0))
    assert_close(other.fields(cosines(1.1, 0.9, dphi))[:, 1].std(), f64(0.0), rtol=0, atol=1e-12)
    kept = [m.model.settings.transport for m in brdf.members() if isinstance(m.model, GaussianHeightfield)]
    assert set(kept) == {Sideways(0.4)}


@pytest.mark.parametrize(("name", "full"), [("t12_0.3", 0.0025), ("t12_0.67", 0.006), ("t12_1", 0.007)])
def test_surfaces_not_fitted_to_have_half_the_error(name, full):
    # The constants were fitted to surfaces of 6 cells a correlation length; the form was chosen with these in view.
    slope, directions, truth = traced(name)
    errors = {}
    for transport in (INDEPENDENT_FACETS, NEIGHBOURING_FACETS):
        brdf = GaussianHeightfield.from_rms_slope(held(slope), transport=transport)
        fields = brdf.fields(directions)
        errors[transport] = rms(all_azimuths(fields[..., 1] / truth["f2"] - 1))
    assert errors[NEIGHBOURING_FACETS] < errors[INDEPENDENT_FACETS] / 2
    assert rms(all_azimuths(sum_of_orders(f64(0.9), fields)[..., 0] / truth["full_0.9"] - 1)) < full


def test_fresh_surfaces_have_half_the_error():
    # Drawn for this alone, at slopes of no calibration; less the variance of the means over 16 surfaces.
    squares = {INDEPENDENT_FACETS: [], NEIGHBOURING_FACETS: []}
    with np.load(DATA / "heightfield_fresh.npz") as file:
        theta = f64(file["theta"])
        directions = cosines(theta[:, None, None], theta[:, None], torch.arange(9, dtype=F64) * (math.pi / 8))
        for slope in ("0.2", "0.5", "0.85"):
            truth, se, full = (f64(file[f"{slope}_{key}"]) for key in ("f2", "f2_se", "full_0.9"))
            whole = []
            for transport, values in squares.items():
                brdf = GaussianHeightfield.from_rms_slope(held(float(slope)), nodes=160, transport=transport)
                fields = brdf.fields(directions)
                relative = all_azimuths(fields[..., 1] / truth - 1)
                values.append(rms(relative) ** 2 - rms(all_azimuths(se / truth)) ** 2)
                whole.append(rms(all_azimuths(sum_of_orders(f64(0.9), fields)[..., 0] / full - 1)))
            assert whole[1] < 0.8 * whole[0]
    before, after = (np.array(values) for values in squares.values())
    assert math.sqrt(after.mean()) < math.sqrt(before.mean()) / 2
    assert (np.sqrt(after[1:]) < np.sqrt(before[1:]) / 2).all()  # at 0.2 the noise is as large as the error
