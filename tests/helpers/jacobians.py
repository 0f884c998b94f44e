"""The density of a sampler from how it moves its uniform numbers: no formula of the density itself."""

import torch


def density_by_differences(sampler, u, step=1e-5):
    """1/|dw/du_1 x dw/du_2| (...) of a sampler that maps u (..., 2) to unit vectors w (..., 3). [1/sr]"""
    shifts = step * torch.eye(2, dtype=u.dtype)
    first, second = ((sampler(u + shift) - sampler(u - shift)) / (2 * step) for shift in shifts)
    return 1 / torch.linalg.cross(first, second).norm(dim=-1)


def inner_numbers(count=200):
    """u (count, 2) away from the ends of [0, 1), where differences would leave it."""
    return 0.02 + 0.96 * torch.rand(count, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(11))
