"""Polarised He-Torrance: reference values, the vector form as printed, and what symmetry asks for."""

import math

import numpy as np
import pytest
import torch
from helpers.he_torrance_printed import Surface, amplitudes, polar, printed
from helpers.he_torrance_surfaces import GOLDEN, SURFACES, UP, directions, material, of_golden
from helpers.probes import doubles
from torch.testing import assert_close

from torchbrdf import Cosines, coherency, conductor, he_torrance, he_torrance_polarised, polarised_specular_reflectivity
from torchbrdf.models.he_torrance.perfect_reflector import Geometry
from torchbrdf.models.he_torrance.polarised import jones_matrix
from torchbrdf.testing import random_directions


def complexes(x):
    return torch.tensor(x, dtype=torch.complex128)


STATES = {name: complexes([complex(*c) for c in pair]) for name, pair in GOLDEN["states"].items()}
CASES = [case for case in GOLDEN["brdf"] if "dd_state" in case["ref"]]


def jones(light, view, index, tangent=None):
    geometry = Geometry.of(Cosines.of(UP, light, view))
    return jones_matrix(UP, light, view, geometry, eta=doubles([index.real]), k=doubles([index.imag]), tangent=tangent)[
        ..., 0, :, :
    ]


def parts(coherent):
    return coherent.diagonal(dim1=-2, dim2=-1).real


@pytest.mark.parametrize("case", CASES, ids=lambda c: c["tag"])
def test_reference_values(case):
    light, view = directions(case)
    scale = float(case["ref"]["dd"])
    rtol = 1e-10 if max(case["inp"]["theta_i"], case["inp"]["theta_r"]) < 89.99 else 1e-9
    # the frame of a direction along the normal is that of azimuth 0
    tangent = doubles([1.0, 0.0, 0.0])
    for name, expected in case["ref"]["dd_state"].items():
        got = he_torrance_polarised(
            UP, light, view, diffuse=doubles(0.0), incident=coherency(STATES[name]), tangent=tangent, **of_golden(case)
        )
        assert (parts(got)[0] - doubles([float(x) for x in expected])).abs().max() <= rtol * scale + 1e-290
    expected = complexes([[complex(*map(float, entry)) for entry in row] for row in case["ref"]["jones"]])
    got = jones(light, view, complex(*case["inp"]["n"]), tangent)
    if case["inp"]["theta_i"] > 0 and case["inp"]["theta_r"] > 0:
        assert_close(got, expected, rtol=0, atol=1e-8 if case["inp"]["theta_i"] > 89.9 else 1e-12)


@pytest.mark.parametrize("case", CASES[:8], ids=lambda c: c["tag"])
def test_specular_reference_values(case):
    light, _ = directions(case)
    for name, key in (("s", "sp_s"), ("p", "sp_p")):
        got = polarised_specular_reflectivity(light[2], incident=coherency(STATES[name]), **of_golden(case))
        expected = float(case["ref"][key])
        assert abs(float(parts(got).sum()) - expected) <= 1e-11 * expected
    got = polarised_specular_reflectivity(light[2], **of_golden(case))
    assert abs(float(parts(got).sum()) - float(case["ref"]["sp"])) <= 1e-11 * float(case["ref"]["sp"])


@pytest.mark.parametrize("surface", SURFACES)
def test_printed_vector_form(surface):
    rng = np.random.default_rng(1)
    for _ in range(10):
        light, view = (polar(rng.uniform(0.1, 1.5), rng.uniform(0, 2 * math.pi)) for _ in range(2))
        lobe, matrix = printed(light, view, surface)
        state = rng.normal(size=2) + 1j * rng.normal(size=2)
        state /= np.linalg.norm(state)
        out = matrix @ state
        got = he_torrance_polarised(
            UP,
            doubles(light.tolist()),
            doubles(view.tolist()),
            diffuse=doubles(0.0),
            incident=coherency(torch.tensor(state)),
            **material(*surface),
        )[0]
        expected = torch.tensor(lobe * np.outer(out, out.conj()))
        assert_close(got, expected, rtol=0, atol=1e-9 * lobe)


def test_unpolarised_light_is_the_unpolarised_model():
    normal, light, view = random_directions(2000, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    surface = material(0.28, 1.77, 0.6, 0.77 + 6.08j)
    got = he_torrance_polarised(normal, light, view, diffuse=doubles(0.3), **surface)
    expected = he_torrance(Cosines.of(normal, light, view), diffuse=doubles(0.3), **surface)
    assert_close(parts(got).sum(-1), expected, rtol=1e-12, atol=0)
    f = parts(polarised_specular_reflectivity(doubles([0.1, 0.8]), **{**surface, "sigma0": doubles(0.0)})).sum(-1)
    assert_close(f, conductor(doubles([[0.1], [0.8]]), eta=surface["eta"], k=surface["k"]), rtol=1e-13, atol=0)


def test_matte_light_leaves_half_and_half():
    light, view = doubles(polar(0.5, 0.0).tolist()), doubles(polar(0.8, 2.0).tolist())
    surface = material(0.0, 1.0, 0.5, 1.5)
    got = he_torrance_polarised(UP, light, view, diffuse=doubles([0.6]), incident=coherency(STATES["rcp"]), **surface)
    assert_close(got[0], 0.3 / math.pi * torch.eye(2, dtype=torch.complex128))


def test_reciprocity_of_the_jones_matrix():
    _, light, view = random_directions(500, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    light, view = (torch.cat((v[:, :2], v[:, 2:].abs()), -1) for v in (light, view))
    forth, back = jones(light, view, 0.77 + 6.08j), jones(view, light, 0.77 + 6.08j)
    expected = torch.stack((forth[:, 0, 0], -forth[:, 1, 0], -forth[:, 0, 1], forth[:, 1, 1]), -1).reshape(-1, 2, 2)
    assert_close(back, expected, rtol=0, atol=1e-12)


def test_retro_reflection_and_the_mirror_direction():
    # J_world = F_s 1 in retro-reflection; s and p of both frames then point against each other, s_r = -s_i
    index = 0.77 + 6.08j
    for theta in (0.0, 0.6, 1.5):
        light = doubles(polar(theta, 0.4).tolist())
        f_s, _ = amplitudes(1.0, index)
        back = jones(light, light, index)
        assert_close(back, torch.diag(complexes([-f_s, f_s])), rtol=0, atol=1e-14)
        mirror = light * doubles([-1.0, -1.0, 1.0])
        if theta:
            f = amplitudes(math.cos(theta), index)
            assert_close(jones(light, mirror, index), torch.diag(complexes(f)), rtol=0, atol=1e-13)


def test_dark_and_flat_below_the_horizon():
    light = doubles(polar(2.0, 0.4).tolist()).requires_grad_()
    view = doubles(polar(0.4, 0.4).tolist()).requires_grad_()
    got = he_torrance_polarised(UP, light, view, diffuse=doubles(0.3), **material(*SURFACES[0]))
    assert (got == 0).all()
    assert all((g == 0).all() for g in torch.autograd.grad(got.real.sum(), (light, view)))


def test_gradients():
    light = doubles(polar(0.9, 0.4).tolist()).requires_grad_()
    view = doubles(polar(0.7, 2.8).tolist()).requires_grad_()
    surface = {name: value.requires_grad_() for name, value in material(*Surface(0.1, 0.9, 0.5, 1.4 + 2j)).items()}
    received = coherency(STATES["ell"])

    def f(light, view, *values):
        light, view = (torch.nn.functional.normalize(v, dim=-1) for v in (light, view))
        named = dict(zip(surface, values, strict=True))
        return he_torrance_polarised(UP, light, view, diffuse=doubles(0.3), incident=received, **named)

    assert torch.autograd.gradcheck(f, (light, view, *surface.values()), check_forward_ad=True)


def test_finite_gradients_where_frames_or_planes_vanish():
    surface = {name: value.requires_grad_() for name, value in material(*SURFACES[0]).items()}
    for theta_i, theta_r, phi in ((0, 0, 0), (0, 0.5, 1), (0.5, 0, 1), (0.5, 0.5, 0), (1.57, 1.57, math.pi)):
        light = doubles(polar(theta_i, 0.0).tolist()).requires_grad_()
        view = doubles(polar(theta_r, phi).tolist()).requires_grad_()
        got = parts(he_torrance_polarised(UP, light, view, diffuse=doubles(0.3), **surface))
        assert all(g.isfinite().all() for g in torch.autograd.grad(got.sum(), (light, view, *surface.values())))
