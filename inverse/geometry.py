"""Known geometry: surfaces as images of points, normals and view directions.

Frame, everywhere in this package: x to the right, y up, z towards the camera. An image of H rows
shows y from +1 (top) to -1 (bottom) and x in proportion. The view is orthographic unless a camera
matrix is given. Every surface may be sampled finer than its pixels: `samples` = s divides each
pixel into s x s points, which the shading averages.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from kornia.filters import spatial_gradient
from kornia.geometry.depth import depth_to_3d_v2, depth_to_normals
from scipy.interpolate import CubicSpline
from torch import Tensor
from torch.nn.functional import max_pool2d

TO_CAMERA = (0.0, 0.0, 1.0)
# Heights and radii of the default vase: foot, waist, belly, shoulder, neck, lip.
_VASE_HEIGHTS = (-0.92, -0.86, -0.78, -0.55, -0.20, 0.10, 0.36, 0.58, 0.74, 0.86, 0.92)
_VASE_RADII = (0.285, 0.300, 0.275, 0.420, 0.585, 0.565, 0.400, 0.225, 0.190, 0.245, 0.300)


@dataclass(frozen=True)
class Surface:
    """What each image point shows; arrays are `samples` times finer than the pixels.

    Attributes:
        points: positions (rows, columns, 3), in half image heights (pixels for normal maps).
        normals: unit vectors (rows, columns, 3); (0, 0, 1) off the object.
        mask: where the object is (rows, columns), bool.
        view: unit vectors to the camera, (3,) or (rows, columns, 3).
        samples: points per pixel side.
    """

    points: Tensor
    normals: Tensor
    mask: Tensor
    view: Tensor
    samples: int = 1

    def __post_init__(self):
        shape = self.mask.shape
        if self.mask.dtype != torch.bool or not isinstance(self.samples, int):
            raise TypeError(f"mask must be bool and samples a whole number; found {self.mask.dtype}, {self.samples!r}.")
        if self.normals.shape != (*shape, 3) or self.points.shape != (*shape, 3):
            raise ValueError(
                f"points and normals must be mask's shape {tuple(shape)} with a trailing 3; "
                f"found {tuple(self.points.shape)} and {tuple(self.normals.shape)}."
            )
        if self.samples < 1 or shape[0] % self.samples or shape[1] % self.samples:
            raise ValueError(f"samples must divide the array's {tuple(shape)} points; found {self.samples}.")
        if not self.mask.any():
            raise ValueError("the object's mask is empty: no pixel shows the object.")

    @property
    def resolution(self) -> tuple[int, int]:
        """Rows and columns of the image in pixels."""
        rows, columns = self.mask.shape
        return rows // self.samples, columns // self.samples

    def coverage(self) -> Tensor:
        """Share of each pixel that shows the object (rows, columns) of the image."""
        return pixel_average(self.mask.to(self.normals.dtype)[..., None], self.samples)[..., 0]


def pixel_average(image: Tensor, samples: int) -> Tensor:
    """Mean over the s x s points of each pixel: (..., s H, s W, channel) -> (..., H, W, channel)."""
    if samples == 1:
        return image
    rows, columns = image.shape[-3] // samples, image.shape[-2] // samples
    return image.unflatten(-3, (rows, samples)).unflatten(-2, (columns, samples)).mean((-4, -2))


def pixel_grid(height: int, width: int, *, samples: int = 1, dtype: torch.dtype = torch.float32):
    """x and y (s H, s W) of the sample points of an image of `height` rows."""
    if not all(isinstance(k, int) and k >= 1 for k in (height, width, samples)):
        raise ValueError(
            f"height, width and samples must be whole numbers of at least 1; found {height}, {width}, {samples}."
        )
    pitch = 2 / (height * samples)
    y = 1 - pitch * (torch.arange(height * samples, dtype=dtype) + 0.5)
    x = pitch * (torch.arange(width * samples, dtype=dtype) + 0.5) - width / height
    y, x = torch.meshgrid(y, x, indexing="ij")
    return x, y


def vase_profile() -> CubicSpline:
    """Radius of the default clay vase as a smooth function of height, defined on [-0.92, 0.92]."""
    return CubicSpline(_VASE_HEIGHTS, _VASE_RADII, extrapolate=False)


def vase(height: int = 512, width: int = 512, *, samples: int = 1, dtype: torch.dtype = torch.float32) -> Surface:
    """The default vase seen from the front."""
    profile = vase_profile()
    return revolution(profile, profile.derivative(), height, width, samples=samples, dtype=dtype)


def revolution(
    radius: Callable, slope: Callable, height: int, width: int, *, samples: int = 1, dtype: torch.dtype = torch.float32
) -> Surface:
    """Surface of revolution about the vertical axis, seen from the front.

    Args:
        radius: r(y) for a NumPy array of heights; NaN or 0 where there is no surface.
        slope: its derivative dr/dy.
        height, width: pixels of the image.
    From the front nothing hides anything: each height shows the near half of one circle.
    """
    x, y = pixel_grid(height, width, samples=samples, dtype=dtype)
    heights = y[:, :1].double().numpy()
    r = torch.as_tensor(radius(heights)).nan_to_num(0.0).to(dtype)
    dr = torch.as_tensor(slope(heights)).nan_to_num(0.0).to(dtype)
    mask = x.abs() < r
    z = (r * r - x * x).clamp(min=0).sqrt()
    # gradient of x^2 + z^2 - r(y)^2, up to the factor 2
    return _surface(torch.stack((x, y, z), -1), torch.stack((x, -r * dr + 0 * x, z), -1), mask, samples)


def sphere(
    height: int, width: int, *, radius: float = 0.9, centre: tuple[float, float] = (0.0, 0.0),
    samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Sphere of a radius and centre (x, y) in half image heights."""
    if not radius > 0:
        raise ValueError(f"sphere.radius must be positive; found {radius}.")
    x, y = pixel_grid(height, width, samples=samples, dtype=dtype)
    x, y = x - centre[0], y - centre[1]
    squared = radius * radius - x * x - y * y
    z = squared.clamp(min=0).sqrt()
    normals = torch.stack((x, y, z), -1)
    return _surface(normals + torch.tensor([*centre, 0.0], dtype=dtype), normals, squared > 0, samples)


def cylinder(
    height: int, width: int, *, radius: float = 0.6, half_height: float = 0.9,
    samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Upright cylinder seen from the side."""
    if not (radius > 0 and half_height > 0):
        raise ValueError(f"cylinder.radius and half_height must be positive; found {radius} and {half_height}.")
    x, y = pixel_grid(height, width, samples=samples, dtype=dtype)
    squared = radius * radius - x * x
    z = squared.clamp(min=0).sqrt()
    mask = (squared > 0) & (y.abs() < half_height)
    return _surface(torch.stack((x, y, z), -1), torch.stack((x, torch.zeros_like(x), z), -1), mask, samples)


def plane(
    height: int, width: int, *, normal: tuple[float, float, float] = TO_CAMERA,
    samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Plane through the origin that fills the image; `normal` must face the camera."""
    if not normal[2] > 0 or not all(math.isfinite(k) for k in normal):
        raise ValueError(f"the plane's normal must be finite and face the camera (z > 0); found {normal}.")
    x, y = pixel_grid(height, width, samples=samples, dtype=dtype)
    z = -(normal[0] * x + normal[1] * y) / normal[2]
    normals = torch.tensor(normal, dtype=dtype).expand(*x.shape, 3)
    return _surface(torch.stack((x, y, z), -1), normals, torch.ones_like(x, dtype=torch.bool), samples)


def from_normals(normals: Tensor, mask: Tensor | None = None) -> Surface:
    """Surface from a normal map (rows, columns, 3) in this package's frame; scaled to unit length.

    Without a mask, the object is where the vectors are finite and longer than 0.5. Positions are
    unknown, so z is 0: distant lights only.
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
    return _surface(points, normals, object_, 1)


def from_depth(depth: Tensor, camera_matrix: Tensor | None = None, mask: Tensor | None = None) -> Surface:
    """Surface from a depth map (rows, columns), growing away from the camera; normals by kornia.

    Args:
        depth: in pixel widths for the orthographic view; in any length with a camera matrix.
        camera_matrix: pinhole intrinsics (3, 3) in pixels, y down as in kornia; None is orthographic.
        mask: where the object is; without it, where depth is finite and positive.
    The rim, where a neighbour is missing, is left out of the mask: its normal would mix two surfaces.
    """
    if depth.ndim != 2:
        raise ValueError(f"depth must have shape (rows, columns); found {tuple(depth.shape)}.")
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
        return _surface(torch.cat((flat.points[..., :2], -filled[0, 0, :, :, None]), -1), normals, interior, 1)
    flip = depth.new_tensor([1.0, -1.0, -1.0])  # kornia: y down, z into the scene, normals away from the camera
    normals = -depth_to_normals(filled, camera_matrix[None].to(depth.dtype))[0].permute(1, 2, 0) * flip
    points = depth_to_3d_v2(filled[0], camera_matrix[None].to(depth.dtype))[0] * flip
    distance = points.norm(dim=-1, keepdim=True)
    view = torch.where(interior[..., None], -points / distance, depth.new_tensor(TO_CAMERA))
    return _surface(points, normals, interior, 1, view)


def _surface(points: Tensor, normals: Tensor, mask: Tensor, samples: int, view: Tensor | None = None) -> Surface:
    to_camera = normals.new_tensor(TO_CAMERA)
    length = normals.norm(dim=-1, keepdim=True)
    unit = torch.where(mask[..., None], normals / length, to_camera)
    return Surface(points, unit, mask, to_camera if view is None else view, samples)
