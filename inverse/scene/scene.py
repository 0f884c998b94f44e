"""What was photographed, and what is known of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from torch import Tensor

from inverse.scene.footprints import Footprints
from inverse.scene.lights import Light
from inverse.scene.sensor import Sensor
from inverse.scene.surface import Surface


@dataclass(frozen=True, init=False)
class Scene:
    """A surface, one set of lights an image, and the camera that took the images.

    Attributes:
        surface: known geometry.
        lights: for each image its lights; on construction a single light may stand for a set of one.
        sensor: the fit uses its exposure and point-spread function.
        shadows: whether the solid hides lights from itself, where the surface knows its solid.
        between_parts: whether parts of the solid light each other.
        fully_sampled: pixels (rows, columns) that are shaded at all their points; see `Footprints.of`. None: all.
    Raises: ValueError when there is no image; TypeError for a light outside a sequence.
    """

    surface: Surface
    lights: tuple[tuple[Light, ...], ...]
    sensor: Sensor
    shadows: bool
    between_parts: bool
    fully_sampled: Tensor | None

    def __init__(
        self,
        surface: Surface,
        lights: Sequence[Light | Sequence[Light]],
        sensor: Sensor | None = None,
        *,
        shadows: bool = True,
        between_parts: bool = False,
        fully_sampled: Tensor | None = None,
    ):
        if isinstance(lights, Light):
            raise TypeError("Scene.lights must be a sequence with one entry for each image; found a single light.")
        sets = tuple((entry,) if isinstance(entry, Light) else tuple(entry) for entry in lights)
        if not sets or not all(sets):
            raise ValueError("Scene.lights must hold at least one image and one light for each; found none.")
        values = {
            "surface": surface, "lights": sets, "sensor": sensor or Sensor(),
            "shadows": shadows, "between_parts": between_parts, "fully_sampled": fully_sampled,
        }  # fmt: skip
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def footprints(self) -> Footprints:
        """The points to shade, and the pixels they make up."""
        points, solid = Footprints.of(self.surface, self.fully_sampled), self.surface.solid
        return replace(points, solid=solid if self.shadows else None, partner=solid if self.between_parts else None)

    def beams(self) -> list[Light]:
        """The lights whose shadows have an edge, all images together."""
        return [beam for lights in self.lights for light in lights for beam in light.beams()]

    @property
    def images(self) -> int:
        """Number of images."""
        return len(self.lights)
