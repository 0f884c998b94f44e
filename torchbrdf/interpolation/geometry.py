r"""Three coordinates of light and view in which the reflectance of a rough surface is smooth: its cones are straight.

Light and view are two points P, Q of a disc, at distance r = atanh(sin(theta)) = ln tan(theta) + .. from its centre, P
the more grazing one. An isotropic reciprocal surface has its singular points at P = Q (shadow and mask coincide: a
cone) and, where facets exchange light, at P = -Q; in between it varies on the scale of r, next to the horizon too. So

.. math::
    x = \frac{|P|}{c + |P|},\quad v = \frac{|P - Q|}{|P - Q| + |P + Q|},\quad
    z = \frac{|P|^2 - |Q|^2}{|P - Q|\,|P + Q|}

v and arccos z are bipolar coordinates about P and -P: v is 0 or 1 at the cones and proportional to the distance from
them, z the cosine of the direction in which they are left; 1 is the plane of incidence, 0 is alpha = beta. The domain
is a box. Next to P = Q at grazing angles azimuths matter on a finer scale than r does, so the points are turned apart:
tan(azimuth/2) of them is (1 + k |Q|^4/|P|^2) tan(dphi/2), which leaves them alone where either is the normal.
Everything is made of the cosines without an angle. Own derivation.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchbrdf._numerics import safe_divide, safe_sqrt
from torchbrdf.directions import Cosines

_MIDDLE = 1.5  # c, the radius in the middle of [0, inf): 65 deg
_TURN = 0.3  # k
MOST_GRAZING = math.cos(math.radians(89.95))  # nearer to the horizon reflectance is held
_DEEPEST = 1 / (1 + _MIDDLE / math.acosh(1 / MOST_GRAZING))  # x there


class GeometryCoordinates(NamedTuple):
    """Of light and view (...), and the mean of their cosines, by which reflectance is multiplied in a table."""

    depth: Tensor  # x over that of the most grazing direction, in [0, 1]
    apart: Tensor  # v in [0, 1]
    slant: Tensor  # z in [0, 1]
    mean_cosine: Tensor


def geometry_coordinates(cosines: Cosines) -> GeometryCoordinates:
    """Coordinates of directions (...). Lengths that are 0 have zero gradient: only at a cone is that a choice."""
    alpha, beta = cosines.alpha.clamp(min=MOST_GRAZING), cosines.beta.clamp(min=MOST_GRAZING)
    (far, far_ratio), (near, near_ratio) = _radius(alpha), _radius(beta)
    ratios = far_ratio * near_ratio
    product, dot, across = far * near, cosines.in_plane * ratios, cosines.azimuth_sine * ratios
    # |P| |Q| (1 -+ cos(dphi)), the smaller of the two by the product of both
    forward, backward = dot > 0, dot < 0
    apart, opposed = product - dot, product + dot
    squared = across * across
    apart = torch.where(forward, safe_divide(squared, opposed, where=forward), apart)
    opposed = torch.where(backward, safe_divide(squared, apart, where=backward), opposed)
    turn = _turn(near, safe_divide(near, far, where=far > 0))
    turn = turn * turn
    met = product > 0
    kept = safe_divide(2 * product, turn * apart + opposed, where=met) + (~met).to(product)  # of sum 2 |P| |Q|
    apart, opposed = turn * kept * apart, kept * opposed
    difference = far - near
    first, second = (safe_sqrt(difference * difference + 2 * part) for part in (apart, opposed))
    total, both = first + second, first * second
    return GeometryCoordinates(
        far / (_MIDDLE + far) / _DEEPEST,
        safe_divide(first, total, where=total > 0),
        safe_divide(difference * (far + near), both, where=both > 0),
        0.5 * (alpha + beta),
    )


def angles_at(depth: Tensor, apart: Tensor, slant: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Polar angles alpha >= beta and the azimuth between them, each (...) [rad], of coordinates (...) in float64."""
    scaled = depth * _DEEPEST
    far = _MIDDLE * scaled / (1 - scaled)
    rest = 1 - apart
    perimeter = 2 * far / (apart * apart + rest * rest + 2 * slant * apart * rest).sqrt()  # |P - Q| + |P + Q|
    first, second = apart * perimeter, rest * perimeter
    near = (far * far - slant * first * second).clamp(min=0).sqrt()
    difference = (far - near) ** 2
    sine, cosine = ((side * side - difference).clamp(min=0).sqrt() for side in (first, second))
    turn = _turn(near, safe_divide(near, far, where=far > 0))
    return torch.atan(torch.sinh(far)), torch.atan(torch.sinh(near)), 2 * torch.atan2(sine, turn * cosine)


def _turn(near: Tensor, share: Tensor) -> Tensor:
    """How many times the tangent of half the azimuth grows (...); `share` is |Q|/|P|."""
    return 1 + _TURN * (near * share) ** 2


def _radius(cosine: Tensor) -> tuple[Tensor, Tensor]:
    """r = ln((1 + sin)/cos) and r/sin (...), 1 at the normal, where both have zero gradient."""
    sine = safe_sqrt((1 - cosine) * (1 + cosine))
    radius = torch.log1p(sine) - cosine.log()
    tilted = sine > 0
    return radius, safe_divide(radius, sine, where=tilted) + (~tilted).to(sine)
