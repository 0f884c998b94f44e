"""Levenberg-Marquardt for problems with a few shared unknowns and, possibly, some for every pixel.

The unknowns of one pixel touch only that pixel's residuals, so they are eliminated pixel by pixel
(Schur complement): a million pixels with an albedo each and one roughness cost a million small
solves and one more. Derivatives are exact, by forward differentiation.
Source: Levenberg 1944, "A method for the solution of certain non-linear problems in least squares", DOI
    10.1090/qam/10666; Marquardt 1963, "An algorithm for least-squares estimation of nonlinear parameters", DOI
    10.1137/0111030.
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
# A longer step could leap onto the flat end of a parameter's domain, where its derivative fades.
_LONGEST_STEP = 2.0
# Beyond this coordinate the derivative is lost, and with it the way back.
_FARTHEST = {torch.float64: 30.0, torch.float32: 14.0}
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e12
_PROGRESS_AFTER_SECONDS = 2.0
# Unknowns in whose directions the residuals are differentiated at once.
_TOGETHER = 8


class Residuals:
    """What is to be minimised: a function of (shared (G,), own (N, L)) with values (image, pixel, channel).

    One whose derivatives can be had for less than a forward pass each overrides them.
    """

    def __init__(self, values: Callable[[Tensor, Tensor], Tensor]):
        self._values = values

    def __call__(self, shared: Tensor, own: Tensor) -> Tensor:
        return self._values(shared, own)

    def by_shared(self, shared: Tensor, own: Tensor) -> Tensor:
        """Derivatives (G, image, pixel, channel)."""
        still = own.new_zeros(len(shared), 1, own.shape[1])
        return self._along(shared, own, torch.eye(len(shared)).to(shared), still)

    def by_own(self, shared: Tensor, own: Tensor) -> Tensor:
        """Derivatives (L, image, pixel, channel), each by the unknown of the pixel itself."""
        entries = own.shape[1]  # each sweep moves this unknown of every pixel at once
        return self._along(shared, own, shared.new_zeros(entries, len(shared)), torch.eye(entries).to(own)[:, None])

    def _along(self, shared: Tensor, own: Tensor, d_shared: Tensor, d_own: Tensor) -> Tensor:
        """Along several directions (unknown, G) and (unknown, 1, L): what does not move is computed once for all."""

        def slope(d_shared: Tensor, d_own: Tensor) -> Tensor:
            return torch.func.jvp(self, (shared, own), (d_shared, d_own.expand(own.shape)))[1]

        return torch.vmap(slope, chunk_size=_TOGETHER)(d_shared, d_own)


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
    def of(cls, residuals: Residuals, shared: Tensor, own: Tensor) -> "NormalEquations":
        """Linearise the residuals at (shared (G,), own (N, L))."""
        r = residuals(shared, own).double()
        by_shared = residuals.by_shared(shared, own).double() if len(shared) else r.new_zeros(0, *r.shape)
        by_own = residuals.by_own(shared, own).double() if own.shape[1] else r.new_zeros(0, *r.shape)
        return cls(
            torch.einsum("ginc,hinc->gh", by_shared, by_shared),
            torch.einsum("ginc,linc->ngl", by_shared, by_own),
            torch.einsum("kinc,linc->nkl", by_own, by_own),
            torch.einsum("ginc,inc->g", by_shared, r),
            torch.einsum("linc,inc->nl", by_own, r),
            r.square().sum().item(),
        )

    def step(self, damping: float) -> tuple[Tensor, Tensor]:
        """Damped Gauss-Newton step (shared, own) inside the box of the longest step.

        Damping is in proportion to the diagonal (Marquardt 1963). A pixel whose own step leaves the box, near
        the flat end of a domain, cannot follow the shared unknowns: it is cut, held, and the rest solved anew.
        """
        own_scale, shared_scale = scale(self.own), scale(self.shared)
        own = _damped(self.own / (own_scale[:, :, None] * own_scale[:, None, :]), damping)
        shared = _damped(self.shared / (shared_scale[:, None] * shared_scale), damping)
        mixed = self.mixed / (shared_scale[None, :, None] * own_scale[:, None, :])
        own_gradient, shared_gradient = self.own_gradient / own_scale, self.shared_gradient / shared_scale
        if not own.numel():
            scaled = _boxed_solution(shared, -shared_gradient, _LONGEST_STEP * shared_scale)
            return scaled / shared_scale, own_gradient
        alone = torch.linalg.solve(own, own_gradient[..., None])[..., 0]
        through = torch.linalg.solve(own, mixed.mT)  # (N, L, G)
        held = torch.zeros_like(alone)
        follows = torch.ones(len(own), 1, dtype=torch.bool)
        while True:
            following = through * follows[..., None]
            right = shared_gradient - torch.einsum("ngl,nl->g", mixed, torch.where(follows, alone, -held))
            schur = shared - torch.einsum("ngl,nlh->gh", mixed, following)
            d_shared = _boxed_solution(schur, -right, _LONGEST_STEP * shared_scale)
            d_own = torch.where(follows, -alone - following @ d_shared, held)
            longest = (d_own / own_scale).abs().amax(1, keepdim=True)
            leaving = follows & (longest > _LONGEST_STEP)
            if not leaving.any():
                return d_shared / shared_scale, d_own / own_scale
            held = torch.where(leaving, d_own * (_LONGEST_STEP / longest), held)
            follows = follows & ~leaving

    def predicted_decrease(self, shared: Tensor, own: Tensor) -> float:
        """How much the cost would fall along a step if the residuals were linear."""
        slope = self.shared_gradient @ shared + (self.own_gradient * own).sum()
        curvature = (
            shared @ self.shared @ shared
            + 2 * torch.einsum("g,ngl,nl->", shared, self.mixed, own)
            + torch.einsum("nl,nlk,nk->", own, self.own, own)
        )
        return -(2 * slope + curvature).item()


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


def minimise(residuals: Residuals, shared: Tensor, own: Tensor, *, max_steps: int) -> Solution:
    """Minimise the sum of squares of residuals of (shared (G,), own (N, L))."""
    dtype = shared.dtype
    equations = NormalEquations.of(residuals, shared, own)
    reached = Solution(shared, own, "out of steps", f"not converged after {max_steps} steps", 0, equations)
    reached.history.append(equations.cost)
    if not torch.isfinite(torch.tensor(equations.cost)):
        reached.status, reached.reason = "diverged", "the residuals at the start are not finite"
        return reached
    damping = _FIRST_DAMPING
    for _ in tqdm(range(max_steps), desc="fit", delay=_PROGRESS_AFTER_SECONDS, leave=False, disable=None):
        reached.iterations += 1
        while True:
            new_shared, new_own = (
                (x + d.to(dtype)).clamp(-_FARTHEST[dtype], _FARTHEST[dtype])
                for x, d in zip((reached.shared, reached.own), reached.equations.step(damping), strict=True)
            )
            moved = ((new_shared - reached.shared).double(), (new_own - reached.own).double())
            decrease = reached.equations.predicted_decrease(*moved)
            length = max((d.abs().max().item() for d in moved if d.numel()), default=0.0)
            cost = residuals(new_shared, new_own).double().square().sum().item()
            small = 0 <= decrease <= COST_TOLERANCE[dtype] * reached.equations.cost
            negligible = small or length < STEP_TOLERANCE[dtype]
            if cost <= reached.equations.cost or negligible or damping > _MOST_DAMPING:
                break
            damping *= 4
        if cost <= reached.equations.cost:  # false for NaN
            reached.shared, reached.own = new_shared, new_own
            reached.equations = NormalEquations.of(residuals, new_shared, new_own)
            damping = max(damping / 10, _LEAST_DAMPING)
        reached.history.append(reached.equations.cost)
        if negligible:
            reached.status, reached.reason = "converged", f"after {reached.iterations} steps"
            return reached
        if damping > _MOST_DAMPING:
            reached.status, reached.reason = (
                "diverged",
                "no step decreases the residual although its gradient is not zero",
            )
            return reached
    return reached


def _damped(matrix: Tensor, damping: float) -> Tensor:
    """A matrix of unit diagonal, damped; an unknown that moves nothing has a zero there and keeps its value."""
    diagonal = matrix.diagonal(dim1=-2, dim2=-1)
    return matrix + torch.diag_embed(torch.where(diagonal == 0, 1.0, damping))


def _boxed_solution(matrix: Tensor, right: Tensor, limit: Tensor) -> Tensor:
    """Solve matrix x = right with |x| <= limit: the worst offender is put on its limit, the rest solved anew.

    Clamping the entries of the free solution instead would turn the step, even uphill.
    """
    solution = torch.zeros_like(right)
    free = torch.ones_like(right, dtype=torch.bool)
    while free.any():
        remaining = right[free] - matrix[free][:, ~free] @ solution[~free]
        solution[free] = torch.linalg.lstsq(matrix[free][:, free], remaining[:, None]).solution[:, 0]
        excess = (solution.abs() / limit).masked_fill(~free, 0.0)
        if excess.max() <= 1:
            break
        worst = int(excess.argmax())
        solution[worst] = solution[worst].sign() * limit[worst]
        free[worst] = False
    return solution


def scale(matrix: Tensor) -> Tensor:
    """Root of the diagonal (..., n), 1 where it is 0."""
    diagonal = matrix.diagonal(dim1=-2, dim2=-1)
    return torch.where(diagonal > 0, diagonal, 1.0).sqrt()
