r"""Eigenmodes of the exchange of light inside one V-cavity, and the light of three and more bounces they carry.

With the symmetric kernel K of `interreflection`, radiosities on the two facets obey B = rho (E + K B'), B' = rho (E' +
K B). In eigenmodes (lambda_n, phi_n) of K all bounces beyond the second lead from a lit strip [m_s, 1] to a visible
strip [m_v, 1] as
    same facet lit and seen:     sum_n rho^3          / (1 - rho^2 lambda_n^2) Q_n(m_s) Q_n(m_v),
    opposite facet lit:          sum_n rho^4 lambda_n / (1 - rho^2 lambda_n^2) Q_n(m_s) Q_n(m_v),     Q_n(m) = <phi_n, K
        1_[m, 1]>,
so geometry (Q) and material (rho) are separate. K scales as 1/length, so its true spectrum is a continuum; a Galerkin
projection replaces it by N modes. The space is spanned by polynomials of degree < N - 1 and by g = K 1, the share of
light that a point sends to the opposite facet. Q_n holds the first and the last crossing of the cavity exactly (its
kernel integral is closed form), and with g in the space no energy is lost for any N: light left by two bounces is <g, K
    E>, and what escapes after them is <(1 - K) g, (1 - K)^-1 K E>, the same. Reciprocity is exact because the
matrix is symmetric. Own derivation.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from numpy.polynomial import chebyshev, legendre
from torch import Tensor

from torchbrdf._constants import constant
from torchbrdf._numerics import positive
from torchbrdf.quadrature import gauss_legendre_rule

_NODES = 64  # along x and along v = y/x; a sinh substitution makes kernel and g as smooth as the polynomials are
_STRIP_NODES = 48  # strip widths at which G_n is sampled for its expansion
_EXTRA_TERMS = 4  # terms of that expansion beyond the number of modes
_INDEPENDENT = 1e-10  # g counts as a polynomial, its mode as empty, when less than this share of it is left over
_BARELY_CUT = 1e-9  # 1 less the widest strip sampled
_UNCUT = 1e-6  # strips wider than 1 less this stand for the facet that is not cut
_RANK = 1e-13  # singular values below this share of the largest are rounding


class CavityModes(NamedTuple):
    """Modes of K slopes. Q_n(1 - s) = s G_n(s), G_n expanded in Chebyshev polynomials of s, m^2 log(m) and the strip
    mean of g (m = 1 - s).
    """

    eigenvalues: Tensor  # lambda_n (K, N) [-]
    strip_means: Tensor  # coefficients of G_n (K, N, M), those of m^2 log(m) and of the strip mean of g last
    cos_slope: Tensor  # (K,) [-]


def cavity_modes(slopes: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Modes of cavities of slope angles `slopes` (K,) [rad], `count` = N >= 3 of them each; float64 arrays as in
    `CavityModes`.
    """
    slopes = np.asarray(slopes, dtype=np.float64)
    parts = [_modes_of_one(slope, count) for slope in slopes]
    return np.stack([part[0] for part in parts]), np.stack([part[1] for part in parts])


@lru_cache(maxsize=32)
def _cached_modes(slopes: tuple[float, ...], count: int) -> tuple[np.ndarray, np.ndarray]:
    return cavity_modes(np.array(slopes), count)


@constant
def modes_of(slopes: tuple[float, ...], count: int, dtype: torch.dtype, device: torch.device) -> CavityModes:
    """`cavity_modes` as tensors, computed once per set of slopes."""
    eigenvalues, means = _cached_modes(slopes, count)
    return CavityModes(
        *(torch.as_tensor(part, dtype=dtype, device=device) for part in (eigenvalues, means, np.cos(slopes)))
    )


def strip_means(modes: CavityModes, strip: Tensor) -> Tensor:
    """G_n(s) for strip widths s (..., K, node) in [0, 1]; result (..., K, N, node). [-]"""
    twice = 4 * strip - 2
    terms = [torch.ones_like(strip), 0.5 * twice]
    while len(terms) < modes.strip_means.shape[-1] - 2:
        terms.append(twice * terms[-1] - terms[-2])
    hidden = positive(1 - strip)
    valley = hidden * hidden * hidden.log()
    ridge = 4 * (modes.cos_slope * modes.cos_slope)[:, None]  # squared distance of the two ridges
    distance = positive(ridge * (1 - strip) + strip * strip).sqrt()
    sent = 0.5 * (1 - (ridge - strip) / (ridge.sqrt() + distance))
    return modes.strip_means @ torch.stack((*terms, valley, sent), dim=-2)


def facet_modes(modes: CavityModes, projection: Tensor) -> Tensor:
    """Coupling xi_n = (1 + z) Q_n(m(z)) of facets met with projections z (..., K) to the modes of K slopes; (..., K,
    N). [-]

    m = 1 - 2/(1+z) is the hidden fraction, so xi_n = (1 + min(z, 1))+ G_n(min(1, 2/(1+z))).
    """
    facing = (1 + projection.clamp(-1, 1))[..., None]
    return facing * strip_means(modes, (2 / (1 + projection.clamp(min=1)))[..., None])[..., 0]


def bounce_coefficients(eigenvalues: Tensor, albedo: Tensor) -> Tensor:
    """Material side of the modes: rho^3/(1 - rho^2 l^2) and rho^4 l/(1 - rho^2 l^2).

    Args: eigenvalues (K, N) [-], albedo (...) in [0, 1] [-].
    Returns: (..., K, N, 2), last axis (same facet lit, opposite facet lit). [-]
    """
    rho = albedo[..., None, None]
    reflected = rho * eigenvalues
    same = rho * rho * rho / ((1 - reflected) * (1 + reflected))
    return torch.stack((same, reflected * same), dim=-1)


def _modes_of_one(slope: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (N,) and coefficients of G_n (N, N + extra) of one cavity."""
    if slope <= 0:  # the flat cavity exchanges nothing
        return np.zeros(count), np.zeros((count, count + _EXTRA_TERMS))
    cosine, sine = math.cos(2 * slope), math.sin(2 * slope)
    x, x_weight = v, v_weight = _graded_nodes(cosine, sine)
    polynomials, sent = _orthonormal(x, count - 1), _sent(x, cosine)
    inside = polynomials @ (sent * x_weight)
    rest = sent - inside @ polynomials
    again = polynomials @ (rest * x_weight)
    inside, rest = inside + again, rest - again @ polynomials  # orthogonal to rounding only after the second pass
    norm = math.sqrt((rest**2 * x_weight).sum())
    empty = norm < _INDEPENDENT * math.sqrt((sent**2 * x_weight).sum())

    def space(at: np.ndarray) -> np.ndarray:
        powers = _orthonormal(at, count - 1)
        last = np.zeros_like(at) if empty else (_sent(at, cosine) - np.tensordot(inside, powers, 1)) / norm
        return np.concatenate((powers, last[None]))

    # Along the ray y = x v the kernel is K(1, v) / x: the 1/x cancels the Jacobian and what is left is smooth.
    density = 0.5 * sine**2 * v / ((v + cosine) ** 2 + sine**2) ** 1.5 * v_weight
    far = (space(x[:, None] * v) * density).sum(-1)
    triangle = (space(x) * x_weight) @ far.T
    eigenvalues, vectors = np.linalg.eigh(triangle + triangle.T)
    return eigenvalues, vectors.T @ _couplings(space, cosine, sine, count + _EXTRA_TERMS)


def _couplings(space: Callable[[np.ndarray], np.ndarray], cosine: float, sine: float, terms: int) -> np.ndarray:
    """Coefficients (N, terms) of <p, K 1_[1-s, 1]> / s for every p of the space.

    The kernel integral is closed form, (K 1_[m,1])(x) = (1/2)[(x + m cos 2t)/d(x, m) - (x + cos 2t)/d(x, 1)].
    """
    u = np.cos(math.pi * (np.arange(_STRIP_NODES) + 0.5) / _STRIP_NODES)
    strip = np.append(0.5 * (u + 1), 1 - _BARELY_CUT)
    u = 2 * strip - 1
    x, weight = _graded_nodes(cosine, sine)
    to_all = space(x) @ (weight * (0.5 - _sent(x, cosine)))
    values = []
    for hidden in 1 - strip:
        x, weight = _graded_nodes(cosine, sine, hidden)
        unhidden = 0.5 * (x + hidden * cosine) / np.sqrt(x * x + 2 * x * hidden * cosine + hidden * hidden)
        values.append(space(x) @ (weight * unhidden) - to_all)
    ridge = 2 + 2 * cosine
    sent = 0.5 * (1 - (ridge - strip) / (math.sqrt(ridge) + np.sqrt(ridge * (1 - strip) + strip * strip)))
    # Light next to the valley meets ever more of the opposite facet: a term m^2 log(m) that polynomials would chase in
    # vain.
    valley = (1 - strip) ** 2 * np.log(1 - strip)
    basis = np.concatenate((chebyshev.chebvander(u, terms - 3), valley[:, None], sent[:, None]), axis=1)
    # the uncut facet, by far the most frequent case, to all digits
    weight = np.where(strip > 1 - _UNCUT, 1e3, 1.0)[:, None]
    return np.linalg.lstsq(weight * basis, weight * np.stack(values) / strip[:, None], rcond=_RANK)[0].T


def _graded_nodes(cosine: float, sine: float, centre: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1], dense where d(x, centre) is smallest: x + centre cos(2 theta) = centre sin(2 theta)
    sinh(eta).
    """
    eta, weight = (np.array(numbers) for numbers in gauss_legendre_rule(_NODES))
    start, stop = math.asinh(cosine / sine), math.asinh((1 / centre + cosine) / sine)
    eta = start + (stop - start) * eta
    nodes = np.clip(centre * (sine * np.sinh(eta) - cosine), 0, 1)
    weights = (stop - start) * weight * centre * sine * np.cosh(eta)
    return nodes, weights


def _sent(x: np.ndarray, cosine: float) -> np.ndarray:
    """g(x) = (1/2)[1 - (x + cos(2 theta)) / d(x, 1)]: share of the light leaving x that reaches the opposite facet."""
    return 0.5 * (1 - (x + cosine) / np.sqrt(1 + 2 * x * cosine + x * x))


def _orthonormal(x: np.ndarray, count: int) -> np.ndarray:
    """Orthonormal Legendre polynomials of [0, 1] at x (...), result (count, ...)."""
    scale = np.sqrt(2 * np.arange(count) + 1.0)
    return np.moveaxis(legendre.legvander(2 * x - 1, count - 1) * scale, -1, 0)
