"""What a scene could do without: simpler scenes, and the named effect each leaves out."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from inverse.lights import Ambient, Disc, Distant, Environment, Light, Point
from inverse.radiosity import no_interreflection
from inverse.scene import Scene
from inverse.visibility import shadowless

CAST_SHADOWS = "cast shadows"
BETWEEN_PARTS = "light between parts"
NEAR_LIGHT = "distance fall-off"
PERSPECTIVE = "perspective view"
SOFTNESS = "extent of the source"
MAP_DETAIL = "detail of the environment"
AMBIENT = "ambient light"
FOOTPRINT = "pixel footprint"
SCENE_EFFECTS = (CAST_SHADOWS, BETWEEN_PARTS, NEAR_LIGHT, PERSPECTIVE, SOFTNESS, MAP_DETAIL, AMBIENT, FOOTPRINT)


@dataclass(frozen=True)
class Simpler:
    """A way to simulate less of a scene.

    Attributes:
        effect: what is left out.
        absent: why there is nothing to leave out, or None.
        choice: what is simulated instead.
        apply: the scene without the effect.
    """

    effect: str
    absent: str | None
    choice: str
    apply: Callable[[Scene], Scene]


def everything(scene: Scene) -> Scene:
    """The scene with every effect it could have."""
    return replace(scene, shadows=True, between_parts=no_interreflection(scene.surface.solid) is None, detail=None)


def simpler(scene: Scene) -> Iterator[Simpler]:
    """What may be left out of a scene, one row an effect, whether the scene has it or not."""
    lights = [light for entry in scene.lights for light in entry]
    surface = scene.surface
    reasons = [shadowless(surface.solid, light) for light in lights]
    yield Simpler(
        CAST_SHADOWS,
        reasons[0] if all(reasons) else None,
        "lit wherever the surface faces the light",
        lambda s: replace(s, shadows=False),
    )
    yield Simpler(BETWEEN_PARTS, no_interreflection(surface.solid), "none", lambda s: replace(s, between_parts=False))
    middle = surface.points[surface.mask].mean(0)
    yield Simpler(
        NEAR_LIGHT,
        None if _any(lights, Point) else "every light is distant",
        "as strong as in the middle of the object, from one direction",
        lambda s: relit(s, lambda k: _from_afar(k, middle) if isinstance(k, Point) else k),
    )
    orthographic = surface.view.ndim == 1
    view = surface.view if orthographic else surface.view[surface.mask].mean(0)
    yield Simpler(
        PERSPECTIVE,
        "the view is orthographic: one vector an image" if orthographic else None,
        "one view vector for the image",
        lambda s: replace(s, surface=replace(s.surface, view=view / view.norm())),
    )
    yield Simpler(
        SOFTNESS,
        None if _any(lights, Disc) else "no source has an extent",
        "all its light from its centre",
        lambda s: relit(s, _centred),
    )
    coarse = all(k.radiance.shape[0] % 2 or k.radiance.shape[1] % 2 for k in lights if isinstance(k, Environment))
    yield Simpler(
        MAP_DETAIL,
        ("the map cannot be halved" if _any(lights, Environment) else "no environment") if coarse else None,
        "a map of half as many rows",
        lambda s: relit(s, _halved),
    )
    alone = all(isinstance(light, Ambient) for light in lights)
    yield Simpler(
        AMBIENT,
        "no ambient light" if not _any(lights, Ambient) else "the only light" if alone else None,
        "none",
        lambda s: replace(s, lights=[[k for k in entry if not isinstance(k, Ambient)] or entry for entry in s.lights]),
    )
    yield Simpler(
        FOOTPRINT,
        "one sample a pixel" if surface.samples == 1 else None,
        "one sample where the radiance hardly varies inside a pixel",
        lambda s: replace(s, detail=torch.zeros(s.surface.resolution, dtype=torch.bool)),
    )


def relit(scene: Scene, change: Callable[[Light], Light]) -> Scene:
    """The scene with each light replaced."""
    return replace(scene, lights=[[change(light) for light in entry] for entry in scene.lights])


def beams(scene: Scene) -> list[Distant | Point]:
    """The lights whose shadows have an edge, all images together; a disc by its centre."""
    centred = [_centred(light) for entry in scene.lights for light in entry]
    return [light for light in centred if isinstance(light, Distant | Point)]


def _centred(light: Light) -> Light:
    return Distant(light.direction, light.irradiance) if isinstance(light, Disc) else light


def _any(lights: list[Light], kind: type) -> bool:
    return any(isinstance(light, kind) for light in lights)


def _from_afar(light: Point, middle: Tensor) -> Distant:
    away = light.position.to(middle) - middle
    return Distant(away, torch.as_tensor(light.intensity) / (away * away).sum())


def _halved(light: Light) -> Light:
    return light.reduced(light.radiance.shape[0] // 2) if isinstance(light, Environment) else light
