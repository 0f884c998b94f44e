"""Every elementwise model against the code that people write by hand: time, memory, and the price of a single call.

    OMP_NUM_THREADS=1 python examples/benchmarks/eager.py [--pixels 262144] [--repeats 7]

Eager, float32, one thread, per-texel roughness and RGB albedo, which alone have gradients. Calls take turns, so that a
slower minute slows them all; the least of the processor's time counts. Memory is what is taken and not yet given back,
at most, beside the directions and the material. A single direction is timed by the clock, with and without checks.
"""

import argparse
import math
import time
from collections.abc import Callable

import torch
from naive import naive_oren_nayar
from torch import Tensor
from torch.profiler import ProfilerActivity, profile

from torchbrdf import (
    BRDF,
    EON,
    GGX,
    AnisotropicBeckmann,
    AnisotropicGGX,
    AshikhminShirley,
    Beckmann,
    Burley,
    Coupled,
    Dampened,
    FastGaussianHeightfield,
    FastRoughSurface,
    FujiiOrenNayar,
    Hapke,
    HeTorrance,
    Lambert,
    LambertSphere,
    LommelSeeliger,
    MaxCosinePhong,
    Minnaert,
    ModifiedPhong,
    OrenNayar,
    Phong,
    QualitativeOrenNayar,
    TorranceSparrow,
    fixed,
    native,
    unchecked,
)

Call = Callable[[], Tensor]
# What the code by hand does not compute, by model.
BEYOND = {
    "Hapke": "surge, phase function, two streams per channel",
    "AshikhminShirley": "a tangent frame, two lobes",
    "AnisotropicGGX": "a tangent frame",
    "AnisotropicBeckmann": "a tangent frame",
    "FastGaussianHeightfield": "all bounces of a random heightfield",
    "FastRoughSurface": "all bounces, without the errors of the fit",
    "HeTorrance": "wave optics: a series per channel",
}
MEASURED_PIXELS = 1 << 16  # of the memory, which is proportional
TRIES = 200


def upward(pixels: int, generator: torch.Generator) -> Tensor:
    return torch.nn.functional.normalize(torch.randn(pixels, 3, generator=generator).abs() + 0.01, dim=-1)


def models_of(rough: Tensor, albedo: Tensor) -> dict[str, BRDF]:
    """By name, of roughness (pixel,) in [0.1, 0.8] and albedo (pixel, 3), or of single ones."""
    dim = 0.5 * albedo
    shiny = 10 / rough
    wide = 1.2 * rough
    wavelength = fixed(torch.tensor([0.65, 0.55, 0.45]))
    return {
        "Lambert": Lambert(albedo=albedo),
        "OrenNayar": OrenNayar(albedo=albedo, sigma=rough),
        "QualitativeOrenNayar": QualitativeOrenNayar(albedo=albedo, sigma=rough),
        "FujiiOrenNayar": FujiiOrenNayar(albedo=albedo, roughness=rough),
        "EON": EON(albedo=albedo, roughness=rough),
        "Burley": Burley(albedo=albedo, roughness=rough),
        "Minnaert": Minnaert(albedo=albedo, k=rough),
        "LommelSeeliger": LommelSeeliger(albedo=albedo),
        "LambertSphere": LambertSphere(albedo=albedo),
        "Hapke": Hapke(albedo=albedo, asymmetry=rough - 0.5, surge=rough, surge_width=rough),
        "Coupled": Coupled(albedo=albedo),
        "Dampened": Dampened(albedo=albedo),
        "Phong": Phong(diffuse=dim, specular=dim, exponent=shiny),
        "ModifiedPhong": ModifiedPhong(diffuse=dim, specular=dim, exponent=shiny),
        "MaxCosinePhong": MaxCosinePhong(diffuse=dim, specular=dim, exponent=shiny),
        "AshikhminShirley": AshikhminShirley(diffuse=dim, specular=dim, exponent_x=shiny, exponent_y=2 * shiny),
        "GGX": GGX(alpha=rough),
        "AnisotropicGGX": AnisotropicGGX(alpha_x=rough, alpha_y=wide),
        "Beckmann": Beckmann(alpha=rough),
        "AnisotropicBeckmann": AnisotropicBeckmann(alpha_x=rough, alpha_y=wide),
        "TorranceSparrow": TorranceSparrow(sigma=rough),
        "FastGaussianHeightfield": FastGaussianHeightfield(albedo=albedo, sigma=rough),
        "FastRoughSurface": FastRoughSurface(albedo=albedo, sigma=rough),
        "HeTorrance": HeTorrance(sigma0=rough, tau=fixed(3.0), wavelength=wavelength, eta=fixed(1.5)),
    }


def calls_of(pixels: int) -> dict[str, Call]:
    """By name: evaluation of a per-texel material of its own on the same directions."""
    g = torch.Generator().manual_seed(0)
    normal = torch.tensor([0.0, 0.0, 1.0]).expand(pixels, 3).contiguous()
    tangent = torch.tensor([1.0, 0.0, 0.0]).expand(pixels, 3).contiguous()
    light, view = upward(pixels, g), upward(pixels, g)
    rough, albedo = 0.1 + 0.7 * torch.rand(pixels, generator=g), 0.1 + 0.8 * torch.rand(pixels, 3, generator=g)
    by_hand = rough.clone().requires_grad_(), albedo.clone().requires_grad_()
    calls: dict[str, Call] = {"by hand": lambda: naive_oren_nayar(normal, light, view, *by_hand)}
    for name, model in models_of(rough, albedo).items():
        along = tangent if model.anisotropic else None
        calls[name] = lambda model=model, along=along: model(normal, light, view, tangent=along)
    return calls


def step(call: Call, *, backward: bool) -> None:
    """One evaluation, with or without the derivatives by the material."""
    with torch.set_grad_enabled(backward):
        value = call()
        if backward:
            value.sum().backward()


def seconds(calls: dict[str, Call], repeats: int, *, backward: bool) -> dict[str, float]:
    """Least processor time of each call."""
    least = dict.fromkeys(calls, float("inf"))
    for turn in range(repeats + 1):
        for name, call in calls.items():
            began = time.process_time()
            step(call, backward=backward)
            if turn:  # the first warms up
                least[name] = min(least[name], time.process_time() - began)
    return least


def working_bytes(call: Call) -> int:
    """Most bytes that evaluation and derivatives hold at once; gradients, which stay, are there from the first turn."""
    step(call, backward=True)
    with profile(activities=[ProfilerActivity.CPU], profile_memory=True) as record:
        step(call, backward=True)
    held = most = 0
    for event in record.profiler.kineto_results.events():  # pyright: ignore[reportOptionalMemberAccess]
        if event.name() == "[memory]":
            held += event.nbytes()
            most = max(most, held)
    return most


def single_calls() -> dict[str, tuple[float, float]]:
    """Seconds of a call with one direction and one material, with checks and without, by name."""
    g = torch.Generator().manual_seed(0)
    normal, light, view = torch.tensor([0.0, 0.0, 1.0]), *upward(2, g)
    rough, albedo = torch.tensor(0.3), torch.tensor([0.7, 0.5, 0.3])
    models = models_of(rough, albedo)
    calls: dict[str, Call] = {
        "by hand": lambda: naive_oren_nayar(normal[None], light[None], view[None], rough[None], albedo[None])
    }
    for name in ("Lambert", "OrenNayar", "EON", "GGX", "TorranceSparrow"):
        calls[name] = lambda model=models[name]: model(normal, light, view)

    def least(call: Call) -> float:
        times = []
        for _ in range(TRIES):
            began = time.perf_counter()
            call()
            times.append(time.perf_counter() - began)
        return min(times)

    def both(call: Call) -> tuple[float, float]:
        with_checks = least(call)
        with unchecked():
            return with_checks, least(call)

    with torch.no_grad():
        return {name: both(call) for name, call in calls.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=1 << 18)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    torch.set_num_threads(1)
    calls = calls_of(options.pixels)
    forward, both = (seconds(calls, options.repeats, backward=k) for k in (False, True))
    few = min(options.pixels, MEASURED_PIXELS)
    memory = {name: working_bytes(call) / few for name, call in calls_of(few).items()}
    print(f"{options.pixels} pixels; speed relative to the code by hand, nanoseconds and bytes a pixel (f + b)\n")
    print("| model | forward | forward + backward | ns | ns | bytes | beyond the code by hand |")
    print("|---|---|---|---|---|---|---|")
    for name in calls:
        ratios = forward["by hand"] / forward[name], both["by hand"] / both[name]
        spent = [1e9 * k[name] / options.pixels for k in (forward, both)]
        print(
            f"| {name} | {ratios[0]:.2f} x | {ratios[1]:.2f} x | {spent[0]:.0f} | {spent[1]:.0f} | {memory[name]:.0f} "
            f"| {BEYOND.get(name, '')} |"
        )
    print("\none direction, microseconds a call\n\n| model | checked | unchecked |\n|---|---|---|")
    for name, (checked, trusted) in single_calls().items():
        print(f"| {name} | {1e6 * checked:.0f} | {1e6 * trusted:.0f} |")


if __name__ == "__main__":
    with native(math.inf):  # compiled kernels have a table of their own, of kernel.py
        main()
