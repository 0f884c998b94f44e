"""The unknowns of a fit as vectors: shared ones, and those with a value for every pixel."""

from dataclasses import dataclass

import torch
from torch import Tensor

from torchbrdf import BRDF, Interval, Simplex, trainable

_EXPOSURE = Interval(0.0, torch.inf)


@dataclass(frozen=True)
class Unknown:
    """One trained parameter of the model, or a nuisance of the photographs.

    `first` is the number of its first entry, as its labels count.
    """

    name: str
    raw_name: str
    domain: Interval | Simplex | None
    start: Tensor
    per_texel: bool
    first: int = 0

    def physical(self, raw: Tensor) -> Tensor:
        """Value in its own unit from the unconstrained coordinate."""
        return raw if self.domain is None else self.domain.from_raw(raw)

    def slope(self, raw: Tensor) -> Tensor:
        """d physical / d raw."""
        return torch.func.jvp(self.physical, (raw,), (torch.ones_like(raw),))[1]

    def physical_error(self, raw: Tensor, raw_error: Tensor) -> Tensor:
        """Error of the value from that of its coordinate; infinite where it exceeds what the domain allows."""
        error = self.slope(raw) * raw_error.to(raw.dtype)
        if self.domain is None:
            return error
        # where only the square is told from 0, an error larger than the value has no symmetric meaning
        largest = self.physical(raw) - self.domain.low if self.domain.even else self.domain.high - self.domain.low
        return error.masked_fill(~(error <= largest), torch.inf)

    def shared_error(self, raw: Tensor, covariance: Tensor) -> Tensor:
        """Error of each entry of a shared value from the covariance of its coordinates."""
        if not isinstance(self.domain, Simplex):
            return self.physical_error(raw, covariance.diagonal().sqrt())
        slopes = torch.func.jacfwd(self.physical)(raw).to(covariance.dtype)  # shares depend on all coordinates
        return torch.einsum("ij,jk,ik->i", slopes, covariance, slopes).sqrt().to(raw.dtype)

    def labels(self) -> list[str]:
        """A name for each entry of a shared unknown."""
        if self.start.numel() == 1:
            return [self.name]
        return [f"{self.name}[{self.first + k}]" for k in range(self.start.numel())]


class Unknowns:
    """Packs the raw values into `shared` (G,) and `own` (P, L), and back.

    Args:
        model: whose trainable parameters are fitted.
        texels: for each used pixel, its position among the masked points (P,).
        points: number of masked points; a per-texel parameter has one entry for each.
        images: number of images; exposure is relative to the first image's.
    """

    def __init__(
        self, model: BRDF, texels: Tensor, points: int, images: int, *, free_exposure: bool, free_ambient: bool
    ):
        raw = dict(model.named_parameters())
        self.entries = []
        for name, (raw_name, domain) in trainable(model).items():
            start = raw[raw_name].detach()
            per_texel = start.ndim > domain.trailing
            if per_texel and (start.ndim != domain.trailing + 1 or start.shape[0] != points):
                wanted = f"({points}, channel)" if domain.trailing else f"({points},)"
                raise ValueError(
                    f"{name} must be per texel {wanted}, one for each of the {points} masked points, or shared; "
                    f"found shape {tuple(start.shape)}."
                )
            if per_texel and isinstance(domain, Simplex):
                raise ValueError(f"{name} cannot be fitted per texel: its shares are not independent.")
            self.entries.append(Unknown(name, raw_name, domain, start, per_texel))
        known = {entry.raw_name for entry in self.entries}
        strangers = [name for name, p in model.named_parameters() if p.requires_grad and name not in known]
        if strangers:
            raise ValueError(
                f"{type(model).__name__} has trainable parameters outside its table: {', '.join(strangers)}. "
                "Declare them as Constrained in the class body, or hold them with requires_grad_(False)."
            )
        blank = texels.new_zeros(images, dtype=self.entries[0].start.dtype if self.entries else torch.float32)
        taken = {entry.name for entry in self.entries}
        self.exposure = self.ambient = None
        if free_exposure and images > 1:
            self.exposure = Unknown(_free_name("exposure", taken), "", _EXPOSURE, blank[1:], False, first=1)
        if free_ambient:
            self.ambient = Unknown(_free_name("ambient", taken), "", None, blank, False)
        self.nuisances = tuple(entry for entry in (self.exposure, self.ambient) if entry is not None)
        self.entries += self.nuisances
        if not any(entry.start.numel() for entry in self.entries):
            raise ValueError(f"{type(model).__name__} has nothing to fit: every parameter is fixed.")
        self.blank, self.texels = blank, texels
        self.shared_entries = [entry for entry in self.entries if not entry.per_texel]
        self.own_entries = [entry for entry in self.entries if entry.per_texel]

    def pack(self) -> tuple[Tensor, Tensor]:
        """Start values: shared (G,) and own (P, L)."""
        shared = [entry.start.flatten() for entry in self.shared_entries]
        own = [entry.start[self.texels].flatten(1) if entry.start.ndim > 1 else entry.start[self.texels, None]
               for entry in self.own_entries]  # fmt: skip
        return (
            torch.cat(shared) if shared else self.blank.new_zeros(0),
            torch.cat(own, 1) if own else self.blank.new_zeros(len(self.texels), 0),
        )

    def unpack(self, shared: Tensor, own: Tensor) -> tuple[dict[str, Tensor], Tensor, Tensor]:
        """Raw parameters of the model by name, exposure (image,) relative to the first, ambient (image,)."""
        raw: dict[str, Tensor] = {}
        exposure, ambient = torch.ones_like(self.blank), self.blank
        for entry, value in self.split_shared(shared):
            if entry is self.exposure:
                exposure = torch.cat((torch.ones_like(value[:1].sum(0, keepdim=True)), entry.physical(value)))
            elif entry is self.ambient:
                ambient = value
            else:
                raw[entry.raw_name] = value.reshape(entry.start.shape)
        for entry, value in self.split_own(own):
            raw[entry.raw_name] = entry.start.index_copy(0, self.texels, value.reshape(-1, *entry.start.shape[1:]))
        return raw, exposure, ambient

    def split_shared(self, shared: Tensor) -> list[tuple[Unknown, Tensor]]:
        """The piece of a shared vector (G,) that belongs to each shared unknown."""
        pieces = shared.split([entry.start.numel() for entry in self.shared_entries]) if self.shared_entries else []
        return list(zip(self.shared_entries, pieces, strict=True))

    def split_own(self, own: Tensor) -> list[tuple[Unknown, Tensor]]:
        """The columns of an own matrix (P, L) that belong to each per-texel unknown."""
        widths = [entry.start[0].numel() for entry in self.own_entries]
        return list(zip(self.own_entries, own.split(widths, 1) if widths else [], strict=True))

    def shared_labels(self) -> list[str]:
        """Names of the entries of the shared vector; exposures count from the second image."""
        return [label for entry in self.shared_entries for label in entry.labels()]


def _free_name(name: str, taken: set[str]) -> str:
    """A nuisance's name, or a longer one that no attribute of a model can bear."""
    return f"image {name}" if name in taken else name


def shared_parameters(model: BRDF) -> list[str]:
    """Names of the trained parameters that all points share."""
    raw = dict(model.named_parameters())
    return [name for name, (raw_name, domain) in trainable(model).items() if raw[raw_name].ndim <= domain.trailing]
