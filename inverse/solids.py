"""Flat-faced objects, and several objects in one image."""

import math

import torch
from torch import Tensor

from inverse.geometry import TO_CAMERA, Surface, pixel_grid


def cuboid(
    height: int, width: int, *, half_sizes: tuple[float, float, float] = (0.5, 0.5, 0.5),
    yaw: float = 30.0, pitch: float = 0.0, samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Box centred in the image, in half image heights, turned by yaw about y and then pitch about x. [degree]

    Positive yaw turns its front to the right; positive pitch tips its top towards the camera.
    """
    if not all(size > 0 for size in half_sizes):
        raise ValueError(f"cuboid.half_sizes must be positive; found {half_sizes}.")
    x, y = pixel_grid(height, width, samples=samples, dtype=dtype)
    turn = _rotation(yaw, pitch, dtype)  # columns: the box's axes in the image frame
    start = torch.stack((x, y, torch.zeros_like(x)), -1) @ turn
    along = turn[2].expand_as(start)  # the line of sight, upwards to the camera, in the box's axes
    sizes = torch.tensor(half_sizes, dtype=dtype)
    # each pair of faces is left, going towards the camera, at this height; parallel faces never are
    parallel = along == 0
    leave = (along.sign() * sizes - start) / along.masked_fill(parallel, 1.0)
    enter = (-along.sign() * sizes - start) / along.masked_fill(parallel, 1.0)
    inside = start.abs() < sizes
    leave = torch.where(parallel, torch.where(inside, torch.inf, -torch.inf), leave)
    enter = torch.where(parallel, torch.where(inside, -torch.inf, torch.inf), enter)
    z, face = leave.min(-1)
    mask = z > enter.amax(-1)
    outward = torch.nn.functional.one_hot(face, 3).to(dtype) * along.sign()
    normals = torch.where(mask[..., None], outward @ turn.T, x.new_tensor(TO_CAMERA))
    points = torch.stack((x, y, torch.where(mask, z, torch.zeros_like(z))), -1)
    return Surface(points, normals, mask, x.new_tensor(TO_CAMERA), samples)


def side_by_side(surfaces: list[Surface]) -> Surface:
    """Objects in neighbouring windows of one image, left to right; all of one height and sampling."""
    heights = {surface.mask.shape[0] for surface in surfaces}
    samplings = {surface.samples for surface in surfaces}
    if len(heights) != 1 or len(samplings) != 1 or any(surface.view.ndim > 1 for surface in surfaces):
        raise ValueError(
            f"side_by_side needs orthographic surfaces of one height and sampling; found heights {sorted(heights)} "
            f"and samples {sorted(samplings)}."
        )
    pitch = 2 / heights.pop()
    total = sum(surface.mask.shape[1] for surface in surfaces)
    points, left = [], 0
    for surface in surfaces:
        middle = pitch * (left + surface.mask.shape[1] / 2 - total / 2)
        points.append(surface.points + surface.points.new_tensor((middle, 0.0, 0.0)))
        left += surface.mask.shape[1]
    return Surface(
        torch.cat(points, 1),
        torch.cat([surface.normals for surface in surfaces], 1),
        torch.cat([surface.mask for surface in surfaces], 1),
        surfaces[0].view,
        samplings.pop(),
    )


def _rotation(yaw: float, pitch: float, dtype: torch.dtype) -> Tensor:
    a, b = math.radians(yaw), math.radians(pitch)
    about_y = torch.tensor(
        [[math.cos(a), 0.0, math.sin(a)], [0.0, 1.0, 0.0], [-math.sin(a), 0.0, math.cos(a)]], dtype=dtype
    )
    about_x = torch.tensor(
        [[1.0, 0.0, 0.0], [0.0, math.cos(b), -math.sin(b)], [0.0, math.sin(b), math.cos(b)]], dtype=dtype
    )
    return about_x @ about_y
