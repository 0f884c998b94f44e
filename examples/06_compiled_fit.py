"""Fit roughness and albedo of every pixel by compiled steps: loss and gradient in one function.

    python examples/06_compiled_fit.py [--pixels 16384] [--steps 200]

The step is a pure function of tensors: `functional_call` hands the model its parameters, `grad_and_value`
differentiates inside the compiled function, and nothing in the loop reads a number back. The components of the
directions lie apart in memory (`Cosines.of_components`).
"""

import argparse
import time

import torch
from torch import Tensor
from torch.func import functional_call, grad_and_value

from torchbrdf import BRDF, Cosines, OrenNayar
from torchbrdf.testing import random_directions


class Shaded(torch.nn.Module):
    """Radiance (image, pixel, channel) under white lights of irradiance 1."""

    def __init__(self, brdf: BRDF):
        super().__init__()
        self.brdf = brdf

    def forward(self, cosines: Cosines) -> Tensor:
        return self.brdf.evaluate(cosines) * cosines.light[..., None]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=1 << 14)
    parser.add_argument("--images", type=int, default=6)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--backend", default="inductor", help="of torch.compile; aot_eager generates no code")
    options = parser.parse_args()
    g = torch.Generator().manual_seed(0)
    normal, light, view = random_directions(options.images * options.pixels, generator=g)
    shape = (options.images, options.pixels)
    apart = [[part.contiguous().view(shape) for part in v.unbind(-1)] for v in (normal, light, view)]
    sigma = 0.2 + 0.5 * torch.rand(options.pixels, generator=g)
    albedo = 0.2 + 0.6 * torch.rand(options.pixels, 3, generator=g)
    with torch.no_grad():
        seen = Shaded(OrenNayar(albedo=albedo, sigma=sigma))(Cosines.of_components(*apart))

    model = Shaded(OrenNayar(albedo=torch.full_like(albedo, 0.5), sigma=torch.full_like(sigma, 0.4)))
    parameters = {name: p.detach() for name, p in model.named_parameters()}

    def loss(named: dict[str, Tensor]) -> Tensor:
        predicted = functional_call(model, named, (Cosines.of_components(*apart),))
        return (predicted - seen).square().sum() / options.pixels

    def loss_and_gradient(named: dict[str, Tensor]) -> tuple[dict[str, Tensor], Tensor]:
        return grad_and_value(loss)(named)

    step = torch.compile(loss_and_gradient, fullgraph=True, backend=options.backend)
    optimizer = torch.optim.Adam(parameters.values(), lr=0.1)
    began, losses = time.perf_counter(), []
    for _ in range(options.steps):
        gradient, value = step(parameters)
        for name, p in parameters.items():
            p.grad = gradient[name]
        optimizer.step()
        losses.append(value)  # a tensor: reading it as a number would wait for the device
    print(f"{options.steps} steps, compiling included: {time.perf_counter() - began:.1f} s")
    print(f"loss {float(losses[0]):.2e} -> {float(losses[-1]):.2e}")
    with torch.no_grad():
        for name, p in model.named_parameters():
            p.copy_(parameters[name])
        off = (model.brdf.sigma - sigma).abs().median(), (model.brdf.albedo - albedo).abs().median()
    print(f"median error of sigma {float(off[0]):.4f} rad, of albedo {float(off[1]):.4f}")


if __name__ == "__main__":
    main()
