"""The points at which an image is shaded, and how they make up its pixels."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from inverse.scene.surface import Surface, pixel_average
from inverse.shapes import Solid


@dataclass(frozen=True)
class Footprints:
    """Points of a surface in a row, each with its share of a pixel.

    Attributes:
        points, normals: (point, 3); normals are unit vectors.
        view: unit vectors to the camera, (3,) or (point, 3).
        pixel: number of the pixel each point belongs to, row by row (point,).
        weight: its share of that pixel (point,).
        resolution: rows and columns of the image.
        solid: what may hide lights from the points; None where nothing is known to.
        partner: what sends light on to the points; None where nothing is to.
    """

    points: Tensor
    normals: Tensor
    view: Tensor
    pixel: Tensor
    weight: Tensor
    resolution: tuple[int, int]
    solid: Solid | None
    partner: Solid | None = None

    def to_image(self, values: Tensor) -> Tensor:
        """Values (point, channel) as pixels (rows, columns, channel); 0 where no point lies.

        Raises ValueError for another number of points: a per-texel parameter of the wrong shape, mostly.
        """
        points = len(self.points)
        if values.ndim != 2 or values.shape[0] != points:
            raise ValueError(
                f"the radiance must be (point, channel) with {points} points; found {tuple(values.shape)}. "
                f"Per-texel albedo is ({points}, channel), per-texel sigma ({points},)."
            )
        rows, columns = self.resolution
        empty = values.new_zeros(rows * columns, values.shape[-1])
        return empty.index_add(0, self.pixel, values * self.weight[:, None]).reshape(rows, columns, -1)

    @classmethod
    def of(cls, surface: Surface, fully_sampled: Tensor | None = None) -> "Footprints":
        """The masked points of a surface, in row-major order.

        Args:
            fully_sampled: pixels (rows, columns) that need all their points. Of the others those that the object fills
                get one point instead, with the mean directions and the mean position, raised where that lies inside a
                bulge: exact to first order in the variation inside the pixel. None: all points everywhere.
        """
        rows, columns = surface.resolution
        s, mask = surface.samples, surface.mask
        if fully_sampled is None:
            return cls._of_points(surface, mask)
        if fully_sampled.shape != (rows, columns) or fully_sampled.dtype != torch.bool:
            got = f"{fully_sampled.dtype} {tuple(fully_sampled.shape)}"
            raise ValueError(f"fully_sampled must be bool of shape {(rows, columns)}; found {got}.")
        if s == 1:
            return cls._of_points(surface, mask)
        merged = ~fully_sampled & (surface.coverage() == 1)
        fine = cls._of_points(surface, mask & ~merged.repeat_interleave(s, 0).repeat_interleave(s, 1))
        upright = _unit(pixel_average(surface.normals, s)[merged])
        middle = pixel_average(surface.points, s)[merged]
        # the tangent planes of a bulge's points pass above it, and their mean below
        rise = ((_blocks(surface.points, s)[merged] - middle[:, None]) * _blocks(surface.normals, s)[merged]).sum(-1)
        middle = middle + rise.amax(-1, keepdim=True).clamp(min=0) * upright
        view = fine.view
        if surface.view.ndim > 1:
            view = torch.cat((view, _unit(pixel_average(surface.view, s)[merged])))
        whole = merged.flatten().nonzero()[:, 0]
        return replace(
            fine,
            points=torch.cat((fine.points, middle)),
            normals=torch.cat((fine.normals, upright)),
            view=view,
            pixel=torch.cat((fine.pixel, whole)),
            weight=torch.cat((fine.weight, fine.weight.new_ones(len(whole)))),
        )

    @classmethod
    def _of_points(cls, surface: Surface, mask: Tensor) -> "Footprints":
        """Those of a mask (rows, columns) of the surface's points, each an equal share of its pixel."""
        (rows, columns), s = surface.resolution, surface.samples
        at = mask.flatten().nonzero()[:, 0]  # gathers rows several times as fast as the mask does
        pixel = torch.arange(rows * columns, device=mask.device).reshape(rows, 1, columns, 1)
        points, normals, view = (
            k if k.ndim == 1 else k.reshape(-1, 3).index_select(0, at)
            for k in (surface.points, surface.normals, surface.view)
        )
        return cls(
            points,
            normals,
            view,
            pixel.expand(rows, s, columns, s).reshape(-1).index_select(0, at),
            normals.new_full((len(at),), 1 / s**2),
            (rows, columns),
            surface.solid,
        )


def _blocks(field: Tensor, samples: int) -> Tensor:
    """Values (rows, columns, 3) by pixel: (rows, columns, point, 3)."""
    return field.unflatten(1, (-1, samples)).unflatten(0, (-1, samples)).transpose(1, 2).flatten(2, 3)


def _unit(vectors: Tensor) -> Tensor:
    return vectors / vectors.norm(dim=-1, keepdim=True)
