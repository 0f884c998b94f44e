r"""Smith's masking and shadowing of a surface with Gaussian slopes, written so that it stays finite at grazing.

.. math::
    S_1 = \frac{1 - \tfrac12\mathrm{erfc}(b)}{1 + \Lambda(b)} = \frac{N}{N + e^{-b^2}}, \quad
    N = \sqrt\pi\, b\,(1 + \mathrm{erf}\, b), \quad b = \frac{\tau \cot\theta}{2 \sigma_0}

Source: Smith 1967, "Geometrical shadowing of a random rough surface", DOI 10.1109/TAP.1967.1138991; He, Torrance,
    Sillion & Greenberg 1991, "A comprehensive physical model for light reflection", DOI 10.1145/127719.122738,
    eqs. (23)-(25). The factor exp(-b^2) of Lambda follows from Smith's integral.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

# exp(-b^2) and erfc(b) are below 1e-35 beyond: nothing is hidden. Holds normal incidence and sigma0 = 0.
_OPEN = 9.0
_HIDDEN_WHERE_OPEN = 4.2e-37  # erfc of it, and a little more


class Shadowing(NamedTuple):
    """What one direction sees of the surface, each (...).

    Attributes:
        over_cos: S_1/cos(theta): 1/cos for steep directions, sqrt(pi) tau/(2 sigma0 sin) at grazing. [-]
        visibility: S_1 itself. [-] in (0, 1]
        k: tan(theta) erfc(b), the share of heights that is hidden in He et al. 1991, eq. (82). [-]
    """

    over_cos: Tensor
    visibility: Tensor
    k: Tensor


def shadowing(cos: Tensor, sin: Tensor, *, sigma0: Tensor, tau: Tensor) -> Shadowing:
    """Shadowing of a direction with cosine > 0 and sine >= 0 to the normal, each (...); sigma0 >= 0, tau > 0 (...)."""
    run = tau * cos
    # b up to _OPEN, where all is seen: 1/cos to rounding, and independent of sigma0
    slope = tau / torch.maximum(2 * sigma0 * sin, run / _OPEN)  # b = slope cos
    b = slope * cos
    sides = math.sqrt(math.pi) * (1 + torch.erf(b))
    seen = b * sides
    all_of_it = seen + (-b * b).exp()
    hidden = torch.threshold(torch.erfc(b), _HIDDEN_WHERE_OPEN, 0.0)
    return Shadowing(slope * sides / all_of_it, seen / all_of_it, sin / cos * hidden)
