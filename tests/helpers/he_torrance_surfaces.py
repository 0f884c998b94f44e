"""Materials, directions and recorded values that the tests of the He-Torrance model share."""

import math

import torch

from helpers.he_torrance_printed import Surface, polar
from helpers.probes import doubles
from helpers.recorded import recorded
from torchbrdf import Cosines, he_torrance

GOLDEN = recorded("he_torrance.json")
UP = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)


def material(sigma0, tau, wavelength, index):
    index = complex(index)
    return {
        "sigma0": doubles(sigma0),
        "tau": doubles(tau),
        "wavelength": doubles([wavelength]),
        "eta": doubles([index.real]),
        "k": doubles([index.imag]),
    }


def of_golden(case):
    i = case["inp"]
    return material(i["sigma0"], i["tau"], i["lam"], complex(*i["n"]))


def directions(case):
    i = case["inp"]
    return tuple(
        doubles(polar(math.radians(i[f"theta_{x}"]), math.radians(i[f"phi_{x}"])).tolist()) for x in ("i", "r")
    )


def lobe(light, view, **surface):
    """Directional-diffuse part for the normal z, (channel,)."""
    return he_torrance(Cosines.of(UP, light, view), diffuse=doubles(0.0), **surface)


def close(got, expected, rtol):
    # 1e-290: values that underflow float64 on the way
    assert abs(float(got) - float(expected)) <= rtol * abs(float(expected)) + 1e-290


SURFACES = [
    Surface(0.28, 1.77, 0.5, 0.77 + 6.08j),
    Surface(0.28, 1.77, 2.0, 2.15 + 20.7j),
    Surface(4.4, 1.0, 0.55, 1.5 + 0j),
    Surface(1.45, 13.2, 0.5, 1.74 + 0.3j),
]
