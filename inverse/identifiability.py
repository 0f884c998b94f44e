"""What the photographs say about the parameters: covariance, and when they say too little."""

import torch
from torch import Tensor

from inverse.levenberg import NormalEquations, Solution
from inverse.unknowns import Unknown, Unknowns

# A standard error above this share of the parameter's domain tells next to nothing.
_UNINFORMATIVE = 0.25
_ONE_SIDED_95 = 1.645
# Weight in a singular direction from which a parameter is named as part of it.
_INVOLVED = 0.3


class Covariance:
    """Covariance of shared (G, G) and variances of own (P, L) unknowns, in raw coordinates, for noise variance 1.

    `blind` lists the directions (G,) of the shared unknowns that the photographs do not determine, in
    coordinates in which each unknown alone has unit information; their variance is infinite.
    """

    def __init__(self, equations: NormalEquations, dtype: torch.dtype):
        e = equations.eliminate(0.0)
        values, vectors = torch.linalg.eigh(e.schur)
        # Rounding of the derivatives leaves a singular direction at eps, not at 0. A scaled matrix has
        # trace G, so eigenvalues compare with 1.
        seen = values > 16 * torch.finfo(dtype).eps
        inverse = (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
        unseen = vectors[:, ~seen]
        # an unknown with any part in a blind direction has infinite variance
        lost = unseen.abs().amax(1) > _INVOLVED if unseen.shape[1] else torch.zeros(len(values), dtype=torch.bool)
        self.blind = unseen.T
        self.shared = inverse / (e.shared_scale[:, None] * e.shared_scale)
        self.shared[lost, :] = torch.nan
        self.shared[:, lost] = torch.nan
        self.shared[lost, lost] = torch.inf
        unmoved = equations.own.diagonal(dim1=-2, dim2=-1) == 0
        own = torch.linalg.inv(e.own).diagonal(dim1=-2, dim2=-1) if e.own.numel() else e.own_scale
        own = own + torch.einsum("nlg,gh,nlh->nl", e.through, inverse, e.through)
        self.own = torch.where(unmoved, torch.inf, own / e.own_scale**2)


def judge(unknowns: Unknowns, solution: Solution, covariance: Covariance, noise: float) -> tuple[str, str]:
    """Status and reason of a finished fit: a number nobody should trust is not called converged."""
    if solution.status != "converged":
        return solution.status, solution.reason
    labels = unknowns.shared_labels()
    for direction in covariance.blind:
        involved = [labels[k] for k in (direction.abs() > _INVOLVED).nonzero()[:, 0].tolist()]
        if len(involved) == 1:
            return "not identified", f"{involved[0]} changes nothing in these photographs"
        return "not identified", f"these photographs cannot tell {' from '.join(involved)}"
    errors = covariance.shared.diagonal().sqrt() * noise
    position = 0
    verdicts = []
    for entry, raw in unknowns.split_shared(solution.shared):
        for k in range(len(raw)):
            verdicts.append(_judge_one(entry, labels[position], raw[k].double(), errors[position]))
            position += 1
    found = [verdict for verdict in verdicts if verdict]
    for status in ("not identified", "at bound"):
        reasons = [reason for s, reason in found if s == status]
        if reasons:
            return status, "; ".join(reasons)
    return solution.status, solution.reason


def _judge_one(entry: Unknown, label: str, raw: Tensor, raw_error: Tensor) -> tuple[str, str] | None:
    domain = entry.domain
    if domain is None:
        return None
    value, error = entry.physical(raw).item(), (entry.slope(raw) * raw_error).item()
    width = domain.high - domain.low
    to_unit = 180 / torch.pi if domain.unit == "rad" else 1.0
    unit = " deg" if domain.unit == "rad" else ""
    if value in (domain.low, domain.high):
        return "at bound", f"{label} ran into its bound {value * to_unit:.4g}{unit}"
    if domain.even and value - domain.low < error:
        # the standard error of the square is 2 value error, however small the value
        limit = ((value - domain.low) ** 2 + _ONE_SIDED_95 * 2 * (value - domain.low) * error) ** 0.5
        if limit < _UNINFORMATIVE * width:
            return "at bound", f"{label} cannot be told from {domain.low:g}: below {limit * to_unit:.2g}{unit} at 95 %"
    if error > _UNINFORMATIVE * width or (width == torch.inf and error > value):
        return "not identified", f"the standard error of {label}, {error * to_unit:.2g}{unit}, spans its domain"
    for bound, distance in ((domain.low, value - domain.low), (domain.high, domain.high - value)):
        if distance <= error and not (domain.even and bound == domain.low):
            return "at bound", f"{label} cannot be told from its bound {bound * to_unit:.4g}{unit}"
    return None
