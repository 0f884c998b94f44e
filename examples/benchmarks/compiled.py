"""What compiling costs, model by model, and what compiled code gains over the code that people write by hand.

    python examples/benchmarks/compiled.py [--models OrenNayar GGX ...] [--speed]

Each model is compiled in a process of its own, once with an empty cache on disk and once with the one that the first
left (the last two times); as one graph of any size, which a second size must not compile again. Seconds on the clock,
and of the processor with the compilers it starts, which a busy machine does not lengthen; the import of torch's
compiler and what it does once an installation (it looks at the processor and translates its headers) are left out.

`--speed`: the functional model of Oren and Nayar on vectors (pixel, 3), and on components in memory of their own;
float32, one thread, a roughness and an albedo a pixel. "One step" is loss and gradient in one compiled function.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import torch
import torch._dynamo
import torch._inductor.compile_fx
from cost_of_models import every_model
from naive import naive_oren_nayar
from torch import Tensor
from torch._dynamo.utils import counters

from torchbrdf import Cosines, Oriented, oren_nayar
from torchbrdf.testing import random_directions

PIXELS = 4096


def clocks() -> tuple[float, float]:
    """Now, and the processor's time of this process and of those it started. [s]"""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return time.perf_counter(), sum(k.ru_utime + k.ru_stime for k in used)


def compile_one(name: str) -> dict[str, float]:
    """Seconds until a compiled model's first value and first gradient, and the operations of its graph."""
    torch.set_num_threads(1)
    model = every_model()[name]
    if model.anisotropic:
        model = Oriented(model, torch.tensor([1.0, 0.0, 0.2]))
    nodes = []

    def counted(graph, inputs):
        nodes.append(sum(node.op.startswith("call") for node in graph.graph.nodes))
        return torch._inductor.compile_fx.compile_fx(graph, inputs)

    once = torch.ones(PIXELS, requires_grad=True)
    torch.compile(torch.cos)(once).sum().backward()
    generator = torch.Generator().manual_seed(0)
    sizes = [random_directions(n, generator=generator) for n in (PIXELS, PIXELS // 2 + 1)]
    compiled = torch.compile(model, fullgraph=True, dynamic=True, backend=counted)
    took = {}
    for key, gradient in (("forward", False), ("both", True)):
        before = clocks()
        with torch.set_grad_enabled(gradient):
            value = compiled(*sizes[0])
        if gradient and value.requires_grad:
            value.sum().backward()
        took[key], took[f"{key} cpu"] = (b - a for a, b in zip(before, clocks(), strict=True))
        graphs = counters["stats"]["unique_graphs"]
        with torch.set_grad_enabled(gradient):
            again = compiled(*sizes[1])
        expected = model(*sizes[1])
        took[f"{key} error"] = float((again - expected).abs().max() / expected.abs().max())
        took[f"{key} again"] = counters["stats"]["unique_graphs"] - graphs
    return took | {"nodes": nodes[0]}


def in_a_process(name: str, cache: str) -> dict[str, float]:
    environment = os.environ | {"TORCHINDUCTOR_CACHE_DIR": cache}
    command = [sys.executable, __file__, "--one", name]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(f"{name}: {run.stderr.strip().splitlines()[-1]}")
    return json.loads(run.stdout.splitlines()[-1])


def by_vectors(normal: Tensor, light: Tensor, view: Tensor, sigma: Tensor, albedo: Tensor) -> Tensor:
    return oren_nayar(Cosines.of(normal, light, view), albedo=albedo, sigma=sigma)


def by_components(normal: Tensor, light: Tensor, view: Tensor, sigma: Tensor, albedo: Tensor) -> Tensor:
    """Of (3, pixel) and albedo (channel, pixel): each row lies in one piece."""
    cosines = Cosines.of_components(normal.unbind(), light.unbind(), view.unbind())
    return oren_nayar(cosines, albedo=albedo.mT, sigma=sigma)


def stepped(model: Callable[..., Tensor]) -> Callable[..., object]:
    """Loss, and its gradient by sigma and albedo, in one compiled function."""

    def step(*given: Tensor) -> object:
        return torch.func.grad_and_value(lambda *v: model(*given[:3], *v).square().mean(), argnums=(0, 1))(*given[3:])

    return torch.compile(step, fullgraph=True)


def trained(model: Callable[..., Tensor]) -> Callable[..., None]:
    """The same the usual way: a value, and autograd behind it."""

    def both(*given: Tensor) -> None:
        material = [v.detach().requires_grad_() for v in given[3:]]
        model(*given[:3], *material).square().mean().backward()

    return both


def speeds(pixels: int, repeats: int) -> None:
    """Print the least processor time of each over calls that take turns."""
    torch.set_num_threads(1)
    g = torch.Generator().manual_seed(0)
    up = torch.tensor([0.0, 0.0, 1.0]).expand(pixels, 3).contiguous()
    light, view = (torch.nn.functional.normalize(torch.rand(pixels, 3, generator=g) + 0.01, dim=-1) for _ in range(2))
    sigma, albedo = 0.1 + 0.7 * torch.rand(pixels, generator=g), 0.1 + 0.8 * torch.rand(pixels, 3, generator=g)
    wide = (up, light, view, sigma, albedo)
    tall = tuple(v.mT.contiguous() if v.ndim == 2 else v for v in wide)
    compiled = [torch.compile(model, fullgraph=True) for model in (by_vectors, by_components)]
    rows = {
        "by hand": (naive_oren_nayar, trained(naive_oren_nayar), wide),
        "by hand, one step": (None, stepped(naive_oren_nayar), wide),
        "vectors": (compiled[0], trained(compiled[0]), wide),
        "vectors, one step": (None, stepped(by_vectors), wide),
        "components": (compiled[1], trained(compiled[1]), tall),
        "components, one step": (None, stepped(by_components), tall),
    }
    least = {(name, k): float("inf") for name in rows for k in range(2)}
    for turn in range(repeats + 1):
        for name, (*calls, given) in rows.items():
            for k, call in enumerate(calls):
                began = time.process_time()
                with torch.set_grad_enabled(k == 1):
                    if call is not None:
                        call(*given)
                if turn and call is not None:  # the first compiles
                    least[name, k] = min(least[name, k], time.process_time() - began)
    print("| | forward | forward + backward | [ns a pixel] | [ns a pixel] |\n|---|---|---|---|---|")
    for name in rows:
        gains = [f"{least['by hand', k] / least[name, k]:.1f} x" for k in range(2)]
        spent = [f"{1e9 * least[name, k] / pixels:.1f}" for k in range(2)]
        print(f"| {name} | {' | '.join(gains + spent)} |".replace("0.0 x", "-").replace("inf", "-"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="*", default=list(every_model()))
    parser.add_argument("--one", help="compile this one here, and print JSON")
    parser.add_argument("--speed", action="store_true", help="compare speeds, and nothing else")
    parser.add_argument("--pixels", type=int, default=1 << 18)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    if options.speed:
        speeds(options.pixels, options.repeats)
        return
    if options.one:
        print(json.dumps(compile_one(options.one)))
        return
    columns = ["model", "operations", *("forward [s]", "with gradient [s]") * 2, "recompiled", "error"]
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for name in options.models:
        with tempfile.TemporaryDirectory() as cache:
            try:
                cold, warm = (in_a_process(name, cache) for _ in range(2))
            except RuntimeError as error:
                print(f"| {error} |", flush=True)
                continue
        times = [f"{k[key]:.1f} ({k[f'{key} cpu']:.1f})" for k in (cold, warm) for key in ("forward", "both")]
        again = cold["forward again"] + cold["both again"]
        worst = max(cold["forward error"], cold["both error"])
        print(f"| {name} | {cold['nodes']} | {' | '.join(times)} | {again:.0f} | {worst:.0e} |", flush=True)


if __name__ == "__main__":
    main()
