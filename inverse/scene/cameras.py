"""A perspective camera: kornia's pinhole, in this package's frame."""

import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from inverse.scene.surface import TO_CAMERA, Surface, seen
from inverse.shapes import Solid

if TYPE_CHECKING:
    from kornia.geometry.camera import PinholeCamera


def pinhole(height: int, width: int, *, field_of_view: float = 30.0, distance: float | None = None) -> "PinholeCamera":
    """kornia's pinhole camera on the z axis, looking at the origin.

    Args:
        height, width: of the image. [pixel]
        field_of_view: angle between the directions to the upper and the lower edge of the image. [degree]
        distance: from the origin, in half image heights; by default y from -1 to 1 at z = 0 fills the image, as
            in the orthographic view.
    Returns: PinholeCamera of batch 1, float64. kornia's camera looks along its +z with y down; the extrinsics
        turn this package's frame (y up, z towards the camera) into that.
    Raises: ValueError outside these domains.
    """
    from kornia.geometry.camera import PinholeCamera  # deferred: kornia imports all of itself

    if not (isinstance(height, int) and isinstance(width, int) and height >= 1 and width >= 1):
        raise ValueError(f"height and width must be whole numbers of at least 1; found {height} and {width}.")
    if not 0 < field_of_view < 180:
        raise ValueError(f"field_of_view must lie in (0, 180) degrees; found {field_of_view}.")
    half = math.tan(math.radians(field_of_view) / 2)
    away = 1 / half if distance is None else distance
    if not 0 < away < math.inf:
        raise ValueError(f"distance must be positive and finite [half image heights]; found {distance}.")
    focal = height / 2 / half
    intrinsics = torch.eye(4, dtype=torch.float64)
    intrinsics[0, 0] = intrinsics[1, 1] = focal
    intrinsics[0, 2], intrinsics[1, 2] = (width - 1) / 2, (height - 1) / 2  # kornia: pixel centres are whole numbers
    extrinsics = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))
    extrinsics[2, 3] = away
    return PinholeCamera(intrinsics[None], extrinsics[None], torch.tensor([height]), torch.tensor([width]))


def perspective(
    solid: Solid, camera: "PinholeCamera", *, samples: int = 1, dtype: torch.dtype = torch.float32
) -> Surface:
    """A solid as a pinhole camera sees it: each pixel with its own view direction.

    Args:
        solid: in this package's frame, the world of the camera's extrinsics.
        camera: PinholeCamera of batch 1; `pinhole` makes one.
        samples: points per pixel side.
    Raises: ValueError for several cameras at once, or when no pixel shows the solid.
    """
    if camera.batch_size != 1:
        raise ValueError(f"perspective takes one camera; found a batch of {camera.batch_size}.")
    centre, direction = _rays(camera, samples)
    to_camera = direction.new_tensor(TO_CAMERA)
    surface = seen(solid, centre.expand(direction.shape), direction, -direction, samples=samples, dtype=dtype)
    # off the object the view is that along the axis, as the normal is
    surface.view[~surface.mask] = to_camera.to(dtype)
    return surface


def _rays(camera: "PinholeCamera", samples: int) -> tuple[Tensor, Tensor]:
    """The camera's centre (3,) and the unit directions (rows, columns, 3) of its sample points, float64."""
    from kornia.geometry.camera import PinholeCamera

    rows, columns = (
        (torch.arange(int(count) * samples, dtype=torch.float64) + 0.5) / samples - 0.5
        for count in (camera.height, camera.width)
    )
    v, u = torch.meshgrid(rows, columns, indexing="ij")
    pixels = torch.stack((u, v), -1)[None]
    double = PinholeCamera(camera.intrinsics.double(), camera.extrinsics.double(), camera.height, camera.width)
    ahead = double.unproject(pixels.flatten(1, 2), torch.ones_like(u).flatten()[None, :, None])[0]
    rotation, shift = double.rotation_matrix[0], double.translation_vector[0, :, 0]
    centre = -rotation.T @ shift
    away = (ahead - centre).reshape(*u.shape, 3)
    return centre, away / away.norm(dim=-1, keepdim=True)
