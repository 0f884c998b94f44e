"""What each model costs: time per million evaluations, relative to Lambert in the same run."""

import argparse
import statistics
import time
from collections.abc import Callable

import torch

from torchbrdf import Cosines, Lambert, OrenNayar, QualitativeOrenNayar
from torchbrdf.testing import random_directions


def interleaved_medians(calls: dict[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Median seconds of each call; the calls take turns, so that a slower minute slows them all."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    for _ in range(repeats):
        for name, call in calls.items():
            began = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - began)
    return {name: statistics.median(found) for name, found in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--no-compile", action="store_true", help="eager only (compiling takes a minute)")
    args = parser.parse_args()
    normal, light, view = random_directions(args.points, generator=torch.Generator().manual_seed(0))
    light.requires_grad_()
    print(f"{args.points} points, float32, {torch.get_num_threads()} threads, torch {torch.__version__}")
    print(f"{'':<32}{'forward':>20}{'forward+backward':>24}")
    for mode in ["eager"] if args.no_compile else ["eager", "compiled"]:
        forward, backward = {}, {}
        for model in (Lambert(), QualitativeOrenNayar(), OrenNayar()):

            def evaluate(model=model):
                return model.evaluate(Cosines.of(normal, light, view))

            run = torch.compile(evaluate, fullgraph=True) if mode == "compiled" else evaluate
            forward[type(model).__name__] = torch.no_grad()(run)
            backward[type(model).__name__] = lambda run=run: run().sum().backward()
        columns = [interleaved_medians(calls, args.repeats) for calls in (forward, backward)]
        for name in forward:
            cells = [f"{1e3 * found[name]:9.1f} ms {found[name] / found['Lambert']:6.2f} x" for found in columns]
            print(f"{mode:<10}{name:<22}{cells[0]:>20}{cells[1]:>24}")


if __name__ == "__main__":
    main()
