"""What a scene could do without: simpler scenes, and the named effect each leaves out."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from inverse.scene import AMBIENT, MAP_DETAIL, NEAR_LIGHT, SOFTNESS, Light, Scene
from inverse.shapes import Absence
from inverse.transport import why_no_interreflection

CAST_SHADOWS = "cast shadows"
BETWEEN_PARTS = "light between parts"
PERSPECTIVE = "perspective view"
FOOTPRINT = "pixel footprint"

# Why an effect of lights is absent where no light offers to do without it.
_NOT_OFFERED = {
    NEAR_LIGHT: "every light is distant",
    SOFTNESS: "no source has an extent",
    MAP_DETAIL: "no environment, or none that can be halved",
    AMBIENT: "no ambient light, or no other",
}


@dataclass(frozen=True)
class SceneOption:
    """A way to simulate less of a scene.

    Attributes:
        effect: what is left out.
        absent: why there is nothing to leave out, or None.
        choice: what is simulated instead.
        apply: the scene without the effect.
    """

    effect: str
    absent: Absence | None
    choice: str
    apply: Callable[[Scene], Scene]


def everything(scene: Scene) -> Scene:
    """The scene with every effect it could have."""
    exchange = why_no_interreflection(scene.surface.solid) is None
    return replace(scene, shadows=True, between_parts=exchange, fully_sampled=None)


def scene_options(scene: Scene) -> Iterator[SceneOption]:
    """What may be left out of a scene, one row an effect, whether the scene has it or not."""
    surface = scene.surface
    reasons = [light.why_shadowless(surface.solid) for lights in scene.lights for light in lights]
    yield SceneOption(
        CAST_SHADOWS,
        reasons[0] if all(reasons) else None,
        "lit wherever the surface faces the light",
        lambda s: replace(s, shadows=False),
    )
    no_exchange = why_no_interreflection(surface.solid)
    yield SceneOption(BETWEEN_PARTS, no_exchange, "none", lambda s: replace(s, between_parts=False))
    orthographic = surface.view.ndim == 1
    view = surface.view if orthographic else surface.view[surface.mask].mean(0)
    yield SceneOption(
        PERSPECTIVE,
        Absence("the view is orthographic: one vector an image") if orthographic else None,
        "one view vector for the image",
        lambda s: replace(s, surface=replace(s.surface, view=view / view.norm())),
    )
    yield from _light_options(scene)
    yield SceneOption(
        FOOTPRINT,
        Absence("one sample a pixel") if surface.samples == 1 else None,
        "one sample where the radiance hardly varies inside a pixel",
        lambda s: replace(s, fully_sampled=torch.zeros(s.surface.resolution, dtype=torch.bool)),
    )


def _light_options(scene: Scene) -> Iterator[SceneOption]:
    """Effects that lights say they could do without, and the known ones that none of them has."""
    middle = scene.surface.points[scene.surface.mask].mean(0)
    offers = {k.effect: k.choice for lights in scene.lights for light in lights for k in light.simpler(middle)}
    for effect in dict.fromkeys((*_NOT_OFFERED, *offers)):

        def apply(s: Scene, effect: str = effect) -> Scene:
            return replace(s, lights=[_without(effect, lights, middle) for lights in s.lights])

        kept = all(_without(effect, lights, middle) is lights for lights in scene.lights)
        absent = Absence(_NOT_OFFERED.get(effect, "no light is left without it")) if kept else None
        yield SceneOption(effect, absent, offers.get(effect, ""), apply)


def _without(effect: str, lights: tuple[Light, ...], middle: Tensor) -> tuple[Light, ...]:
    """The lights of an image without an effect; the very same where none has it, or none would be left."""
    left: list[Light] = []
    for light in lights:
        stand_ins = [k.light for k in light.simpler(middle) if k.effect == effect] or [light]
        left += [k for k in stand_ins if k is not None]
    same = len(left) == len(lights) and all(one is other for one, other in zip(left, lights, strict=True))
    return lights if same or not left else tuple(left)
