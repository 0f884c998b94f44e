"""Stand-in for the series of (78), to be replaced: Horner sum below m* = 80, expansion about the largest term above."""

import torch
from torch import Tensor

from torchbrdf.models.he_torrance.roughness import lambert_w

_TERMS = {torch.float64: 150, torch.float32: 100}
_SWITCH = {torch.float64: 80.0, torch.float32: 40.0}
_EXPANSION = (
    (0.8333333333333334, 0.25, 0.0, -0.08333333333333333),
    (
        5.347222222222222,
        -1.4583333333333333,
        -1.3854166666666667,
        -0.3194444444444444,
        -0.10416666666666667,
        -0.08333333333333333,
        0.003472222222222222,
    ),
    (
        65.6520061728395,
        -52.135416666666664,
        -15.640625,
        5.369502314814815,
        2.504166666666667,
        0.24739583333333334,
        -0.017939814814814815,
        0.0078125,
        0.010416666666666666,
        0.0026813271604938273,
    ),
    (
        1195.4136123971193,
        -1559.2351466049383,
        46.777054398148145,
        326.8922807355967,
        40.981644241898145,
        -20.146614583333335,
        -6.349879436728395,
        -0.46142939814814815,
        0.06694878472222222,
        0.02653999485596708,
        0.019130979938271606,
        0.016087962962962964,
        -0.00022947209362139917,
    ),
    (
        28889.16229959705,
        -52299.34554237397,
        16436.93717046039,
        11286.696857049468,
        -2461.967328358089,
        -1724.2309967166602,
        -108.23853470078875,
        80.02739046826775,
        19.460075817074515,
        1.3294508610896776,
        -0.0026901684670781892,
        0.0688402215149177,
        0.06684195226766118,
        0.03924465100951646,
        -0.002294720936213992,
        -0.0007840392217200666,
    ),
    (
        870687.2526406334,
        -2015019.0703968944,
        1175427.791064855,
        268428.46636708925,
        -274893.0983391907,
        -57127.69583619671,
        24226.125671217873,
        9134.567959958928,
        271.2898267211555,
        -345.2213281711415,
        -67.94894657303206,
        -3.413237172642012,
        0.5560983358696273,
        0.2732669732992541,
        0.125351404260706,
        0.02597031984223945,
        -0.014442450126993312,
        -0.011760588325801,
        6.972813758365857e-05,
    ),
)


def series_over_g(g: Tensor, t: Tensor) -> Tensor:
    """S(g, t)/g with S = sum_m g^m exp(-g)/(m! m) exp(-t/m), for g >= 0, t >= 0 that broadcast."""
    g, t = torch.broadcast_tensors(g, t)
    tiny = torch.finfo(g.dtype).tiny
    safe = g.clamp(min=tiny**0.25)
    x = (2 * t / safe) / safe
    w = lambert_w(x.clamp(max=1e30))
    largest = safe * (w / 2).exp()
    few = largest < _SWITCH[g.dtype]
    small = g.masked_fill(~few, 1.0)
    total = torch.zeros_like(g)
    for m in range(_TERMS[g.dtype], 0, -1):
        total = (-t / m).clamp(min=-80.0 if g.dtype == torch.float32 else -700.0).exp() / m + small / (m + 1) * total
    horner = total * (-small).exp()
    many = largest.masked_fill(few, 100.0)
    v = 1 / (1 + w)
    correction = torch.zeros_like(g)
    for coefficients in reversed(_EXPANSION):
        polynomial = torch.zeros_like(v)
        for c in coefficients:
            polynomial = polynomial * v + c
        correction = (correction + polynomial) / many
    exponent = -t / many - many * (torch.expm1(-w / 2) + w / 2)
    floor = -80.0 if g.dtype == torch.float32 else -700.0
    uniform = exponent.clamp(min=floor).exp() * v.sqrt() / many * (1 + correction) / g.masked_fill(few, 1.0)
    return torch.where(few, horner, uniform)
