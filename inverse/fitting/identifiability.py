"""What the photographs say about the parameters: covariance, and when they say too little."""

import math

import torch
from torch import Tensor

from inverse.fitting.levenberg_marquardt import NormalEquations, Solution, scale
from inverse.fitting.unknowns import Unknown, Unknowns
from torchbrdf import Interval

# A standard error above this share of the parameter's domain tells next to nothing.
_UNINFORMATIVE = 0.25
_ONE_SIDED_95 = 1.645
# A logistic coordinate whose slope has fallen to this share of the domain sits on the bound.
_FLAT = 1e-5
# Two positive unknowns so correlated, with relative errors so large, are known as a ratio or a product alone. An
# effect that fades like 1/x^2 cannot be told from none at 95 % once the relative error is 1/(2 * 1.645); half of that.
_TIED = 0.999
_LOOSE = 0.15
# Weight in a singular direction from which a parameter is named as part of it.
_INVOLVED = 0.3
# And up to which it has no part in it.
_ABSENT = 0.01


class Covariance:
    """Covariance of shared (G, G) and variances of own (P, L) unknowns, in raw coordinates, for noise variance 1.

    `blind` lists the directions (G,) of the shared unknowns that the photographs do not determine, in
    coordinates in which each unknown alone has unit information; their variance is infinite.
    """

    def __init__(self, equations: NormalEquations, dtype: torch.dtype):
        # Rounding of the derivatives leaves a singular direction at eps, not at 0; scaled to a unit
        # diagonal, eigenvalues compare with 1.
        tolerance = 16 * torch.finfo(dtype).eps
        own_scale, shared_scale = scale(equations.own), scale(equations.shared)
        own, own_lost = _pseudo_inverse(equations.own / (own_scale[:, :, None] * own_scale[:, None, :]), tolerance)
        mixed = equations.mixed / (shared_scale[None, :, None] * own_scale[:, None, :])
        through = own @ mixed.mT
        schur = equations.shared / (shared_scale[:, None] * shared_scale) - torch.einsum("ngl,nlh->gh", mixed, through)
        shared, lost = _pseudo_inverse(schur, tolerance)
        values, vectors = torch.linalg.eigh(schur)
        self.blind = vectors[:, values <= tolerance].T
        variances = own.diagonal(dim1=-2, dim2=-1) + torch.einsum("nlg,gh,nlh->nl", through, shared, through)
        self.own = (variances / own_scale**2).masked_fill(own_lost, torch.inf)
        self.shared = shared / (shared_scale[:, None] * shared_scale)
        self.shared[lost, :] = torch.nan
        self.shared[:, lost] = torch.nan
        self.shared[lost, lost] = torch.inf


def _pseudo_inverse(matrix: Tensor, tolerance: float) -> tuple[Tensor, Tensor]:
    """Inverse (..., n, n) outside the null space, and which unknowns (..., n) have a part in that."""
    if not matrix.numel():
        return matrix, matrix.new_zeros(matrix.shape[:-1], dtype=torch.bool)
    values, vectors = torch.linalg.eigh(matrix)
    seen = values > tolerance
    inverse = (vectors * seen[..., None, :] / values.masked_fill(~seen, 1.0)[..., None, :]) @ vectors.mT
    lost = ((vectors.abs() > _INVOLVED) & ~seen[..., None, :]).any(-1)
    return inverse, lost


def judge(unknowns: Unknowns, solution: Solution, covariance: Covariance, noise: float) -> tuple[str, str]:
    """Status and reason of a finished fit: a number nobody should trust is not called converged."""
    tied = _tied(unknowns, covariance, noise) if solution.status != "diverged" else ""
    if tied:  # a fit that is out of steps has run along them
        return "not identified", tied if solution.status == "converged" else f"{tied}; {solution.reason}"
    if solution.status != "converged":
        return solution.status, solution.reason + _texels(unknowns, solution, covariance)
    labels = unknowns.shared_labels()
    if len(covariance.blind):
        # of several blind directions any mixture is one: who takes part is a matter of all of them together
        part = covariance.blind.square().sum(0)
        others = [f"the {entry.name} of each texel" for entry in unknowns.own_entries]
        mute = [label for label, k in zip(labels, part.tolist(), strict=True) if k > 1 - _ABSENT]
        if mute and not others:
            each = "each of " if len(mute) > 1 else ""
            return "not identified", f"{each}{', '.join(mute)} changes nothing in the data"
        involved = [label for label, k in zip(labels, part.tolist(), strict=True) if k > _INVOLVED**2]
        return "not identified", f"the data cannot tell {' from '.join([*involved, *others])}"
    errors = covariance.shared.diagonal().sqrt() * noise
    position = 0
    verdicts = []
    for entry, raw in unknowns.split_shared(solution.shared):
        for k in range(len(raw)):
            verdicts.append(_judge_one(entry, labels[position], raw[k].double(), errors[position]))
            position += 1
    for status in ("not identified", "at bound"):
        reasons = [verdict[1] for verdict in verdicts if verdict and verdict[0] == status]
        if reasons:
            return status, "; ".join(reasons)
    return solution.status, solution.reason + _texels(unknowns, solution, covariance)


def _tied(unknowns: Unknowns, covariance: Covariance, noise: float) -> str:
    """Which two positive shared unknowns the data know by their ratio or product alone; empty if none."""
    labels = unknowns.shared_labels()
    domains = [entry.domain for entry in unknowns.shared_entries for _ in range(entry.start.numel())]
    positive = [k for k, d in enumerate(domains) if isinstance(d, Interval) and math.isinf(d.high)]
    if len(covariance.blind) == 1:  # of several, any mixture is one
        direction = covariance.blind[0]
        involved = (direction.abs() > _ABSENT).nonzero()[:, 0].tolist()
        if len(involved) == 2 and set(involved) <= set(positive):
            i, j = involved
            return _either(labels[i], labels[j], ratio=bool(direction[i] * direction[j] > 0))
    errors = covariance.shared.diagonal().sqrt()  # of logarithms: relative ones
    for j in positive:
        for i in positive[: positive.index(j)]:
            correlation = covariance.shared[i, j] / (errors[i] * errors[j])
            if correlation.abs() > _TIED and noise * torch.minimum(errors[i], errors[j]) > _LOOSE:
                return _either(labels[i], labels[j], ratio=bool(correlation > 0))
    return ""


def _either(first: str, second: str, *, ratio: bool) -> str:
    return f"the data tell the {'ratio' if ratio else 'product'} of {first} and {second}, and hardly either"


def _texels(unknowns: Unknowns, solution: Solution, covariance: Covariance) -> str:
    """How many texels have a value that should not be trusted."""
    if not unknowns.own_entries:
        return ""
    lost = (~covariance.own.isfinite()).any(1)
    on_bound = torch.zeros_like(lost)
    for entry, raw in unknowns.split_own(solution.own):
        if isinstance(entry.domain, Interval) and math.isfinite(entry.domain.high):
            width = entry.domain.high - entry.domain.low
            on_bound |= (entry.slope(raw) < _FLAT * width).any(1)
    counts = {"not identified": int(lost.sum()), "on a bound": int((on_bound & ~lost).sum())}
    notes = [f"{count} of {len(lost)} texels {what}" for what, count in counts.items() if count]
    return "".join(f", {note}" for note in notes)


def _judge_one(entry: Unknown, label: str, raw: Tensor, raw_error: Tensor) -> tuple[str, str] | None:
    domain = entry.domain
    if not isinstance(domain, Interval):
        return None
    value, error = entry.physical(raw).item(), (entry.slope(raw) * raw_error).item()
    width = domain.high - domain.low
    to_unit = 180 / torch.pi if domain.angular else 1.0
    unit = " deg" if domain.angular else ""
    for bound in (domain.low, domain.high):
        if not domain.even and abs(value - bound) < _FLAT * min(width, 1.0):
            hint = "; are exposure and irradiance right?" if bound == 1 else ""
            return "at bound", f"{label} ran into its bound {bound * to_unit:.4g}{unit}{hint}"
    if domain.even and value - domain.low < error:
        # the standard error of the square is 2 value error, however small the value
        limit = ((value - domain.low) ** 2 + _ONE_SIDED_95 * 2 * (value - domain.low) * error) ** 0.5
        if limit < _UNINFORMATIVE * width:
            return "at bound", f"{label} cannot be told from {domain.low:g}: below {limit * to_unit:.2g}{unit} at 95 %"
    if not error <= _UNINFORMATIVE * width or (width == torch.inf and error > value):
        return "not identified", f"the standard error of {label}, {error * to_unit:.2g}{unit}, spans its domain"
    for bound, distance in ((domain.low, value - domain.low), (domain.high, domain.high - value)):
        if distance <= error and not (domain.even and bound == domain.low):
            return "at bound", f"{label} cannot be told from its bound {bound * to_unit:.4g}{unit}"
    return None
