"""Which samples of photographs a fit may use."""

import math

import torch
from torch import Tensor
from torch.nn.functional import normalize

from inverse.scene import Scene, Sensor, pixel_average

# Photographs with fewer unsaturated samples than this share of the object are refused.
_LEAST_UNSATURATED = 0.5
# Noise widths from black and from full scale within which a sample may be clipped: beyond, 3 in 100 000 are.
_CLEAR = 4.0
# Standard deviation over median of the absolute deviation, of a normal distribution.
_NORMAL_OVER_MEDIAN = 1.4826


def usable(scene: Scene, *, limb: float = 70.0, highlight: float = 0.0, shadow: float = 80.0) -> Tensor:
    """Which pixels of which image to trust, (image, rows, columns) bool, from geometry and lights alone.

    A mask that followed the fit could improve it by turning the lights away from the object. Left out
    are points seen at more than `limb` from their normal, lit at more than `shadow` by any light of the
    image that has a direction, or with the normal within `highlight` of halfway between light and view. [deg]
    """
    limits = f"limb {limb}, highlight {highlight}, shadow {shadow}"
    if not all(0 <= k <= 90 for k in (limb, highlight, shadow)):
        raise ValueError(f"usable: the limits must lie in [0, 90] degrees; found {limits}.")
    least_view, most_half, least_light = (math.cos(math.radians(k)) for k in (limb, highlight, shadow))
    surface, normals, view = scene.surface, scene.surface.normals.double(), scene.surface.view.double()
    near = surface.mask & ((normals * view).sum(-1) >= least_view)
    images = []
    for lights in scene.lights:
        kept = near
        for light in (beam for k in lights for beam in k.beams()):
            direction = next(light.arrivals(surface.points.double())).direction
            dull = (normals * normalize(direction + view, dim=-1)).sum(-1) < most_half if highlight > 0 else True
            kept = kept & ((normals * direction).sum(-1) >= least_light) & dull
        images.append(pixel_average(kept[..., None].double(), surface.samples)[..., 0] == 1)
    if not torch.stack(images).any():
        raise ValueError(f"usable: no pixel is left with {limits} degrees.")
    return torch.stack(images)


def checked(scene: Scene, photographs: Tensor) -> Tensor:
    """The photographs, if they can be of this scene; TypeError or ValueError otherwise."""
    if not isinstance(photographs, Tensor) or not photographs.is_floating_point():
        kind = photographs.dtype if isinstance(photographs, Tensor) else type(photographs).__name__
        raise TypeError(f"photographs must be a floating-point torch.Tensor with full scale 1; found {kind}.")
    rows, columns = scene.surface.resolution
    if photographs.ndim != 4 or photographs.shape[:3] != (scene.images, rows, columns) or not photographs.shape[3]:
        raise ValueError(
            f"photographs must have shape (image, rows, columns, channel) = ({scene.images}, {rows}, {columns}, "
            f"channel), one image for each of the scene's {scene.images} sets of lights; "
            f"found {tuple(photographs.shape)}."
        )
    broken = ~photographs.isfinite()
    if broken.any():
        images = ", ".join(str(k) for k in broken.flatten(1).any(1).nonzero()[:, 0].tolist())
        raise ValueError(f"photographs must be finite; {int(broken.sum())} values are not, in image {images}.")
    return photographs


def usable_samples(scene: Scene, photographs: Tensor, valid: Tensor | None) -> Tensor:
    """Samples the fit uses (image, rows, columns): covered, allowed by `valid`, not saturated."""
    allowed = (scene.surface.coverage() == 1).expand(photographs.shape[:3])
    if valid is not None:
        if not isinstance(valid, Tensor):
            raise TypeError(f"valid must be a torch.Tensor; found {type(valid).__name__}.")
        if valid.shape != photographs.shape[:3] or valid.dtype != torch.bool:
            raise ValueError(
                f"valid must be bool of shape {tuple(photographs.shape[:3])}; found {valid.dtype} {tuple(valid.shape)}."
            )
        allowed = allowed & valid
    if not allowed.any():
        raise ValueError("no sample is left to fit: the mask, or its overlap with `valid`, is empty.")
    unsaturated = (photographs < 1).all(-1)
    for index, (image, candidates, good) in enumerate(zip(photographs, allowed, unsaturated, strict=True)):
        if not candidates.any():
            continue
        if not (image[candidates] > 0).any():
            raise ValueError(f"photograph {index} is all dark: no object pixel is above 0.")
        share = good[candidates].double().mean().item()
        if share < _LEAST_UNSATURATED:
            raise ValueError(
                f"photograph {index} is saturated: {1 - share:.0%} of the object's samples reach full scale 1."
            )
    return allowed & unsaturated


def clear_of_clipping(sensor: Sensor, recorded: Tensor, predicted: Tensor, used: Tensor) -> Tensor:
    """Which of the used samples lie too far from black and full scale for their noise to be cut off there.

    A cut-off noise has another mean and another width, by which ambient light, exposure and all errors come out
    wrong. The choice follows the predicted values: to leave out the samples that were recorded dark would keep those
    of the same pixels that noise has brightened. An end of the scale where no sample was recorded has cut nothing
    off, nor has black where samples lie below it.

    Args:
        sensor: whose noise it is; where it states none, the width is taken from the residuals.
        recorded, predicted, used: (image, pixel, channel); `used` bool.
    Returns: bool of that shape; `used` itself where no sample would be left.
    """
    dark, bright = (recorded == 0).any() and not (recorded < 0).any(), (recorded >= 1).any()
    if not (dark or bright):
        return used
    if sensor.noisy:
        width = sensor.variance(predicted).sqrt()
    else:
        residuals = (recorded - predicted)[used & (recorded > 0)]
        width = _NORMAL_OVER_MEDIAN * residuals.abs().median() if residuals.numel() else recorded.new_zeros(())
    if sensor.bits is not None:
        width = (width.square() + (1 / (2**sensor.bits - 1)) ** 2 / 12).sqrt()
    clear = used
    if dark:
        clear = clear & (predicted > _CLEAR * width)
    if bright:
        clear = clear & (predicted < 1 - _CLEAR * width)
    return clear if clear.any() else used
