"""What compiling costs, model by model: seconds until the first value and until the first gradient.

    python examples/benchmarks/compiled.py [--models OrenNayar GGX ...]

Each model is compiled in a process of its own, once with an empty cache on disk and once with the one that the first
left; as one graph of any size, which a second size must not compile again. Seconds on the clock, and of the processor
with the compilers it starts, which a busy machine does not lengthen; the import of torch's compiler is left out.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time

import torch
import torch._dynamo
import torch._inductor.compile_fx
from cost_of_models import every_model
from torch._dynamo.utils import counters

from torchbrdf import Oriented
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="*", default=list(every_model()))
    parser.add_argument("--one", help="compile this one here, and print JSON")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(compile_one(options.one)))
        return
    print("| model | operations | forward [s] | with gradient [s] | from disk [s] | with gradient [s] | recompiled |")
    print("|---|---|---|---|---|---|---|")
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
        print(f"| {name} | {cold['nodes']} | {' | '.join(times)} | {again:.0f} | {worst:.1e}", flush=True)


if __name__ == "__main__":
    main()
