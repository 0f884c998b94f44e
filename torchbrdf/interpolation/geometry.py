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

from torchbrdf._numerics import cross, length, safe_divide, safe_sqrt
from torchbrdf.directions import Cosines

_MIDDLE = 1.5  # c, the radius in the middle of [0, inf): 65 deg
_TURN = 0.3  # k
MOST_GRAZING = math.cos(math.radians(89.95))  # nearer to the horizon reflectance is held
_DEEPEST = 1 / (1 + _MIDDLE / math.acosh(1 / MOST_GRAZING))  # x there

# |P| |Q|, and |P - Q| |P + Q| over (|P - Q| + |P + Q|)^2, below which the azimuth, or the direction from a cone, is
# rounding
_TIP = {torch.float64: 1e-10, torch.float32: 1e-5}


class GeometryCoordinates(NamedTuple):
    """Of light and view (...), and the mean of their cosines, by which reflectance is multiplied in a table."""

    depth: Tensor  # x over that of the most grazing direction, in [0, 1]
    apart: Tensor  # v in [0, 1]
    slant: Tensor  # z in [0, 1]
    mean_cosine: Tensor


def geometry_coordinates(cosines: Cosines) -> GeometryCoordinates:
    """Coordinates of directions (...). At a cone, P = Q or P = -Q, apart and slant have zero gradient."""
    (light, light_ratio), (view, view_ratio) = (_radius(*part) for part in _cosines_and_sines(cosines))
    far, near = torch.maximum(light, view), torch.minimum(light, view)
    ratios = light_ratio * view_ratio
    product, dot, across = far * near, cosines.in_plane * ratios, cosines.azimuth_sine * ratios
    # |P| |Q| (1 -+ cos(dphi)); next to a cone, where one is a difference of equals, by the product of both
    apart, opposed = product - dot, product + dot
    tilted = product > _TIP[product.dtype]  # next to the normal all of this is rounding
    forward, backward = ((2 * part < product) & tilted for part in (apart, opposed))
    squared = across * across
    apart, opposed = (
        torch.where(forward, safe_divide(squared, opposed, where=forward), apart),
        torch.where(backward, safe_divide(squared, apart, where=backward), opposed),
    )
    turn = _turn(near, safe_divide(near, far, where=far > 0))
    turn = turn * turn
    met = product > 0
    kept = safe_divide(2 * product, turn * apart + opposed, where=met) + (~met).to(product)  # their sum stays 2 |P| |Q|
    apart, opposed = turn * kept * apart, kept * opposed
    difference, total = far - near, far + near
    first, second = (safe_sqrt(difference * difference + 2 * part) for part in (apart, opposed))
    perimeter, both = first + second, first * second
    v = safe_divide(first, perimeter, where=perimeter > 0)
    z = safe_divide(difference * total, both, where=both > 0)
    # There slant is rounding, and which direction is the more grazing one: of both, half the derivative.
    tip = both <= _TIP[both.dtype] * perimeter * perimeter
    depth = torch.where(tip, 0.5 * total, far)
    return GeometryCoordinates(
        depth / (_MIDDLE + depth) / _DEEPEST,
        torch.where(tip, v.detach(), v),
        torch.where(tip, z.detach(), z),
        0.5 * (cosines.light.clamp(min=MOST_GRAZING) + cosines.view.clamp(min=MOST_GRAZING)),
    )


def _cosines_and_sines(cosines: Cosines) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    """Cosine and sine of light and of view, each (...): with all digits of a small sine where the vectors are known."""
    light, view = cosines.light, cosines.view
    if cosines.vectors is None:
        sines = [safe_sqrt((1 - c) * (1 + c)) for c in (light, view)]
    else:
        normal, *directions = cosines.vectors
        sines = [length(cross(normal, d)).masked_fill(~cosines.above_horizon, 0.0) for d in directions]
    light, view = (c.clamp(min=MOST_GRAZING) for c in (light, view))
    return (light, sines[0]), (view, sines[1])


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


def _radius(cosine: Tensor, sine: Tensor) -> tuple[Tensor, Tensor]:
    """r = ln((1 + sin)/cos) and r/sin (...), 1 at the normal, where both have zero gradient."""
    radius = torch.log1p(sine) - cosine.log()
    tilted = sine > 0
    return radius, safe_divide(radius, sine, where=tilted) + (~tilted).to(sine)
