"""Rays that meet most of what stands at the origin."""

import torch

D = torch.float64


def rays(count, seed=0):
    """From a sphere of radius 4 towards points near the origin."""
    generator = torch.Generator().manual_seed(seed)
    origin = 4 * torch.nn.functional.normalize(torch.randn(count, 3, dtype=D, generator=generator), dim=-1)
    target = 0.6 * torch.randn(count, 3, dtype=D, generator=generator)
    return origin, torch.nn.functional.normalize(target - origin, dim=-1)
