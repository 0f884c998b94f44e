"""Every rough diffuse model, and the glossy ones, against the code that people write by hand.

    OMP_NUM_THREADS=1 python examples/benchmarks/eager.py [--pixels 262144] [--repeats 7]

Eager, float32, one thread, per-texel roughness and RGB albedo, which alone have gradients. Calls take turns, so that a
slower minute slows them all; the median of the processor's time counts.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable

import torch
from naive import naive_oren_nayar
from torch import Tensor

from torchbrdf import (
    EON,
    GGX,
    Beckmann,
    FastGaussianHeightfield,
    FastRoughSurface,
    FujiiOrenNayar,
    OrenNayar,
    QualitativeOrenNayar,
    native,
)


def calls_of(pixels: int) -> dict[str, Callable[[], Tensor]]:
    """By name: evaluation of a per-texel material of its own on the same directions."""
    g = torch.Generator().manual_seed(0)

    def upward() -> Tensor:
        return torch.nn.functional.normalize(torch.randn(pixels, 3, generator=g).abs() + 0.01, dim=-1)

    normal = torch.tensor([0.0, 0.0, 1.0]).expand(pixels, 3).contiguous()
    light, view = upward(), upward()
    rough = 0.1 + 0.7 * torch.rand(pixels, generator=g)
    albedo = 0.1 + 0.8 * torch.rand(pixels, 3, generator=g)
    by_hand = rough.clone().requires_grad_(), albedo.clone().requires_grad_()
    models = {
        "OrenNayar": OrenNayar(albedo=albedo, sigma=rough),
        "QualitativeOrenNayar": QualitativeOrenNayar(albedo=albedo, sigma=rough),
        "FujiiOrenNayar": FujiiOrenNayar(albedo=albedo, roughness=rough),
        "EON": EON(albedo=albedo, roughness=rough),
        "FastGaussianHeightfield": FastGaussianHeightfield(albedo=albedo, sigma=rough),
        "FastRoughSurface": FastRoughSurface(albedo=albedo, sigma=rough),
        "GGX": GGX(alpha=rough),
        "Beckmann": Beckmann(alpha=rough),
    }
    calls = {name: (lambda model=model: model(normal, light, view)) for name, model in models.items()}
    return {"by hand": lambda: naive_oren_nayar(normal, light, view, *by_hand), **calls}


def seconds(calls: dict[str, Callable[[], Tensor]], repeats: int, *, backward: bool) -> dict[str, float]:
    """Median processor time of each call, with or without the derivatives by the material."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(repeats + 1):
        for name, call in calls.items():
            with torch.set_grad_enabled(backward):
                began = time.process_time()
                value = call()
                if backward:
                    value.sum().backward()
            if turn:  # the first warms up
                times[name].append(time.process_time() - began)
    return {name: statistics.median(values) for name, values in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=1 << 18)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    torch.set_num_threads(1)
    calls = calls_of(options.pixels)
    with native(math.inf):  # compiled kernels have a table of their own, of kernel.py
        forward, both = (seconds(calls, options.repeats, backward=k) for k in (False, True))
    print(f"{options.pixels} pixels; speed relative to the code by hand, and nanoseconds a pixel\n")
    print("| model | forward | forward + backward | ns | ns |")
    print("|---|---|---|---|---|")
    for name in calls:
        ratios = forward["by hand"] / forward[name], both["by hand"] / both[name]
        spent = [1e9 * k[name] / options.pixels for k in (forward, both)]
        print(f"| {name} | {ratios[0]:.2f} x | {ratios[1]:.2f} x | {spent[0]:.0f} | {spent[1]:.0f} |")


if __name__ == "__main__":
    main()
