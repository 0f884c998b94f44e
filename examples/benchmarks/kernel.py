"""Compiled kernels against the formula they come from and against the code that people write by hand.

    OMP_NUM_THREADS=1 python examples/benchmarks/kernel.py [--pixels 1048576] [--repeats 7]

Needs `pip install torchbrdf[fast]`. Float32, one thread unless stated, per-texel roughness and RGB albedo, which alone
have gradients unless stated. Calls take turns, so that a slower minute slows them all; the shortest processor time
counts.
"""

import argparse
import math
import time
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

import torch
from naive import naive_oren_nayar
from torch import Tensor

from torchbrdf import (
    EON,
    FastGaussianHeightfield,
    FastRoughSurface,
    FieldBRDF,
    FujiiOrenNayar,
    OrenNayar,
    QualitativeOrenNayar,
    fixed,
    native,
)

FIRST_CALL = 4096  # pixels of the call that compiles
Key = TypeVar("Key", bound=Hashable)


class Inputs:
    """Directions and a material, per texel or one for all."""

    def __init__(self, pixels: int):
        g = torch.Generator().manual_seed(0)
        normal = torch.tensor([0.0, 0.0, 1.0]).expand(pixels, 3).contiguous()
        up = [torch.randn(pixels, 3, generator=g).abs() + 0.01 for _ in range(2)]
        light, view = (torch.nn.functional.normalize(v, dim=-1) for v in up)
        self.vectors = (normal, light, view)
        self.rough = 0.1 + 0.7 * torch.rand(pixels, generator=g)
        self.albedo = 0.1 + 0.8 * torch.rand(pixels, 3, generator=g)


def by_hand_of(x: Inputs) -> tuple[Callable[..., Tensor], list[Tensor]]:
    """The code by hand, and the leaves it has derivatives by."""
    rough, albedo = x.rough.clone().requires_grad_(), x.albedo.clone().requires_grad_()
    return lambda *vectors: naive_oren_nayar(*vectors, rough, albedo), [rough, albedo]


def models_of(x: Inputs) -> dict[str, FieldBRDF]:
    """By name: models per texel."""
    return {
        "OrenNayar": OrenNayar(albedo=x.albedo, sigma=x.rough),
        "QualitativeOrenNayar": QualitativeOrenNayar(albedo=x.albedo, sigma=x.rough),
        "FujiiOrenNayar": FujiiOrenNayar(albedo=x.albedo, roughness=x.rough),
        "EON": EON(albedo=x.albedo, roughness=x.rough),
        "FastRoughSurface": FastRoughSurface(albedo=x.albedo, sigma=x.rough),
        "FastGaussianHeightfield": FastGaussianHeightfield(albedo=x.albedo, sigma=x.rough),
    }


def shortest(calls: dict[Key, Callable[[], object]], repeats: int) -> dict[Key, float]:
    """Processor seconds of the quickest of some calls of each, which take turns."""
    best: dict[Key, float] = dict.fromkeys(calls, math.inf)
    for _ in range(repeats):
        for name, call in calls.items():
            began = time.process_time()
            call()
            best[name] = min(best[name], time.process_time() - began)
    return best


def forward_of(model: Callable[..., Tensor], vectors: Sequence[Tensor], *, smallest: float) -> Callable[[], object]:
    def call() -> None:
        with torch.no_grad(), native(smallest):
            model(*vectors)

    return call


def both_of(
    model: Callable[..., Tensor], given: Sequence[Tensor], vectors: Sequence[Tensor], weight: Tensor, *, smallest: float
) -> Callable[[], object]:
    """Derivatives of sum(weight * f_r) by what is given."""

    def call() -> None:
        with native(smallest):
            torch.autograd.grad(model(*vectors), given, weight)

    return call


def table(pixels: int, repeats: int) -> None:
    """Speed relative to the code by hand."""
    x = Inputs(pixels)
    models, weight = models_of(x), torch.rand(pixels, 3)
    moving = [v.clone().requires_grad_() for v in x.vectors]
    hand, leaves = by_hand_of(x)
    forward = {"by hand": forward_of(hand, x.vectors, smallest=1)}
    both = {"by hand": both_of(hand, leaves, x.vectors, weight, smallest=1)}
    # what the code by hand computes: without the map from stored to constrained parameters
    plain = OrenNayar(albedo=fixed(x.albedo), sigma=fixed(x.rough))
    tensors = dict(zip(("fixed_sigma", "fixed_albedo"), leaves, strict=True))

    def of_tensors(*vectors: Tensor) -> Tensor:
        return torch.func.functional_call(plain, tensors, vectors)

    forward["OrenNayar of plain tensors"] = forward_of(of_tensors, x.vectors, smallest=1)
    both["OrenNayar of plain tensors"] = both_of(of_tensors, leaves, x.vectors, weight, smallest=1)
    for name, model in models.items():
        given = list(model.parameters())
        forward[name] = forward_of(model, x.vectors, smallest=1)
        both[name] = both_of(model, given, x.vectors, weight, smallest=1)
        both[f"{name}, by directions too"] = both_of(model, [*given, *moving], moving, weight, smallest=1)
        forward[f"{name}, formula"] = forward_of(model, x.vectors, smallest=math.inf)
        both[f"{name}, formula"] = both_of(model, given, x.vectors, weight, smallest=math.inf)
    # forward and backward with derivatives by the material read and write 36 numbers a pixel
    source, target = torch.rand(18, pixels), torch.empty(18, pixels)
    calls: dict[tuple[str, bool], Callable[[], object]] = {(name, False): call for name, call in forward.items()}
    calls |= {(name, True): call for name, call in both.items()}
    calls["memory alone", True] = lambda: target.copy_(source)
    spent = shortest(calls, repeats)
    print(f"\n{pixels} pixels; speed relative to the code by hand, and nanoseconds a pixel\n")
    print("| model | forward | forward + backward | ns | ns |")
    print("|---|---|---|---|---|")
    for name in (*both, "memory alone"):
        pair = [spent.get((name, backward)) for backward in (False, True)]
        ratios = [f"{spent['by hand', k] / t:.1f} x" if t else "" for k, t in zip((False, True), pair, strict=True)]
        ns = [f"{1e9 * t / pixels:.1f}" if t else "" for t in pair]
        print(f"| {name} | {' | '.join((*ratios, *ns))} |")


def sizes(repeats: int) -> None:
    """One call from one direction to a million."""
    print("\n| pixels | by hand | formula | kernel |  (microseconds of OrenNayar forward)")
    print("|---|---|---|---|")
    for pixels in (1, 100, 10_000, 1_000_000):
        x = Inputs(pixels)
        model = models_of(x)["OrenNayar"]
        calls = {
            "by hand": forward_of(by_hand_of(x)[0], x.vectors, smallest=1),
            "formula": forward_of(model, x.vectors, smallest=math.inf),
            "kernel": forward_of(model, x.vectors, smallest=1),
        }
        spent = shortest(calls, repeats if pixels > 10_000 else 20 * repeats)
        print(f"| {pixels} | " + " | ".join(f"{1e6 * spent[name]:.0f}" for name in calls) + " |")


def first_calls() -> None:
    """Seconds until a model's first answer, and its first derivatives, are there."""
    x = Inputs(FIRST_CALL)
    print("\n| first call | forward | backward |  (seconds, recording and compiling)")
    print("|---|---|---|")
    for name, model in models_of(x).items():
        began = time.perf_counter()
        value = model(*x.vectors)
        middle = time.perf_counter()
        value.sum().backward()
        print(f"| {name} | {middle - began:.2f} | {time.perf_counter() - middle:.2f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=1 << 20)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    torch.set_num_threads(1)
    first_calls()
    table(options.pixels, options.repeats)
    sizes(options.repeats)


if __name__ == "__main__":
    main()
