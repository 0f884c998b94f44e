"""Measured reflectance as a module: a table over Rusinkiewicz's half and difference angles."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import angle, cross, dot, length, safe_atan2, safe_divide, safe_sqrt
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.facets import HalfVector


def rusinkiewicz_angles(cosines: Cosines) -> tuple[Tensor, Tensor, Tensor]:
    r"""theta_h, theta_d and phi_d folded to [0, pi/2], each (...). [rad]

    theta_h is the angle of the half vector to the normal, theta_d that of the light to the half vector, phi_d the
    azimuth of the light about it. An isotropic, reciprocal, mirror-symmetric material depends on phi_d only through
    :math:`|\cos\phi_d| = |\cos\theta_r - \cos\theta_i| / (2 \sin\theta_h \sin\theta_d)`.
    Zero gradient where an angle has none: phi_d at theta_h = 0 and theta_d = 0, taken as 0 there.
    """
    if cosines.vectors is not None:
        return _angles_of_vectors(cosines, *cosines.vectors)
    half = HalfVector.of(cosines)
    sin_h = safe_sqrt(half.sine_squared)
    sin_d = safe_sqrt((1 - cosines.phase) / 2)
    product = 2 * sin_h * sin_d
    defined = product > 0
    cos_phi = safe_divide((cosines.view - cosines.light).abs(), product, where=defined).clamp(max=1.0)
    cos_phi = torch.where(defined, cos_phi, torch.ones_like(cos_phi))
    sin_phi = safe_sqrt((1 - cos_phi) * (1 + cos_phi))
    return angle(sin_h, half.cos), angle(sin_d, half.cos_light), angle(sin_phi, cos_phi)


def _angles_of_vectors(cosines: Cosines, normal: Tensor, light: Tensor, view: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The same from the vectors: all digits, and phi_d from the very numbers that theta_h and theta_d are made of.

    Beside the mirror and the retro direction its derivative is without bound and meets a difference of the table that
    vanishes: they have to agree on how far away that is.
    """
    below = ~cosines.above_horizon
    total, apart = light + view, (light - view).masked_fill(below[..., None], 0.0)
    across = cross(normal, total).masked_fill(below[..., None], 0.0)  # as long as |l + v| sin(theta_h)
    size = length(total).masked_fill(below, 1.0)
    phi = safe_atan2(dot(apart, across).abs(), dot(apart, cross(total, across)).abs() / size)
    return safe_atan2(length(across), cosines.light + cosines.view), safe_atan2(length(apart), size), phi


@final
class TabulatedBRDF(BRDF):
    r"""Isotropic measured reflectance, linear between the nodes of a table in Rusinkiewicz's angles.

    Nodes along each axis are at :math:`(i/(n - 1))^p \cdot \pi/2`: evenly spaced for p = 1, gathered around the
    highlight for p = 2.

    Args:
        values: f_r at the nodes (theta_h, theta_d, phi_d, channel), each angle from 0 to pi/2; at least two nodes
            for each but phi_d, which may have one. [1/sr] >= 0. float32 or float64.
        half_power: p of the theta_h axis. [-] > 0
    Components: measured.
    Raises: TypeError for a dtype that is not supported; ValueError for another shape, or values that are negative
        or not finite.
    Deviations: what the table holds. Light and view may be exchanged, and the two sides of the plane of incidence
        are one; below the horizon 0 whatever the table says. A table whose rows theta_h = 0 or theta_d = 0 depend on
        phi_d, which has no meaning there, jumps in the mirror or the retro direction. Values are
        measured, not trained: a buffer.
    Source: Rusinkiewicz 1998, "A new change of variables for efficient BRDF representation", DOI
        10.1007/978-3-7091-6453-2_2; Matusik, Pfister, Brand & McMillan 2003, "A data-driven reflectance model", DOI
        10.1145/882262.882343.
    """

    uniform_share = 0.25
    values: Tensor

    def __init__(self, values: Tensor, *, half_power: float = 1.0):
        super().__init__()
        if values.dtype not in (torch.float32, torch.float64):
            raise TypeError(f"TabulatedBRDF.values must be float32 or float64; found {values.dtype}.")
        if values.ndim != 4 or min(values.shape[:2]) < 2 or 0 in values.shape:
            raise ValueError(
                "TabulatedBRDF.values must have shape (theta_h >= 2, theta_d >= 2, phi_d, channel); "
                f"found {tuple(values.shape)}."
            )
        bad = ~(values >= 0) | values.isinf()
        if bool(bad.any()):
            raise ValueError(
                f"TabulatedBRDF.values must be finite and not negative; {int(bad.sum())} of {bad.numel()} are not."
            )
        if not half_power > 0:
            raise ValueError(f"TabulatedBRDF.half_power must be positive; found {half_power}.")
        self.register_buffer("values", values.detach().clone())
        self.half_power = half_power

    @classmethod
    def of(
        cls,
        brdf: BRDF,
        *,
        nodes: tuple[int, int, int] = (45, 45, 19),
        half_power: float = 2.0,
        dtype: torch.dtype = torch.float64,
    ) -> "TabulatedBRDF":
        """The table of an isotropic model (theta_h, theta_d, phi_d nodes), for comparison and for tests.

        Nodes of which light or view lie below the horizon hold the 0 the model returns there.
        """
        grids = [torch.linspace(0, 1, n, dtype=dtype) for n in nodes]
        th, td, pd = torch.meshgrid(
            grids[0] ** half_power * math.pi / 2, grids[1] * math.pi / 2, grids[2] * math.pi / 2, indexing="ij"
        )
        # about the half vector z: the normal leans by theta_h towards -x
        normal = torch.stack((-th.sin(), torch.zeros_like(th), th.cos()), -1)
        light = torch.stack((td.sin() * pd.cos(), td.sin() * pd.sin(), td.cos()), -1)
        view = light * light.new_tensor([-1.0, -1.0, 1.0])
        with torch.no_grad():
            values = brdf(normal, light, view).relu()
            values[0], values[:, 0] = values[0, :, :1], values[:, 0, :1]  # phi_d has no meaning there
            return cls(values, half_power=half_power)

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        theta_h, theta_d, phi_d = rusinkiewicz_angles(cosines)
        nodes = self.values.shape
        half, half_share = _bracket(theta_h, nodes[0], self.half_power)
        difference, difference_share = _bracket(theta_d, nodes[1], 1.0)
        azimuth, azimuth_share = _bracket(phi_d, nodes[2], 1.0)
        beside = (azimuth + 1).clamp(max=nodes[2] - 1)

        def row(i: Tensor, j: Tensor) -> Tensor:
            # phi_d first, as a difference: exactly none in rows where phi_d has no meaning and an endless derivative
            start, end = self.values[i, j, azimuth], self.values[i, j, beside]
            return start + azimuth_share[..., None] * (end - start)

        low, high = (
            row(i, difference) * (1 - difference_share)[..., None]
            + row(i, difference + 1) * difference_share[..., None]
            for i in (half, half + 1)
        )
        return {"measured": low * (1 - half_share)[..., None] + high * half_share[..., None]}


def _bracket(value: Tensor, nodes: int, power: float) -> tuple[Tensor, Tensor]:
    """Index (...) of the node at or below an angle in [0, pi/2], and the share (...) of the way to the next."""
    if nodes == 1:
        return torch.zeros_like(value, dtype=torch.long), torch.zeros_like(value)
    turn = value * (2 / math.pi)
    place = turn.detach().clamp(0.0, 1.0) ** (1 / power) * (nodes - 1)
    low = place.floor().clamp(max=nodes - 2)
    start, end = (low / (nodes - 1)) ** power, ((low + 1) / (nodes - 1)) ** power
    return low.long(), (turn - start) / (end - start)
