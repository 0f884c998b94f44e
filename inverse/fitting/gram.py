r"""What a fit of a linear model needs of its photographs: one small matrix an image and channel.

A model that is linear in geometry images predicts the recorded values :math:`y = e B c + a`: images B (pixel, K), the
material's coefficients c, the exposure e and the ambient light a of the photograph. Whatever the material, the sum of
squared residuals is a quadratic form,

.. math:: |e B c + a - y|^2 = v^T G v,\quad v = (e c, a, -1),\quad G = (B, 1, y)^T (B, 1, y),

so that the pixels are read once. With :math:`G = R^T R` the K + 2 residuals :math:`R v` have its value and its
derivatives: the same minimum, the same covariance.
"""

import torch
from torch import Tensor

from inverse.fitting.levenberg_marquardt import Residuals
from inverse.fitting.prediction import Predict
from inverse.fitting.unknowns import Unknowns

# Few enough that their float64 copies stay in the cache.
_PIXELS_AT_A_TIME = 16384
# How much larger than the rounding that shows may be that which does not.
_ROUNDING = 4


def condensed(
    basis: Tensor, coefficients: Predict, unknowns: Unknowns, recorded: Tensor, used: Tensor
) -> tuple["CondensedResiduals", Tensor]:
    """Residuals of a few rows with the sums of squares and products of all pixels, and their own unknowns: none.

    Args:
        basis: images (image, pixel, 1 or channel, K) as recorded.
        coefficients: of raw parameters, (1 or channel, K).
        recorded, used: (image, pixel, channel); bool `used` leaves samples out.
    """
    roots = torch.stack([_root(gram(*image)) for image in zip(basis, recorded, used, strict=True)])
    return CondensedResiduals(roots, coefficients, unknowns), recorded.new_zeros(roots.shape[-1], 0)


class CondensedResiduals(Residuals):
    """K + 2 residuals an image and channel, of shared unknowns alone.

    Args:
        roots: (image, channel, K + 2, K + 2), of the Gram matrices.
        coefficients: of raw parameters, (1 or channel, K).
    """

    def __init__(self, roots: Tensor, coefficients: Predict, unknowns: Unknowns):
        super().__init__(lambda shared, own: self._of(*self._seen(shared, own), last=-1.0))
        self.roots, self.coefficients, self.unknowns = roots, coefficients, unknowns

    def by_shared(self, shared: Tensor, own: Tensor) -> Tensor:
        """Through the few numbers that the pixels see, by their backward pass: forward ones take a pass an unknown."""
        shared = shared.detach().requires_grad_()
        numbers = self._seen(shared, own)
        flat = torch.cat([number.flatten() for number in numbers])
        rows = torch.eye(len(flat), dtype=flat.dtype, device=flat.device)
        (jacobian,) = torch.autograd.grad(flat, shared, rows, is_grads_batched=True)
        seen, exposure, ambient = (number.detach() for number in numbers)
        columns = [
            d.reshape(*of.shape, -1).movedim(-1, 0)
            for d, of in zip(jacobian.split([n.numel() for n in numbers]), numbers, strict=True)
        ]
        by_exposure = [self._of(seen, d, torch.zeros_like(ambient), last=0.0) for d in columns[1]]
        rest = [self._of(d, exposure, e, last=0.0) for d, e in zip(columns[0], columns[2], strict=True)]
        return torch.stack(by_exposure) + torch.stack(rest)

    def _seen(self, shared: Tensor, own: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Coefficients (1 or channel, K), exposure (image,) and ambient (image,)."""
        raw, exposure, ambient = self.unknowns.unpack(shared, own)
        return self.coefficients(raw), exposure, ambient

    def _of(self, coefficients: Tensor, exposure: Tensor, ambient: Tensor, *, last: float) -> Tensor:
        """Roots times (e c, a, last): (image, K + 2, channel)."""
        seen = exposure[:, None, None] * coefficients
        offset = ambient[:, None, None].expand(*seen.shape[:-1], 1)
        vector = torch.cat((seen, offset, torch.full_like(offset, last)), -1).to(self.roots.dtype)
        return torch.einsum("icrk,ick->irc", self.roots, vector.expand(-1, self.roots.shape[1], -1))


def gram(basis: Tensor, recorded: Tensor, used: Tensor) -> Tensor:
    """Sums over the used pixels of products of images, 1 and recorded values: (channel, K + 2, K + 2), float64.

    Args:
        basis: (pixel, 1 or channel, K).
        recorded, used: (pixel, channel).
    """
    alike = basis.shape[1] == 1 and torch.equal(used, used[:, :1].expand_as(used))
    channels = recorded.shape[1]
    if not alike:
        wide = basis.expand(-1, channels, -1)
        return torch.cat([gram(wide[:, [c]], recorded[:, [c]], used[:, [c]]) for c in range(channels)])
    terms = basis.shape[-1]
    sums = torch.zeros(terms + 1 + channels, terms + 1 + channels, dtype=torch.float64, device=basis.device)
    for images, values, kept in zip(*(k.split(_PIXELS_AT_A_TIME) for k in (basis[:, 0], recorded, used)), strict=True):
        columns = torch.cat((images.double(), torch.ones_like(values[:, :1], dtype=torch.float64), values.double()), 1)
        columns = columns * kept[:, :1]
        sums += columns.mT @ columns
    places = [[*range(terms + 1), terms + 1 + c] for c in range(channels)]
    return torch.stack([sums[place][:, place] for place in places])


def _root(matrix: Tensor) -> Tensor:
    """R (..., n, n) of a positive matrix R'R (..., n, n), without directions that are lost in the rounding of the sums.

    Kept, their rounding would be residuals that no step can lessen and that a perfect fit chases for ever.
    """
    if not matrix.isfinite().all():  # for the fit to say so
        return matrix
    diagonal = matrix.diagonal(dim1=-2, dim2=-1)
    size = torch.where(diagonal > 0, diagonal, 1.0).sqrt()
    values, vectors = torch.linalg.eigh(matrix / (size[..., :, None] * size[..., None, :]))
    rounding = (-values[..., :1]).clamp(
        min=matrix.shape[-1] * torch.finfo(matrix.dtype).eps
    )  # none is negative otherwise
    lost = values <= _ROUNDING * rounding
    return values.masked_fill(lost, 0.0).sqrt()[..., :, None] * vectors.mT * size[..., None, :]
