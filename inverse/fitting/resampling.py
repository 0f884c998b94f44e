"""Error bars from refitting: what changes when other photographs had been taken."""

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor
from tqdm import tqdm

from inverse.fitting.photographs import fit
from inverse.fitting.unknowns import shared_parameters
from inverse.scene import Scene
from torchbrdf import BRDF

# Two images allow three samples, of which two hold one image only.
_FEWEST_IMAGES = 3


def bootstrap(
    scene: Scene,
    photographs: Tensor,
    model: BRDF,
    *,
    samples: int,
    seed: int = 0,
    valid: Tensor | None = None,
    **options: Any,
) -> dict[str, Tensor]:
    """Standard deviation of each shared parameter over refits to images drawn with replacement.

    The formal error of a fit assumes independent noise in every pixel. Errors of lights, geometry and
    model are shared by all pixels of an image; resampling whole images shows their share.

    Args:
        samples: number of refits, at least 2.
        valid: as in `fit`; it is resampled with the images.
        options: further arguments of `fit`.
    Returns: by parameter name, in the parameter's unit. A parameter that a fit gives per texel is left out.
    Raises: ValueError for too few samples or images, and when fewer than half of the refits determined
        the parameters; the others are left out.
    """
    if samples < 2:
        raise ValueError(f"bootstrap needs at least 2 samples; found {samples}.")
    if scene.images < _FEWEST_IMAGES:
        raise ValueError(f"bootstrap resamples images and needs at least {_FEWEST_IMAGES}; found {scene.images}.")
    settings: dict[str, Any] = options | {"throw": False}
    generator = torch.Generator().manual_seed(seed)
    refits: dict[str, list[Tensor]] = {name: [] for name in shared_parameters(model)}
    refused: list[str] = []
    used = 0
    for _ in tqdm(range(samples), desc="bootstrap", leave=False, disable=None):
        drawn = torch.zeros(scene.images, dtype=torch.long)
        while len(drawn.unique()) < 2:  # one image over and over would say what that image says
            drawn = torch.randint(scene.images, (scene.images,), generator=generator)
        again = replace(scene, lights=[scene.lights[k] for k in drawn.tolist()])
        kept = None if valid is None else valid[drawn]
        result = fit(again, photographs[drawn], model, valid=kept, **settings)
        if result.status not in ("converged", "at bound"):
            refused.append(f"{result.status}: {result.reason}")
            continue
        used += 1
        for name, values in refits.items():
            values.append(result.parameters[name])
    if used < max(2, samples / 2):
        raise ValueError(f"only {used} of {samples} bootstrap refits determined the parameters; {refused[0]}.")
    return {name: torch.stack(values).std(0) for name, values in refits.items()}
