"""What was photographed, and what is known of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from torch import Tensor

from inverse.footprints import Footprints, footprints
from inverse.geometry import Surface
from inverse.lights import Light
from inverse.sensor import Sensor


@dataclass(frozen=True, init=False)
class Scene:
    """A surface, one set of lights an image, and the camera that took the images.

    Attributes:
        surface: known geometry.
        lights: for each image its lights; on construction a single light may stand for a set of one.
        sensor: the fit uses its exposure and point-spread function.
        shadows: whether the solid hides lights from itself, where the surface knows its solid.
        between_parts: whether parts of the solid light each other.
        detail: pixels (rows, columns) that are shaded at all their points; see `footprints`. None: all.
    Raises: ValueError when there is no image; TypeError for a light outside a sequence.
    """

    surface: Surface
    lights: tuple[tuple[Light, ...], ...]
    sensor: Sensor
    shadows: bool
    between_parts: bool
    detail: Tensor | None

    def __init__(
        self,
        surface: Surface,
        lights: Sequence[Light | Sequence[Light]],
        sensor: Sensor | None = None,
        *,
        shadows: bool = True,
        between_parts: bool = False,
        detail: Tensor | None = None,
    ):
        if isinstance(lights, Light):
            raise TypeError("Scene.lights must be a sequence with one entry for each image; found a single light.")
        sets = tuple((entry,) if isinstance(entry, Light) else tuple(entry) for entry in lights)
        if not sets or not all(sets):
            raise ValueError("Scene.lights must hold at least one image and one light for each; found none.")
        values = {
            "surface": surface, "lights": sets, "sensor": sensor or Sensor(),
            "shadows": shadows, "between_parts": between_parts, "detail": detail,
        }  # fmt: skip
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def footprints(self) -> Footprints:
        """The points to shade, and the pixels they make up."""
        found, solid = footprints(self.surface, self.detail), self.surface.solid
        return replace(found, solid=solid if self.shadows else None, partner=solid if self.between_parts else None)

    @property
    def images(self) -> int:
        """Number of images."""
        return len(self.lights)
