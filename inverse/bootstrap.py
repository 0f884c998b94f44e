"""Error bars from refitting: what changes when other photographs had been taken."""

from typing import Any

import torch
from torch import Tensor
from tqdm import tqdm

from inverse.fit import fit
from inverse.scene import Scene
from torchbrdf import BRDF


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
    """
    if samples < 2:
        raise ValueError(f"bootstrap needs at least 2 samples; found {samples}.")
    if scene.images < 2:
        raise ValueError("bootstrap resamples images and needs at least 2; the scene has 1.")
    generator = torch.Generator().manual_seed(seed)
    found: dict[str, list[Tensor]] = {}
    for _ in tqdm(range(samples), desc="bootstrap", leave=False, disable=None):
        drawn = torch.randint(scene.images, (scene.images,), generator=generator)
        again = Scene(scene.surface, [scene.lights[k] for k in drawn.tolist()], scene.sensor)
        kept = None if valid is None else valid[drawn]
        result = fit(again, photographs[drawn], model, valid=kept, **options)
        for name, value in result.parameters.items():
            if (
                name not in ("exposure", "ambient")
                and value.shape == result.standard_error[name].shape
                and value.numel() < 64
            ):
                found.setdefault(name, []).append(value)
    return {name: torch.stack(values).std(0) for name, values in found.items()}
