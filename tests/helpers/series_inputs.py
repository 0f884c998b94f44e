"""Where the tests of the D series evaluate it, and how far it may be off."""

import torch

from torchbrdf.models.he_torrance.series import series_over_g

F32, F64 = torch.float32, torch.float64


def bar(dtype, g, S):
    """What the relative error may be; in float32 an exponent of 60 carries 60 eps."""
    if dtype == F64:
        return torch.full_like(S, 1e-9)
    return 1e-6 + 3 * torch.finfo(F32).eps * (1 + (g.log() + S.log()).abs())


def at(m, w, dtype=F64):
    m, w = torch.as_tensor(m, dtype=F64), torch.as_tensor(w, dtype=F64)
    return (m * torch.exp(-w / 2)).to(dtype), (m**2 * w / 2).to(dtype)


def with_slopes(g, t):
    """S/g and its derivatives by g and t."""
    g, t = g.clone().requires_grad_(), t.clone().requires_grad_()
    value = series_over_g(g, t)
    by_g, by_t = torch.autograd.grad(value.sum(), (g, t))
    return value.detach(), by_g, by_t


def scattered(n, dtype, *, g=(-8.0, 6.0), t=(-3.0, 1.0), seed=0):
    """Random g, and t in proportion to max(g, 1), log-uniform between the powers of ten; every tenth t is 0."""
    u, v = torch.rand(2, n, dtype=F64, generator=torch.Generator().manual_seed(seed))
    g_values = 10 ** (g[0] + (g[1] - g[0]) * u)
    t_values = g_values.clamp(min=1) * 10 ** (t[0] + (t[1] - t[0]) * v)
    t_values[::10] = 0
    return g_values.to(dtype), t_values.to(dtype)
