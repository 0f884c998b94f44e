"""From radiance to photograph: focus, exposure, noise, quantisation, clipping."""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class Sensor:
    """A linear camera whose full scale is 1.

    Attributes:
        exposure: digital value per unit radiance.
        psf_sigma: standard deviation of the Gaussian point-spread function. [pixel]
        read_noise: standard deviation of the signal-independent noise. [full scale]
        full_well: electrons at full scale, for shot noise of variance signal/full_well; None is none.
        bits: of the quantiser; None leaves values continuous.
    """

    exposure: float = 1.0
    psf_sigma: float = 0.0
    read_noise: float = 0.0
    full_well: float | None = None
    bits: int | None = None

    def __post_init__(self):
        rules = (
            ("exposure", "must be positive and finite", 0 < self.exposure < float("inf")),
            ("psf_sigma", "must not be negative [pixel]", self.psf_sigma >= 0),
            ("read_noise", "must not be negative [full scale]", self.read_noise >= 0),
            ("full_well", "must be positive [electrons]", self.full_well is None or self.full_well > 0),
            ("bits", "must be 1 to 32", self.bits is None or 1 <= self.bits <= 32),
        )
        for name, rule, kept in rules:
            if not kept:
                raise ValueError(f"Sensor.{name} {rule}; found {getattr(self, name)}.")

    @property
    def noisy(self) -> bool:
        """Whether it states any noise but that of rounding."""
        return self.read_noise > 0 or self.full_well is not None

    def variance(self, signal: Tensor) -> Tensor:
        """Of the noise at noiseless digital values, in their shape; rounding left out. [full scale^2]"""
        variance = torch.full_like(signal, self.read_noise**2)
        return variance if self.full_well is None else variance + signal.clamp(min=0) / self.full_well

    def focus(self, image: Tensor) -> Tensor:
        """Blur images (..., rows, columns, channel) by the point-spread function; borders reflect."""
        if self.psf_sigma == 0:
            return image
        from kornia.filters import gaussian_blur2d  # deferred: kornia imports all of itself

        size = 2 * int(4 * self.psf_sigma + 1) + 1  # 4 sigma on each side holds 99.99 %
        stack = image.flatten(0, -4) if image.ndim > 3 else image[None]
        blurred = gaussian_blur2d(stack.movedim(-1, 1), size, (self.psf_sigma, self.psf_sigma))
        return blurred.movedim(1, -1).reshape(image.shape)

    def expose(self, radiance: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Photographs in [0, 1] from radiance (..., rows, columns, channel).

        Differentiable: focus, exposure and noise exactly (the drawn noise is held), clipping by zero
        gradient outside [0, 1], quantisation as if it were not there.

        Args:
            generator: source of the noise; required where there is any, so that results repeat.
        """
        signal = self.focus(radiance) * self.exposure
        variance = self.variance(signal)
        if self.noisy:
            if generator is None:
                raise ValueError("a noisy Sensor needs a torch.Generator: pass generator=torch.Generator().")
            noise = torch.randn(signal.shape, generator=generator, dtype=signal.dtype, device=generator.device)
            # where nothing arrives there is no noise, and the root has no slope
            noisy = variance > 0
            signal = signal + noise * variance.masked_fill(~noisy, 1.0).sqrt().masked_fill(~noisy, 0.0)
        clipped = signal.clamp(0, 1)
        if self.bits is None:
            return clipped
        levels = 2**self.bits - 1
        return clipped + ((clipped * levels).round() / levels - clipped).detach()
