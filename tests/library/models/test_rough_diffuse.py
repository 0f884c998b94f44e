"""Fujii-Oren-Nayar and EON: albedos, inversions, and one without the other."""

import pytest
import torch
from helpers.probes import COS, albedo, doubles, few, held
from helpers.two_channels import D, number
from numpy.polynomial.legendre import leggauss
from torch.testing import assert_close

from torchbrdf import EON, FujiiOrenNayar, Lambert, eon_albedo_from_directional, eon_albedo_from_white_sky, fixed
from torchbrdf.testing import random_directions


def white_sky(brdf, nodes=40):
    x, w = leggauss(nodes)
    return sum(float(wi) * c * albedo(brdf, c, 24) for c, wi in zip((1 + x) / 2, w, strict=True))


@pytest.mark.parametrize("r", [0.0, 0.4, 1.0])
def test_fon_and_eon_albedos(r):
    fon, eon = FujiiOrenNayar(albedo=held(0.8), roughness=held(r)), EON(albedo=held(0.8), roughness=held(r))
    white = EON(albedo=held(1.0), roughness=held(r))
    for c in COS:
        for brdf in (fon, eon):
            assert albedo(brdf, c) == pytest.approx(float(brdf.directional_albedo(doubles(c))), abs=1e-5)
        assert float(white.directional_albedo(doubles(c))) == pytest.approx(1.0, abs=1e-14)
        fitted = EON(albedo=held(1.0), roughness=held(r), exact=False)
        assert albedo(fitted, c) == pytest.approx(1.0, abs=5e-4)
    if r == 0:
        assert_close(eon(*few()), Lambert(albedo=held(0.8))(*few()))


@pytest.mark.parametrize("target", [0.1, 0.6, 0.99])
def test_eon_inversions(target):
    r = doubles(0.7)
    rho = eon_albedo_from_white_sky(doubles(target), roughness=r)
    brdf = EON(albedo=fixed(rho), roughness=fixed(r))
    assert float(brdf.average_albedo()) == pytest.approx(target, rel=1e-12)
    assert white_sky(brdf) == pytest.approx(target, rel=1e-4)
    for c in COS:
        rho = eon_albedo_from_directional(doubles(target), doubles(c), roughness=r)
        brdf = EON(albedo=fixed(rho), roughness=fixed(r))
        assert float(brdf.directional_albedo(doubles(c))) == pytest.approx(target, rel=1e-12)


def test_eon_without_its_returned_light_is_fujii():
    eon = EON(albedo=number([0.7, 0.4]), roughness=fixed(number(0.6)))
    smooth, fujii = eon.stand_ins()["rung"]
    directions = random_directions(50, dtype=D, generator=torch.Generator().manual_seed(3))
    assert smooth.skips == ("roughness", "interreflection in cavities")
    torch.testing.assert_close(smooth.model(*directions), Lambert(albedo=eon.albedo.detach())(*directions))
    assert fujii.skips == ("interreflection in cavities",)
    torch.testing.assert_close(fujii.model(*directions), eon.components(*directions)["direct"])
    assert [name for name, _ in fujii.model.named_parameters()] == ["raw_albedo"]
    assert [k.choice for k in fujii.model.stand_ins()["rung"]] == ["Lambert"]
