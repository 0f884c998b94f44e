"""Known geometry: surfaces as images of points, normals and view directions.

Frame, everywhere in this package: x to the right, y up, z towards the camera. An image of H rows
shows y from +1 (top) to -1 (bottom) and x in proportion. The view is orthographic here; `inverse.scene.cameras`
holds the pinhole. Every surface may be sampled finer than its pixels: `samples` = s divides each
pixel into s x s points, which the shading averages.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import torch
from torch import Tensor
from torch.nn.functional import normalize

from inverse.shapes import Cuboid, Cylinder, Plane, Revolution, Solid, Sphere

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

TO_CAMERA = (0.0, 0.0, 1.0)
# Heights and radii of the default vase: foot, waist, belly, shoulder, neck, lip.
_VASE_HEIGHTS = (-0.92, -0.86, -0.78, -0.55, -0.20, 0.10, 0.36, 0.58, 0.74, 0.86, 0.92)
_VASE_RADII = (0.285, 0.300, 0.275, 0.420, 0.585, 0.565, 0.400, 0.225, 0.190, 0.245, 0.300)

# Heights at which the ends of a given profile are looked for.
_PROFILE_HEIGHTS = 4097
# Distance of the plane from which parallel rays start, in half image heights: in front of every solid.
_IN_FRONT = 1e3


@dataclass(frozen=True)
class Surface:
    """What each image point shows; arrays are `samples` times finer than the pixels.

    Attributes:
        points: positions (rows, columns, 3), in half image heights (pixels for normal maps).
        normals: unit vectors (rows, columns, 3); (0, 0, 1) off the object.
        mask: where the object is (rows, columns), bool.
        view: unit vectors to the camera, (3,) or (rows, columns, 3).
        samples: points per pixel side.
        solid: the body seen, which may hide lights from itself; None where only the image's side is known.
    """

    points: Tensor
    normals: Tensor
    mask: Tensor
    view: Tensor
    samples: int = 1
    solid: Solid | None = None

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

    def to(self, dtype: torch.dtype) -> "Surface":
        """The same with points, normals and view directions in another dtype; unit vectors are unit in that one."""
        if dtype == self.normals.dtype:
            return self
        normals, view = (normalize(k.to(dtype), dim=-1) for k in (self.normals, self.view))
        return replace(self, points=self.points.to(dtype), normals=normals, view=view)

    def coverage(self) -> Tensor:
        """Share of each pixel that shows the object (rows, columns) of the image."""
        return pixel_average(self.mask.to(self.normals.dtype)[..., None], self.samples)[..., 0]

    def spread_of_normals(self) -> Tensor:
        """How much the normals inside each pixel differ: 1 less the length of their mean (rows, columns)."""
        return 1 - pixel_average(self.normals, self.samples).norm(dim=-1)


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


def vase_profile() -> "CubicSpline":
    """Radius of the default clay vase as a smooth function of height, defined on [-0.92, 0.92]."""
    from scipy.interpolate import CubicSpline  # deferred: half a second

    return CubicSpline(_VASE_HEIGHTS, _VASE_RADII, extrapolate=False)


def vase(height: int = 512, width: int = 512, *, samples: int = 1, dtype: torch.dtype = torch.float32) -> Surface:
    """The default vase seen from the front."""
    return _front_of(_vase_solid(), height, width, samples, dtype)


@lru_cache(maxsize=1)
def _vase_solid() -> Revolution:
    """One for all images: what is remembered of a solid, such as the light between its parts, is found again."""
    profile = vase_profile()
    return Revolution(profile, profile.derivative(), _VASE_HEIGHTS[0], _VASE_HEIGHTS[-1])


def revolution(
    radius: Callable, slope: Callable, height: int, width: int, *, samples: int = 1, dtype: torch.dtype = torch.float32
) -> Surface:
    """Surface of revolution about the vertical axis, seen from the front.

    Args:
        radius: r(y) for a NumPy array of heights; NaN or 0 where there is no surface, positive over one
            interval of heights.
        slope: its derivative dr/dy.
        height, width: pixels of the image.
    From the front nothing hides anything: each height shows the near half of one circle.
    """
    heights = torch.linspace(-1, 1, _PROFILE_HEIGHTS, dtype=torch.float64)
    present = heights[torch.as_tensor(radius(heights.numpy())).nan_to_num(0.0) > 0]
    if not len(present):
        raise ValueError("revolution.radius must be positive for some height in [-1, 1]; it nowhere is.")
    solid = Revolution(radius, slope, float(present[0]), float(present[-1]))
    return _front_of(solid, height, width, samples, dtype)


def _front_of(solid: Revolution, height: int, width: int, samples: int, dtype: torch.dtype) -> Surface:
    """What `orthographic` shows, row by row in closed form."""
    x, y = pixel_grid(height, width, samples=samples, dtype=dtype)
    heights = y[:, :1].double().numpy()
    r = torch.as_tensor(solid.radius(heights)).nan_to_num(0.0).to(dtype)
    dr = torch.as_tensor(solid.slope(heights)).nan_to_num(0.0).to(dtype)
    mask = x.abs() < r
    z = (r * r - x * x).clamp(min=0).sqrt()
    # gradient of x^2 + z^2 - r(y)^2, up to the factor 2
    gradient = torch.stack((x, -r * dr + 0 * x, z), -1)
    return unit_surface(torch.stack((x, y, z), -1), gradient, mask, samples=samples, solid=solid)


def sphere(
    height: int, width: int, *, radius: float = 0.9, centre: tuple[float, float] = (0.0, 0.0),
    samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Sphere of a radius and centre (x, y) in half image heights."""
    return orthographic(Sphere(radius, (*centre, 0.0)), height, width, samples=samples, dtype=dtype)


def cylinder(
    height: int, width: int, *, radius: float = 0.6, half_height: float = 0.9,
    samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Upright cylinder seen from the side."""
    return orthographic(Cylinder(radius, half_height), height, width, samples=samples, dtype=dtype)


def plane(
    height: int, width: int, *, normal: tuple[float, float, float] = TO_CAMERA,
    samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Plane through the origin that fills the image; `normal` must face the camera."""
    if not normal[2] > 0 or not all(math.isfinite(k) for k in normal):
        raise ValueError(f"the plane's normal must be finite and face the camera (z > 0); found {normal}.")
    return orthographic(Plane(normal), height, width, samples=samples, dtype=dtype)


def cuboid(
    height: int, width: int, *, half_sizes: tuple[float, float, float] = (0.5, 0.5, 0.5),
    yaw: float = 30.0, pitch: float = 0.0, samples: int = 1, dtype: torch.dtype = torch.float32,
) -> Surface:  # fmt: skip
    """Box centred in the image, in half image heights, turned by yaw about y and then pitch about x. [degree]"""
    return orthographic(Cuboid(half_sizes, yaw, pitch), height, width, samples=samples, dtype=dtype)


def orthographic(
    solid: Solid, height: int, width: int, *, samples: int = 1, dtype: torch.dtype = torch.float32
) -> Surface:
    """A solid as a camera at infinity sees it: rays parallel to -z, y from +1 (top) to -1 (bottom)."""
    x, y = pixel_grid(height, width, samples=samples, dtype=torch.float64)
    to_camera = x.new_tensor(TO_CAMERA)
    origin = torch.stack((x, y, torch.full_like(x, _IN_FRONT)), -1)
    # once more from nearby: the distance from afar has lost three digits
    away = solid.hit(origin, -to_camera.expand(origin.shape)) - 1
    origin = origin - away.masked_fill(~away.isfinite(), 0.0)[..., None] * to_camera
    return seen(solid, origin, -to_camera, to_camera, samples=samples, dtype=dtype)


def seen(solid: Solid, origin: Tensor, direction: Tensor, view: Tensor, *, samples: int, dtype: torch.dtype) -> Surface:
    """What rays from `origin` (rows, columns, 3) along unit `direction` meet of a solid; `view` as in Surface."""
    distance, normals = solid.meet(origin, direction.expand(origin.shape))
    mask = distance.isfinite()
    reached = origin + distance.masked_fill(~mask, 0.0)[..., None] * direction
    points = torch.where(mask[..., None], reached, origin * origin.new_tensor((1.0, 1.0, 0.0)))
    return unit_surface(points.to(dtype), normals.to(dtype), mask, view=view.to(dtype), samples=samples, solid=solid)


def unit_surface(
    points: Tensor, normals: Tensor, mask: Tensor, *,
    view: Tensor | None = None, samples: int = 1, solid: Solid | None = None,
) -> Surface:  # fmt: skip
    """Surface of normals (rows, columns, 3) of any length; the view is orthographic if not given."""
    to_camera = normals.new_tensor(TO_CAMERA)
    length = normals.norm(dim=-1, keepdim=True)
    unit = torch.where(mask[..., None], normals / length, to_camera)
    return Surface(points, unit, mask, to_camera if view is None else view, samples, solid)


def side_by_side(surfaces: list[Surface]) -> Surface:
    """Objects in neighbouring windows of one image, left to right; all of one height and sampling.

    Each window is a scene of its own: nothing in one shadows another.
    """
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
