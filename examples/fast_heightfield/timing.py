"""What the heightfield models cost on one core, in its own time (not the clock's): the figures of docs/heightfield.md.

python examples/fast_heightfield/timing.py
"""

import time
from collections.abc import Callable

import torch

from torchbrdf import (
    Cosines,
    FastGaussianHeightfield,
    GaussianHeightfield,
    OrenNayar,
    fast_gaussian_heightfield,
    fixed,
)
from torchbrdf.models.heightfield.direct import QUADRATURES
from torchbrdf.testing import random_directions

REPEATS = 10


def seconds(call: Callable[[], object], repeats: int = REPEATS) -> float:
    best = float("inf")
    with torch.no_grad():
        for _ in range(repeats):
            began = time.thread_time()
            call()
            best = min(best, time.thread_time() - began)
    return best


def main() -> None:
    torch.set_num_threads(1)
    count = 262_144
    directions = random_directions(count, generator=torch.Generator().manual_seed(0))
    sigma = torch.rand(count, generator=torch.Generator().manual_seed(1))
    cosines = Cosines.of(*directions)
    rows = {
        "fast heightfield, float32, sigma per pixel": lambda: fast_gaussian_heightfield(
            cosines, albedo=torch.tensor(0.5), sigma=sigma
        ),
        "the same, from vectors": lambda: FastGaussianHeightfield(sigma=fixed(sigma))(*directions),
        "functional Oren-Nayar, from vectors": lambda: OrenNayar(sigma=fixed(sigma))(*directions),
    }
    for name, call in rows.items():
        print(f"{name:45} {1e9 * seconds(call) / count:8.0f} ns a pixel")
    few = random_directions(8192, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    for nodes in QUADRATURES:
        direct = GaussianHeightfield(sigma=fixed(0.5), bounces=1, nodes=nodes).double()
        cost = seconds(lambda direct=direct: direct(*few), 3) / len(few[0])
        print(f"{f'reference, direct light, float64, {nodes} nodes':45} {1e6 * cost:8.1f} us a pixel")
    whole = GaussianHeightfield(sigma=fixed(0.5))
    single = tuple(v.float() for v in few)
    began = time.thread_time()
    with torch.no_grad():
        whole(*(v[:1] for v in single))
    print(f"{'table of bounces':45} {time.thread_time() - began:8.2f} s a material")
    print(f"{'reference, all bounces, float32':45} {1e6 * seconds(lambda: whole(*single), 3) / 8192:8.1f} us a pixel")


if __name__ == "__main__":
    main()
