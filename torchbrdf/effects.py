"""What a material could do without: cheaper stand-ins, and the named effects each leaves out.

Nothing is decided here. `options` lists what may be simplified in a model and by what; whether it may be in a given
scene is measured there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch

from torchbrdf.brdf import BRDF
from torchbrdf.fresnel import ConstantFresnel, Fresnel, Perfect
from torchbrdf.mixture import WeightedSum
from torchbrdf.models.ggx_and_beckmann import GGX, AnisotropicBeckmann, AnisotropicGGX, Beckmann
from torchbrdf.models.he_torrance.model import HeTorrance
from torchbrdf.models.lambert import Lambert
from torchbrdf.models.oren_nayar.anisotropic import AnisotropicRoughSurface
from torchbrdf.models.oren_nayar.fast import FastRoughSurface
from torchbrdf.models.oren_nayar.functional import OrenNayar
from torchbrdf.models.oren_nayar.qualitative import QualitativeOrenNayar
from torchbrdf.models.oren_nayar.rough_surface import RoughSurface
from torchbrdf.models.oriented import Oriented
from torchbrdf.models.torrance_sparrow import TorranceSparrow
from torchbrdf.parameters import fixed, kept

ROUGHNESS = "roughness"
INTERREFLECTION = "interreflection in cavities"
LATER_BOUNCES = "third and later bounces"
C3_TERM = "C3 term"
EXACT_SLOPES = "exact integral over slopes"
MANY_SLOPES = "all slopes of the model"
FRESNEL_VARIATION = "Fresnel variation"
ANISOTROPY = "anisotropy"
SPIKE = "specular spike"
DIFFRACTION = "directional diffuse"
BODY = "uniform diffuse"
EFFECTS = (
    ROUGHNESS, INTERREFLECTION, LATER_BOUNCES, C3_TERM, EXACT_SLOPES, MANY_SLOPES, FRESNEL_VARIATION, ANISOTROPY,
    SPIKE, DIFFRACTION, BODY,
)  # fmt: skip


@dataclass(frozen=True)
class Option:
    """A material that simulates less.

    Attributes:
        choice: what is simulated instead.
        skips: the effects left out.
        model: the whole material with the stand-in in it; values, and what is held fixed, are the given model's.
    """

    choice: str
    skips: tuple[str, ...]
    model: BRDF


def simulated(model: BRDF) -> tuple[str, ...]:
    """Names of the effects in a model that `options` could leave out."""
    found = (effect for group in options(model).values() for option in group for effect in option.skips)
    return tuple(dict.fromkeys(found))


def options(model: BRDF) -> dict[str, list[Option]]:
    """What may be simplified in a material, by group: of each group one option at most, cheapest first.

    The parts of a sum bring their groups, and the option to leave the part out. A model without known stand-ins has
    no groups.
    """
    if isinstance(model, WeightedSum):
        return dict(_of_sum(model))
    if isinstance(model, Oriented):
        return {
            group: [Option(k.choice, k.skips, _turned(model, k.model)) for k in found]
            for group, found in options(model.brdf).items()
        }
    if isinstance(model, HeTorrance):
        return dict(_without_parts(model))
    found = {"rung": list(_rungs(model)), ANISOTROPY: list(_round(model)), FRESNEL_VARIATION: list(_flat(model))}
    return {group: entries for group, entries in found.items() if entries}


def _without_parts(model: HeTorrance) -> Iterator[tuple[str, list[Option]]]:
    """The same surface with one of its parts switched off; none where it is the last."""
    if len(model.parts) == 1:
        return
    names = ("sigma0", "tau", "wavelength", "eta", "k", "diffuse")
    material: dict[str, Any] = {name: kept(model, name) for name in names}
    for part, effect in (("specular", SPIKE), ("directional_diffuse", DIFFRACTION), ("uniform_diffuse", BODY)):
        if part in model.parts:
            others = {name: name in model.parts and name != part for name in HeTorrance.PARTS}
            stand_in = HeTorrance(**material, solid_angle=model.solid_angle, **others)
            yield effect, [Option(f"no {effect} part", (effect,), stand_in)]


def _rungs(model: BRDF) -> Iterator[Option]:
    """Rungs of the Oren-Nayar ladder that simulate less than the model does."""
    if not isinstance(model, RoughSurface | FastRoughSurface | OrenNayar):
        return
    own = set(_effects_of(model))
    material: dict[str, Any] = {name: kept(model, name) for name in ("albedo", "sigma")}
    bounce = INTERREFLECTION in own
    ladder: list[BRDF] = [
        Lambert(albedo=material["albedo"]),
        QualitativeOrenNayar(**material),
        OrenNayar(**material, interreflection=bounce, c3=False),
        OrenNayar(**material, interreflection=bounce),
    ]
    if bounce:
        ladder += [FastRoughSurface(**material, bounces=2), FastRoughSurface(**material, bounces="all")]
    if isinstance(model, RoughSurface):
        details: dict[str, Any] = {"order": model.order, "graded": model.graded}
        ladder += [RoughSurface(**material, **details, nodes=model.nodes, bounces=count) for count in (1, 2)]
        ladder += [
            RoughSurface(**material, **details, nodes=nodes, bounces=model.bounces, modes=model.modes)
            for nodes in (4, 8, 16)
            if nodes < model.nodes
        ]
    for rung in ladder:
        less = set(_effects_of(rung))
        if isinstance(rung, RoughSurface) and rung.nodes < getattr(model, "nodes", 0):
            less.discard(MANY_SLOPES)
        if less < own:
            yield Option(_label(rung), tuple(k for k in _effects_of(model) if k not in less), rung)


def _effects_of(model: BRDF) -> tuple[str, ...]:
    if isinstance(model, Lambert):
        return ()
    if isinstance(model, QualitativeOrenNayar):
        return (ROUGHNESS,)
    if isinstance(model, OrenNayar):
        names = (INTERREFLECTION,) if "interreflection" in model.component_coefficients() else ()
        return (ROUGHNESS, *names, *((C3_TERM,) if model.c3 else ()))
    assert isinstance(model, FastRoughSurface | RoughSurface)
    names = {1: (), 2: (INTERREFLECTION,), "all": (INTERREFLECTION, LATER_BOUNCES)}[model.bounces]
    exact = (EXACT_SLOPES, MANY_SLOPES) if isinstance(model, RoughSurface) else ()
    return (ROUGHNESS, *names, C3_TERM, *exact)


def _label(rung: BRDF) -> str:
    if isinstance(rung, Lambert):
        return "Lambert"
    if isinstance(rung, QualitativeOrenNayar):
        return "qualitative (0.33)"
    if isinstance(rung, OrenNayar):
        return "functional" if rung.c3 else "functional without C3"
    assert isinstance(rung, FastRoughSurface | RoughSurface)
    bounces = {1: "1 bounce", 2: "2 bounces", "all": "all bounces"}[rung.bounces]
    return f"fast, {bounces}" if isinstance(rung, FastRoughSurface) else f"exact, K = {rung.nodes}, {bounces}"


def _round(model: BRDF) -> Iterator[Option]:
    """The isotropic model of the mean width."""
    if isinstance(model, AnisotropicRoughSurface):
        sigma = ((model.sigma_x.square() + model.sigma_y.square()) / 2).sqrt().detach()
        stand_in = RoughSurface(albedo=kept(model, "albedo"), sigma=sigma, nodes=model.nodes, bounces=model.bounces)
    elif isinstance(model, AnisotropicGGX | AnisotropicBeckmann):
        alpha = (model.alpha_x * model.alpha_y).sqrt().detach()
        kind = GGX if isinstance(model, AnisotropicGGX) else Beckmann
        stand_in = kind(alpha=alpha, fresnel=model.fresnel, masking=model.masking)
    else:
        return
    yield Option("one width in all azimuths", (ANISOTROPY,), stand_in)


def _flat(model: BRDF) -> Iterator[Option]:
    """The same facets with one reflectance at every angle: that of normal incidence."""
    if not isinstance(model, TorranceSparrow | GGX | Beckmann | AnisotropicGGX | AnisotropicBeckmann):
        return
    if isinstance(model.fresnel, Perfect | ConstantFresnel):
        return
    fresnel = ConstantFresnel(value=_at_normal_incidence(model.fresnel))
    if isinstance(model, TorranceSparrow):
        stand_in = TorranceSparrow(sigma=kept(model, "sigma"), fresnel=fresnel, normalised=model.normalised)
    elif isinstance(model, GGX | Beckmann):
        stand_in = type(model)(alpha=kept(model, "alpha"), fresnel=fresnel, masking=model.masking)
    else:
        widths: dict[str, Any] = {name: kept(model, name) for name in ("alpha_x", "alpha_y")}
        stand_in = type(model)(**widths, fresnel=fresnel, masking=model.masking)
    yield Option("the reflectance of normal incidence", (FRESNEL_VARIATION,), stand_in)


def _at_normal_incidence(fresnel: Fresnel) -> torch.Tensor:
    stored, *_ = (*fresnel.parameters(), *fresnel.buffers())
    return fresnel(torch.ones((), dtype=stored.dtype, device=stored.device)).detach()


def _of_sum(model: WeightedSum) -> Iterator[tuple[str, list[Option]]]:
    parts: list[BRDF] = list(model.parts)  # pyright: ignore[reportAssignmentType]
    lit = [k for k, part in enumerate(parts) if not _is_black(part)]
    for index in lit:
        name = f"part {index + 1}"
        if len(lit) > 1:
            # a black part keeps its place, so that the others keep their names; `compact` removes it
            black = Lambert(albedo=fixed(torch.zeros_like(model.weights[0])))
            skips = (name, *(f"{effect} of {name}" for effect in simulated(parts[index])))
            yield name, [Option(f"{type(parts[index]).__name__} left out", skips, _with_part(model, index, black))]
        for group, found in options(parts[index]).items():
            skips = [tuple(f"{effect} of {name}" for effect in k.skips) for k in found]
            models = [_with_part(model, index, k.model) for k in found]
            choices = [k.choice for k in found]
            yield f"{group} of {name}", [Option(*entry) for entry in zip(choices, skips, models, strict=True)]


def compact(model: BRDF) -> tuple[BRDF, tuple[int, ...]]:
    """A sum without the parts that were left out, and the places the others had; any other model as it is, and ()."""
    if not isinstance(model, WeightedSum):
        return model, ()
    lit = [k for k, part in enumerate(model.parts) if not _is_black(part)]  # pyright: ignore[reportArgumentType]
    return _sum_of(model, [model.parts[k] for k in lit], lit), tuple(lit)  # pyright: ignore[reportArgumentType]


def _is_black(part: BRDF) -> bool:
    return isinstance(part, Lambert) and bool((part.albedo == 0).all())


def _with_part(model: WeightedSum, index: int, part: BRDF) -> WeightedSum:
    parts: list[BRDF] = list(model.parts)  # pyright: ignore[reportAssignmentType]
    return _sum_of(model, [*parts[:index], part, *parts[index + 1 :]], list(range(len(parts))))


def _sum_of(model: WeightedSum, parts: list[BRDF], places: list[int]) -> WeightedSum:
    """A sum with the weights a given one has at some places, held fixed if they are there."""
    shares = model.weights.detach()[places]
    return WeightedSum(parts, fixed(shares) if isinstance(kept(model, "weights"), fixed) else shares)


def _turned(model: Oriented, inner: BRDF) -> BRDF:
    return Oriented(inner, model.direction) if inner.anisotropic else inner
