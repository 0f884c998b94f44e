"""Build a rough material, look at its parts, and fit it with a plain torch optimiser.

The models are ordinary modules, so Adam, L-BFGS or anything else that takes parameters works. The
fit of this project (example 01) is faster and adds error bars.
"""

import torch

from inverse import Distant, Scene, render, vase
from torchbrdf import OrenNayar, sigma_from_degrees


def main() -> None:
    clay = OrenNayar(albedo=torch.tensor([0.75, 0.55, 0.4]), sigma=sigma_from_degrees(40))
    normal = torch.tensor([0.0, 0.0, 1.0])
    light = torch.tensor([0.6, 0.0, 0.8])
    view = torch.tensor([0.8, 0.0, 0.6])
    print("BRDF [1/sr] per channel:", clay(normal, light, view).tolist())
    for name, part in clay.components(normal, light, view).items():
        print(f"  {name:<16}", part.tolist())

    scene = Scene(vase(96, 96), [Distant.from_angle(0), Distant.from_angle(20)])
    photographs = render(scene, clay).detach()
    for optimizer_class, options, steps in (
        (torch.optim.Adam, {"lr": 0.05}, 300),
        (torch.optim.LBFGS, {"line_search_fn": "strong_wolfe"}, 10),
    ):
        model = OrenNayar(albedo=torch.full((3,), 0.5), sigma=0.3)
        optimizer = optimizer_class(model.parameters(), **options)

        def loss(model=model, optimizer=optimizer):
            optimizer.zero_grad()
            value = 1e4 * (render(scene, model) - photographs).square().mean()
            value.backward()
            return value

        for _ in range(steps):
            optimizer.step(loss)
        sigma = torch.rad2deg(model.sigma).item()
        albedo = ", ".join(f"{rho:.4f}" for rho in model.albedo.tolist())
        print(f"{optimizer_class.__name__:<6} sigma {sigma:.3f} deg (truth 40), albedo {albedo} (0.75, 0.55, 0.4)")


if __name__ == "__main__":
    main()
