"""What V-cavities reflect and absorb, and their modes against radiosity on a mesh."""

import itertools
import math

import numpy as np
import pytest
import torch
from helpers.paper_form import crossed_strings
from helpers.planes import f64

from torchbrdf.models.oren_nayar.cavity_modes import bounce_coefficients, facet_modes, modes_of
from torchbrdf.models.oren_nayar.images import Bounces, cavity_images
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.v_cavity import strip_fraction

F64 = torch.float64
CPU = torch.device("cpu")


def _energy(slope, light, albedo, count):
    """Reflected, absorbed share of aligned grooves; `light` is the across-slope p_x of the source, for which nothing
    else matters.
    """
    modes = modes_of((slope,), count, F64, CPU)
    cosine, tangent = f64(math.cos(slope), math.tan(slope))
    material = bounce_coefficients(modes.eigenvalues, f64(albedo)[0])
    # The hemisphere of views, integrated along the grooves: (pi/2) cos(phi) dphi with q_x = tan(phi).
    edge = math.atan(1 / math.tan(slope))
    cuts = sorted({-0.5 * math.pi, 0.5 * math.pi, *(s * e for s in (-1, 1) for e in (edge, math.atan(light)))})
    x, weight = gauss_legendre(60, cosine)
    reflected = 0.0
    for low, high in itertools.pairwise(cuts):
        view = (low + (high - low) * x * x * (3 - 2 * x)).tan()
        found = cavity_images(
            (light * tangent).expand(60, 1),
            (view * tangent)[:, None],
            cos_slope=cosine,
            bounces=Bounces(True, count),
            modes=modes,
        )
        total = (
            albedo * found.direct[:, 0]
            + albedo**2 * found.two_bounce[:, 0]
            + (found.higher * material).sum((-1, -2, -3))
        )
        reflected += ((high - low) * 6 * x * (1 - x) * weight * total * view.atan().cos()).sum().item() * 0.5 * math.pi
    # Radiosity summed over both facets, from its own three parts.
    left, right = light * tangent, -light * tangent
    first = sum(((1 + z).clamp(min=0) * strip_fraction(z)).item() for z in (left, right))
    hidden = [1 - strip_fraction(z) for z in (left, right)]
    exchange = [crossed_strings(h.item(), 0.0, math.acos(cosine.item())) / math.pi for h in hidden]
    second = sum((1 + z).clamp(min=0).item() * e for z, e in zip((left, right), exchange, strict=True))
    whole = facet_modes(modes, torch.ones(1, dtype=F64))[0] / 2
    lit = (facet_modes(modes, left[None]) + facet_modes(modes, right[None]))[0]
    rest = (lit * whole * material.sum(-1)[0]).sum().item()
    absorbed = (1 - albedo) / albedo * 0.5 * (albedo * first + albedo**2 * second + rest)
    return reflected, absorbed


@pytest.mark.parametrize("degrees", [3, 20, 45, 70, 85])
@pytest.mark.parametrize("light", [0.0, 0.3, 1.7, math.tan(math.radians(89))])
def test_energy_is_conserved(degrees, light):
    """Furnace at albedo 1, and reflected + absorbed = 1 below, for facets cut and uncut; g = K*1 in the space makes
    even 4 modes conserve.
    """
    for albedo, count, bar in ((1.0, 4, 5e-4), (1.0, 12, 1e-6), (0.7, 12, 1e-6)):
        reflected, absorbed = _energy(math.radians(degrees), light, albedo, count)
        assert reflected + absorbed == pytest.approx(1, abs=bar)
        assert albedo < 1 or absorbed == 0


def test_modes_match_radiosity_on_a_graded_mesh():
    """Hottel's crossed strings on 500 strips a facet, Richardson-free: agrees to the mesh error."""
    slope, hidden_s, hidden_v, albedo = 1.1, 0.3, 0.5, 0.95
    edges = np.unique(np.concatenate(([0.0, hidden_s, hidden_v], np.geomspace(1e-6, 1, 300), np.linspace(0, 1, 250))))

    def string(x, y):
        return np.sqrt(x * x + 2 * x * y * math.cos(2 * slope) + y * y)

    low, high = edges[:-1, None], edges[1:, None]
    factors = (string(low, high.T) + string(high, low.T) - string(low, low.T) - string(high, high.T)) / (
        2 * (high - low)
    )
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    lit, seen = (middle > hidden_s) * 1.0, (middle > hidden_v) * width
    solution = np.linalg.solve(np.eye(len(width)) - albedo**2 * factors @ factors, factors @ (factors @ lit))
    expected = np.array([albedo**3 * seen @ solution, albedo**4 * seen @ (factors @ solution)])
    modes = modes_of((slope,), 20, F64, CPU)
    couplings = [
        facet_modes(modes, torch.tensor([(1 + h) / (1 - h)], dtype=F64))[0] * (1 - h) / 2 for h in (hidden_s, hidden_v)
    ]
    found = (bounce_coefficients(modes.eigenvalues, f64(albedo)[0])[0] * (couplings[0] * couplings[1])[:, None]).sum(0)
    np.testing.assert_allclose(found.numpy(), expected, rtol=2e-4)
