"""Forward time of every model of the library relative to Lambert's: the column "cost" of docs/models.md.

Default settings, float32, eager. One thread: OMP_NUM_THREADS=1 python examples/benchmarks/cost_of_models.py
"""

import argparse
import inspect

import torch

import torchbrdf
from torchbrdf import BRDF, Cosines
from torchbrdf.accuracy import forward_ratios
from torchbrdf.testing import random_directions

# A point reads as much of a table of few sites as of a large one.
QUICKLY_BUILT = torchbrdf.TableGrid(depth=12, apart=10, slant=7, sigmas=8, albedos=7, images=20)


def every_model() -> dict[str, BRDF]:
    """One of each public model, Lambert first; those that are made of other models left out."""
    models: dict[str, BRDF] = {"Lambert": torchbrdf.Lambert()}
    for name in torchbrdf.__all__:
        kind = getattr(torchbrdf, name)
        if not (isinstance(kind, type) and issubclass(kind, BRDF)) or inspect.isabstract(kind):
            continue
        if kind is torchbrdf.TabulatedBRDF:
            models[name] = kind.of(torchbrdf.EON(), dtype=torch.float32)
        elif kind is torchbrdf.TabulatedRoughSurface:
            models[name] = kind(weights=torch.full((16,), 1 / 16))
        elif kind in (torchbrdf.InterpolatedRoughSurface, torchbrdf.InterpolatedGaussianHeightfield):
            models[name] = kind(grid=QUICKLY_BUILT)
        elif kind is torchbrdf.HeTorrance:  # Figure 8 of the paper, lengths in um
            models[name] = kind(sigma0=0.28, tau=1.77, wavelength=0.5, eta=0.77, k=6.08)
        elif kind not in (torchbrdf.Oriented, torchbrdf.WeightedSum):
            models[name] = kind()
    return models


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=1 << 14)
    parser.add_argument("--device", default="cpu", help="where to time")
    args = parser.parse_args()
    directions = random_directions(args.points, generator=torch.Generator().manual_seed(0))
    normal, light, view = (d.to(args.device) for d in directions)
    cosines = Cosines.of(normal, light, view, tangent=torch.linalg.cross(normal, normal.roll(1, -1)))
    models = {name: model.to(args.device) for name, model in every_model().items()}
    for name, ratio in forward_ratios(models, cosines).items():
        print(f"{name:<32}{float(f'{ratio:.2g}'):8g} x")


if __name__ == "__main__":
    main()
