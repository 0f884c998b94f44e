"""Levenberg-Marquardt for problems with a few shared unknowns and, possibly, some for every pixel.

The unknowns of one pixel touch only that pixel's residuals, so they are eliminated pixel by pixel
(Schur complement): a million pixels with an albedo each and one roughness cost a million small
solves and one more. Derivatives are exact, by forward differentiation.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import torch
from torch import Tensor
from tqdm import tqdm

# Steps below this, in the unconstrained coordinates, change nothing that can be seen.
STEP_TOLERANCE = {torch.float64: 1e-10, torch.float32: 1e-5}
# Neither does a relative decrease of the sum of squares below this.
COST_TOLERANCE = {torch.float64: 1e-12, torch.float32: 1e-7}
# A longer step could leap onto the flat end of a parameter's domain, where its derivative is lost.
_LONGEST_STEP = 2.0
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e12
_PROGRESS_AFTER_SECONDS = 2.0

Residual = Callable[[Tensor, Tensor], Tensor]


@dataclass(frozen=True)
class NormalEquations:
    """J'J and J'r of the residuals r (image, pixel, channel), in float64.

    G shared unknowns, N pixels with L unknowns each: shared (G, G), mixed (N, G, L), own (N, L, L).
    """

    shared: Tensor
    mixed: Tensor
    own: Tensor
    shared_gradient: Tensor
    own_gradient: Tensor
    cost: float

    @classmethod
    def of(cls, residual: Residual, shared: Tensor, own: Tensor) -> "NormalEquations":
        """Linearise the residuals at (shared (G,), own (N, L))."""
        r = residual(shared, own).double()
        columns = []
        for k in range(len(shared)):
            tangent = torch.zeros_like(shared)
            tangent[k] = 1
            columns.append(_derivative(residual, shared, own, tangent, torch.zeros_like(own)))
        by_shared = torch.stack(columns) if columns else r.new_zeros(0, *r.shape)
        columns = []
        for k in range(own.shape[1]):  # one sweep moves this unknown of every pixel at once
            tangent = torch.zeros_like(own)
            tangent[:, k] = 1
            columns.append(_derivative(residual, shared, own, torch.zeros_like(shared), tangent))
        by_own = torch.stack(columns) if columns else r.new_zeros(0, *r.shape)
        return cls(
            torch.einsum("ginc,hinc->gh", by_shared, by_shared),
            torch.einsum("ginc,linc->ngl", by_shared, by_own),
            torch.einsum("kinc,linc->nkl", by_own, by_own),
            torch.einsum("ginc,inc->g", by_shared, r),
            torch.einsum("linc,inc->nl", by_own, r),
            r.square().sum().item(),
        )

    def eliminate(self, damping: float) -> "Eliminated":
        """Damp (Marquardt's scaling: in proportion to the diagonal) and eliminate the pixels' own unknowns."""
        own_scale = _scale(self.own)
        shared_scale = _scale(self.shared)
        own = self.own / (own_scale[:, :, None] * own_scale[:, None, :])
        # an unknown that moves nothing keeps its value: unit diagonal, no gradient
        own = own + torch.diag_embed(torch.where(own.diagonal(dim1=-2, dim2=-1) == 0, 1.0, damping))
        mixed = self.mixed / (shared_scale[None, :, None] * own_scale[:, None, :])
        through = torch.linalg.solve(own, mixed.mT) if own.numel() else mixed.mT  # (N, L, G)
        shared = self.shared / (shared_scale[:, None] * shared_scale)
        shared = shared + torch.diag(torch.where(shared.diagonal() == 0, 1.0, damping))
        return Eliminated(shared - torch.einsum("ngl,nlh->gh", mixed, through), through, own, shared_scale, own_scale)

    def step(self, damping: float) -> tuple[Tensor, Tensor]:
        """Damped Gauss-Newton step (shared, own), no entry longer than the longest step."""
        e = self.eliminate(damping)
        own = self.own_gradient / e.own_scale
        shared = self.shared_gradient / e.shared_scale
        if len(shared):
            right = shared - torch.einsum("nlg,nl->g", e.through, own)
            shared = -torch.linalg.lstsq(e.schur, right[:, None]).solution[:, 0]
        if own.numel():
            own = -torch.linalg.solve(e.own, own[..., None])[..., 0] - e.through @ shared
        return (
            (shared / e.shared_scale).clamp(-_LONGEST_STEP, _LONGEST_STEP),
            (own / e.own_scale).clamp(-_LONGEST_STEP, _LONGEST_STEP),
        )

    def predicted_decrease(self, shared: Tensor, own: Tensor) -> float:
        """How much the cost would fall along a step if the residuals were linear."""
        slope = self.shared_gradient @ shared + (self.own_gradient * own).sum()
        curvature = (
            shared @ self.shared @ shared
            + 2 * torch.einsum("g,ngl,nl->", shared, self.mixed, own)
            + torch.einsum("nl,nlk,nk->", own, self.own, own)
        )
        return -(2 * slope + curvature).item()


@dataclass(frozen=True)
class Eliminated:
    """What is left of the normal equations, each unknown scaled to a unit diagonal."""

    schur: Tensor
    through: Tensor
    own: Tensor
    shared_scale: Tensor
    own_scale: Tensor


@dataclass
class Solution:
    """Where the iteration ended. `status` is converged, out of steps, or diverged, with the reason."""

    shared: Tensor
    own: Tensor
    status: str
    reason: str
    iterations: int
    equations: NormalEquations
    history: list[float] = field(default_factory=list)


def minimise(residual: Residual, shared: Tensor, own: Tensor, *, max_steps: int) -> Solution:
    """Minimise the sum of squares of `residual(shared (G,), own (N, L)) -> (image, pixel, channel)`."""
    dtype = shared.dtype
    equations = NormalEquations.of(residual, shared, own)
    found = Solution(shared, own, "out of steps", f"not converged after {max_steps} steps", 0, equations)
    found.history.append(equations.cost)
    if not torch.isfinite(torch.tensor(equations.cost)):
        found.status, found.reason = "diverged", "the residuals at the start are not finite"
        return found
    damping = _FIRST_DAMPING
    floor = torch.finfo(dtype).eps * equations.cost  # the cost is not known better than this
    for _ in tqdm(range(max_steps), desc="fit", delay=_PROGRESS_AFTER_SECONDS, leave=False, disable=None):
        found.iterations += 1
        while True:
            d_shared, d_own = found.equations.step(damping)
            decrease = found.equations.predicted_decrease(d_shared, d_own)
            length = max((d.abs().max().item() for d in (d_shared, d_own) if d.numel()), default=0.0)
            new_shared, new_own = found.shared + d_shared.to(dtype), found.own + d_own.to(dtype)
            cost = residual(new_shared, new_own).double().square().sum().item()
            negligible = length < STEP_TOLERANCE[dtype] or decrease <= COST_TOLERANCE[dtype] * found.equations.cost
            if cost <= found.equations.cost or negligible or damping > _MOST_DAMPING:
                break
            damping *= 4
        if cost <= found.equations.cost:  # false for NaN
            found.shared, found.own = new_shared, new_own
            found.equations = NormalEquations.of(residual, new_shared, new_own)
            damping = max(damping / 10, _LEAST_DAMPING)
        found.history.append(found.equations.cost)
        if negligible or found.equations.cost <= floor * floor:
            found.status, found.reason = "converged", f"after {found.iterations} steps"
            return found
        if damping > _MOST_DAMPING:
            found.status, found.reason = "diverged", "no step decreases the residual although its gradient is not zero"
            return found
    return found


def _derivative(residual: Residual, shared: Tensor, own: Tensor, d_shared: Tensor, d_own: Tensor) -> Tensor:
    return torch.func.jvp(residual, (shared, own), (d_shared, d_own))[1].double()


def _scale(matrix: Tensor) -> Tensor:
    diagonal = matrix.diagonal(dim1=-2, dim2=-1)
    return torch.where(diagonal > 0, diagonal, 1.0).sqrt()
