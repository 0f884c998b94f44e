r"""Light reflected twice between facets that are neighbours: their slopes are correlated, and their rays meet the same
surroundings.

Two facets that see each other lie within a correlation length or so. On a smooth surface their slopes across the line
that joins them are then much the same, while those along it agree or oppose each other by the distance. To first order
in the two correlations c (Mehler's expansion of the density of two Gaussian slopes),

.. math::
    E[\kappa_1 \kappa_2] = E[\kappa_1] E[\kappa_2] + c_\perp E[\kappa_1 \xi_\perp] E[\kappa_2 \xi_\perp]
        + c_\parallel E[\kappa_1 \xi_\parallel] E[\kappa_2 \xi_\parallel]

for kappa_1, kappa_2 the light that the first and the second facet turn; independent facets have c = 0. A correlated
pair turns the light less, because the second facet cannot face the first as freely.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from torchbrdf.models.heightfield.transport import Polar, facet_modes, slope_rule, smith_masking, smith_modes

_MODES = 3
_AZIMUTHS = 16  # midpoints on [0, pi]


@dataclass(frozen=True)
class NeighbouringFacets:
    r"""Transport whose two-bounce light knows that facets lighting each other are neighbours.

    .. math::
        F_2 \to F_2\, e^G,\quad G = A\,\tfrac{s^2}{1 + s^2} u_i u_r + B\,\tfrac1{1 + s^2} w_i w_r \cos\Delta\phi,\quad
        u = \frac{v^2}{1 + \Lambda},\quad w = v \sin^5\theta,\quad v = \frac{t^2}{1 + t^2},\quad t = s \tan\theta

    on top of correlated slopes. More bounces are those of `IndependentFacets`.

    Attributes:
        across, along: correlations of the two slopes across and along the line that joins the facets, means over the
            pairs that light each other. [-]
        shared: A, how much more often than independent rays two grazing rays meet such a pair together. [-]
        same_side: B, the same for rays from one side. [-]
    Source: own, with constants from path-traced heightfields; see `docs/heightfield.md`.
    """

    across: float
    along: float
    shared: float
    same_side: float

    def modes(self, slope: Tensor, nodes: Polar, orders: int) -> Tensor:
        """F_n (..., orders, 3, P, P) at unit albedo, n = 2 .. orders + 1. [1/sr]"""
        later = smith_modes(slope, nodes, orders)[..., 1:, :, :, :]
        later = torch.cat((later, torch.zeros_like(later[..., :1, :, :])), -3)
        return torch.cat((self._two_bounces(slope, nodes)[..., None, :, :, :], later), -4)

    def _two_bounces(self, slope: Tensor, nodes: Polar) -> Tensor:
        masking = smith_masking(slope, nodes)
        pairs = _pairs(slope, nodes, masking, self.across, self.along)
        wave = torch.arange(_MODES, dtype=slope.dtype, device=slope.device)
        dphi = (torch.arange(_AZIMUTHS, dtype=slope.dtype, device=slope.device) + 0.5) * (math.pi / _AZIMUTHS)
        cos = (wave[:, None] * dphi).cos()
        series = torch.cat((cos[:1], 2 * cos[1:]))  # f = F_0 + 2 F_1 cos(dphi) + ..
        f = torch.einsum("...mir,mk->...irk", pairs, series) * torch.exp(self._shared_rays(slope, nodes, masking, dphi))
        return torch.einsum("...irk,mk->...mir", f, cos) / _AZIMUTHS

    def _shared_rays(self, slope: Tensor, nodes: Polar, masking: Tensor, dphi: Tensor) -> Tensor:
        """G (..., P, P, azimuth)."""
        square = (slope * slope)[..., None]
        rise = square * nodes.sin * nodes.sin
        grazing = rise / (nodes.cos * nodes.cos + rise)
        both, side = grazing * grazing / (1 + masking), grazing * nodes.sin**5
        square = square[..., None]
        level = self.shared * square / (1 + square) * both[..., :, None] * both[..., None, :]
        turn = self.same_side / (1 + square) * side[..., :, None] * side[..., None, :]
        return level[..., None] + turn[..., None] * dphi.cos()


# Fitted to three traced surfaces (`examples/heightfield_study/fit_neighbours.py`), judged on others (`fresh.py`).
NEIGHBOURING_FACETS = NeighbouringFacets(across=0.520, along=0.014, shared=0.874, same_side=0.213)


def _pairs(slope: Tensor, nodes: Polar, masking: Tensor, across: float, along: float) -> Tensor:
    """F_2 (..., 3, P, P) of pairs of facets with correlated slopes.

    A path goes from i by a first facet down along -q, or up to the horizon's other side by symmetry, to a second that
    sends it to r. The modes of kappa times a slope's component are those of neighbouring modes.
    """
    up, down, weight = facet_modes(slope, nodes, _MODES + 1)
    wave = torch.arange(_MODES + 1, dtype=slope.dtype, device=slope.device)
    down = down * (-1.0) ** wave[:, None, None]  # -q lies across the azimuth of q
    up_ends, up = up, up[..., :_MODES, :, :]
    radius = slope.new_tensor(slope_rule()[0])
    turned = weight * radius
    measure = nodes.solid_angle / nodes.cos
    extinction = 1 + masking[..., :, None] + masking[..., None, :]
    total = 0
    for correlation, share, project in ((1.0, weight, _first_modes), (along, turned, _cosine), (across, turned, _sine)):
        into = up * share @ project(down).mT  # (..., i, q)
        out = project(up_ends) * share @ up.mT / extinction[..., None, :, :]  # (..., q, r)
        total = total + correlation * (into * measure @ out)
    total = total + total.mT
    return total / extinction[..., None, :, :] / (nodes.cos[:, None] * nodes.cos)


def _first_modes(c: Tensor) -> Tensor:
    return c[..., :_MODES, :, :]


def _cosine(c: Tensor) -> Tensor:
    """Cosine modes of a function times cos(psi), from its modes 0 .. 3."""
    return torch.stack([(c[..., abs(m - 1), :, :] + c[..., m + 1, :, :]) / 2 for m in range(_MODES)], -3)


def _sine(c: Tensor) -> Tensor:
    """Sine modes of a function times sin(psi)."""
    return torch.stack([(c[..., abs(m - 1), :, :] - c[..., m + 1, :, :]) / 2 for m in range(_MODES)], -3)
