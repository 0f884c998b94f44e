"""Surfaces from what others measured: normal maps and depth maps."""

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from inverse.scene.surface import TO_CAMERA, Surface, unit_surface
from inverse.shapes import HeightField


def from_normals(normals: Tensor, mask: Tensor | None = None) -> Surface:
    """Surface from a normal map (rows, columns, 3) in this package's frame; scaled to unit length.

    Without a mask, the object is where the vectors are finite and longer than 0.5. Positions along the
    line of sight are unknown and therefore NaN: lights at a finite distance are refused.
    """
    if normals.ndim != 3 or normals.shape[-1] != 3 or not normals.is_floating_point():
        raise ValueError(
            f"normals must be floating-point of shape (rows, columns, 3); found {normals.dtype} {tuple(normals.shape)}."
        )
    if mask is not None and mask.shape != normals.shape[:2]:
        raise ValueError(f"mask must have the normals' shape {tuple(normals.shape[:2])}; found {tuple(mask.shape)}.")
    length = normals.norm(dim=-1)
    object_ = length > 0.5 if mask is None else mask.bool()
    usable = length.isfinite() & (length > 0)
    if (object_ & ~usable).any():
        raise ValueError(f"normals must be finite and non-zero on the object; {(object_ & ~usable).sum()} are not.")
    rows, columns = object_.shape
    y, x = torch.meshgrid(-torch.arange(rows), torch.arange(columns), indexing="ij")
    points = torch.stack((x, y, torch.zeros_like(x)), -1).to(normals.dtype)
    points[..., 2] = torch.nan
    return unit_surface(points, normals, object_)


def from_depth(depth: Tensor, camera_matrix: Tensor | None = None, mask: Tensor | None = None) -> Surface:
    """Surface from a depth map (rows, columns), growing away from the camera; normals by kornia.

    Args:
        depth: in pixel widths for the orthographic view; in any length with a camera matrix.
        camera_matrix: pinhole intrinsics (3, 3) in pixels, y down as in kornia; None is orthographic.
        mask: where the object is; without it, where depth is finite and positive.
    The rim, where a neighbour is missing, is left out of the mask: its normal would mix two surfaces. The
    orthographic surface knows its solid, the visible relief; the perspective one does not, so that nothing is
    known of the shadows on it.
    """
    if depth.ndim != 2:
        raise ValueError(f"depth must have shape (rows, columns); found {tuple(depth.shape)}.")
    from kornia.filters import spatial_gradient  # deferred: kornia imports all of itself
    from kornia.geometry.depth import depth_to_3d_v2, depth_to_normals

    object_ = (depth.isfinite() & (depth > 0)) if mask is None else mask.bool() & depth.isfinite()
    filled = torch.where(object_, depth, torch.zeros_like(depth))[None, None]
    outside = (~object_).to(depth.dtype)[None, None]
    interior = max_pool2d(outside, 3, stride=1, padding=1)[0, 0] == 0
    interior[[0, -1]] = False
    interior[:, [0, -1]] = False
    if camera_matrix is None:
        gradient = spatial_gradient(filled, mode="diff", order=1, normalized=True)[0, 0]
        # rows run downwards, so d(depth)/dy = -gradient[1]; z = -depth
        normals = torch.stack((gradient[0], -gradient[1], torch.ones_like(depth)), -1)
        flat = from_normals(normals, interior)
        points = torch.cat((flat.points[..., :2], -filled[0, 0, :, :, None]), -1)
        relief = HeightField(torch.where(object_, -depth, torch.nan))
        return unit_surface(points, normals, interior, solid=relief)
    flip = depth.new_tensor([1.0, -1.0, -1.0])  # kornia: y down, z into the scene, normals away from the camera
    normals = -depth_to_normals(filled, camera_matrix[None].to(depth.dtype))[0].permute(1, 2, 0) * flip
    points = depth_to_3d_v2(filled[0], camera_matrix[None].to(depth.dtype))[0] * flip
    distance = points.norm(dim=-1, keepdim=True)
    view = torch.where(interior[..., None], -points / distance, depth.new_tensor(TO_CAMERA))
    return unit_surface(points, normals, interior, view=view)
