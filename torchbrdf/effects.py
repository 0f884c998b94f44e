"""Names of the effects that a material can do without, and which of them a model has.

Which effects a model leaves out, and by what cheaper model, the model says itself: see `BRDF.stand_ins`.
"""

from torchbrdf.brdf import BRDF

ROUGHNESS = "roughness"
INTERREFLECTION = "interreflection in cavities"
LATER_BOUNCES = "third and later bounces"
C3_TERM = "C3 term"
EXACT_SLOPES = "exact integral over slopes"
MANY_SLOPES = "all slopes of the model"
OCCLUSION_NEAR_BY = "occlusion near by"
FRESNEL_VARIATION = "Fresnel variation"
ANISOTROPY = "anisotropy"
WAVE_OPTICS = "wave optics"
SPECULAR = "specular"
DIRECTIONAL_DIFFUSE = "directional diffuse"
UNIFORM_DIFFUSE = "uniform diffuse"
EFFECTS = (
    ROUGHNESS, INTERREFLECTION, LATER_BOUNCES, C3_TERM, EXACT_SLOPES, MANY_SLOPES, OCCLUSION_NEAR_BY,
    FRESNEL_VARIATION, ANISOTROPY, WAVE_OPTICS, SPECULAR, DIRECTIONAL_DIFFUSE, UNIFORM_DIFFUSE,
)  # fmt: skip


class EffectOfPart(str):
    """An effect that one part of a sum has, "roughness of part 2"; `kind` is its name wherever it occurs."""

    kind: str
    _given: tuple[str, str]

    def __new__(cls, effect: str, part: str) -> "EffectOfPart":
        name = super().__new__(cls, f"{effect} of {part}")
        name._given = (effect, part)
        name.kind = effect.kind if isinstance(effect, EffectOfPart) else effect
        return name

    def __reduce__(self) -> tuple[type["EffectOfPart"], tuple[str, str]]:  # for copies
        return EffectOfPart, self._given


def simulated(model: BRDF, *, by_part: bool = True) -> tuple[str, ...]:
    """Names of the effects that a model says it could leave out; `by_part=False` without saying of which part."""
    skips = [effect for group in model.stand_ins().values() for option in group for effect in option.skips]
    if not by_part:
        skips = [effect.kind if isinstance(effect, EffectOfPart) else effect for effect in skips]
    return tuple(dict.fromkeys(skips))
