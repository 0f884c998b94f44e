"""What tests of the compiled kernels share: models of every form, directions in random frames, derivatives."""

import pytest
import torch

from helpers.probes import seeded
from torchbrdf import (
    BRDF,
    EON,
    FastGaussianHeightfield,
    FastRoughSurface,
    FujiiOrenNayar,
    OrenNayar,
    QualitativeOrenNayar,
)
from torchbrdf.kernels.forms import form_for
from torchbrdf.kernels.machine import is_installed

with_compiler = pytest.mark.skipif(not is_installed(), reason="llvmlite is not installed: pip install torchbrdf[fast]")

# By name: a model on albedo and roughness.
MODELS = {
    "functional": lambda albedo, rough: OrenNayar(albedo=albedo, sigma=rough),
    "functional without C3": lambda albedo, rough: OrenNayar(albedo=albedo, sigma=rough, c3=False),
    "first bounce": lambda albedo, rough: OrenNayar(albedo=albedo, sigma=rough, interreflection=False),
    "second bounce": lambda albedo, rough: OrenNayar(albedo=albedo, sigma=rough, direct=False),
    "qualitative": lambda albedo, rough: QualitativeOrenNayar(albedo=albedo, sigma=rough),
    "qualitative 0.57": lambda albedo, rough: QualitativeOrenNayar(albedo=albedo, sigma=rough, a_constant=0.57),
    "fujii": lambda albedo, rough: FujiiOrenNayar(albedo=albedo, roughness=rough),
    "eon": lambda albedo, rough: EON(albedo=albedo, roughness=rough),
    "eon, fitted": lambda albedo, rough: EON(albedo=albedo, roughness=rough, exact=False),
}


# Networks, in which the sum of all terms is no measure: it grows from layer to layer without bound.
NETWORKS = {
    "fast V-cavities": lambda albedo, rough: FastRoughSurface(albedo=albedo, sigma=rough),
    "fast heightfield": lambda albedo, rough: FastGaussianHeightfield(albedo=albedo, sigma=rough),
}


def made(name: str, pixels: int | None = None, dtype: torch.dtype = torch.float64) -> BRDF:
    """A model on a material per pixel, or on one for all."""
    lead = () if pixels is None else (pixels,)
    generator = seeded(1)
    rough = 0.05 + 0.9 * torch.rand(lead, generator=generator, dtype=torch.float64)
    albedo = 0.05 + 0.9 * torch.rand((*lead, 3), generator=generator, dtype=torch.float64)
    return (MODELS | NETWORKS)[name](albedo.to(dtype), rough.to(dtype))


def frames(pixels: int, dtype: torch.dtype = torch.float64, seed: int = 0) -> list[torch.Tensor]:
    """Normal, light and view in random frames: from the zenith to below the horizon, many at grazing."""
    generator = seeded(seed)

    def draw(*shape: int) -> torch.Tensor:
        return torch.randn(shape, generator=generator, dtype=torch.float64)

    normal = torch.nn.functional.normalize(draw(pixels, 3), dim=-1)
    result = [normal]
    for _ in range(2):
        along = torch.nn.functional.normalize(draw(pixels, 3), dim=-1)
        along = along - (along * normal).sum(-1, keepdim=True) * normal
        height = torch.where(draw(pixels) > 0, draw(pixels).abs(), 0.1 * draw(pixels) + 0.03)
        result.append(torch.nn.functional.normalize(along + height[:, None] * normal, dim=-1))
    return [v.to(dtype) for v in result]


def kernel_of(model: BRDF, dtype: torch.dtype):
    """The kernel and the arrays of a model."""
    form = form_for(model)
    assert form is not None
    material = [t.detach().to(dtype) for t in model.parameters()]
    kernel = form.kernel(material, dtype)
    assert kernel is not None
    return kernel, material


def sums_of_terms(program, inputs: torch.Tensor) -> list[torch.Tensor]:
    """Of each step: its result (pixel,) at inputs (number, pixel) with every subtraction made an addition.

    What rounding errors are to be measured by. Made of the steps' arguments alone, in float64.
    """
    value: list[torch.Tensor] = []
    terms: list[torch.Tensor] = []
    ones = torch.ones_like(inputs[0], dtype=torch.float64)
    for operation, arguments in program.steps:
        if operation in {"constant", "input"}:
            given = ones * arguments[0] if operation == "constant" else inputs[int(arguments[0])].double()
            value.append(given)
            terms.append(given.abs())
            continue
        x = [value[int(k)] for k in arguments]
        size = [terms[int(k)] for k in arguments]
        result, scale = EVALUATED[operation](x, size)
        value.append(result)
        terms.append(torch.maximum(scale, result.double().abs()))
    return terms


# Of values and sums of terms: value, sum of terms.
EVALUATED = {
    "add": lambda x, m: (x[0] + x[1], m[0] + m[1]),
    "subtract": lambda x, m: (x[0] - x[1], m[0] + m[1]),
    "multiply": lambda x, m: (x[0] * x[1], m[0] * m[1]),
    "reciprocal": lambda x, m: (1 / x[0], m[0] / (x[0] * x[0])),
    "negate": lambda x, m: (-x[0], m[0]),
    "abs": lambda x, m: (x[0].abs(), m[0]),
    "sqrt": lambda x, m: (x[0].sqrt(), m[0] / x[0].sqrt()),
    "log": lambda x, m: (x[0].log(), m[0] / x[0].abs() + x[0].log().abs()),
    "erfcx": lambda x, m: (torch.special.erfcx(x[0]), torch.special.erfcx(x[0]) * (1 + m[0])),
    "exp": lambda x, m: (x[0].exp(), x[0].exp() * (1 + m[0])),
    "select": lambda x, m: (torch.where(x[0].bool(), x[1], x[2]), torch.where(x[0].bool(), m[1], m[2])),
    "and": lambda x, m: (x[0].bool() & x[1].bool(), m[0]),
    "or": lambda x, m: (x[0].bool() | x[1].bool(), m[0]),
    "not": lambda x, m: (~x[0].bool(), m[0]),
    **{
        compare.__name__: (lambda x, m, compare=compare: (compare(x[0], x[1]), m[0]))
        for compare in (torch.lt, torch.le, torch.gt, torch.ge, torch.eq, torch.ne)
    },
}
