"""The He-Torrance model in floating point: derivatives, extremes, float32."""

import math

import pytest
import torch
from test_he_torrance import doubles, material
from torch.testing import assert_close

from torchbrdf import Cosines, HeTorrance, fixed, he_torrance, specular_reflectivity
from torchbrdf.models.he_torrance.reflectance import directional_diffuse, unchecked_specular_reflectivity
from torchbrdf.models.he_torrance.specular import averaged_specular
from torchbrdf.testing import hard_directions, random_directions

BOX = [
    # sigma0, tau, wavelength, index
    (0.02, 0.4, 0.5, 1.5 + 0.01j),
    (0.1, 1.0, 0.5, 0.2 + 3.5j),
    (0.28, 1.77, 0.5, 0.77 + 6.08j),
    (0.28, 1.77, 2.0, 2.15 + 20.7j),
    (2.0, 9.0, 0.5, 1.74 + 0.2j),
    (4.4, 1.0, 0.55, 1.5 + 0.1j),
]


def log_uniform(low, high, n, generator, dtype):
    u = torch.rand(n, dtype=torch.float64, generator=generator)
    return (math.log(low) + u * math.log(high / low)).exp().to(dtype)


@pytest.mark.parametrize("parameters", BOX)
def test_derivatives(parameters):
    # with respect to everything, at random and in the directions where formulas change
    surface = {name: value.requires_grad_() for name, value in material(*parameters).items()}
    generator = torch.Generator().manual_seed(0)
    vectors = [v.requires_grad_() for v in random_directions(2, dtype=torch.float64, generator=generator)]

    def f(normal, light, view, diffuse, *values):
        cosines = Cosines.of(normal, light, view, normalize=True)
        return he_torrance(cosines, diffuse=diffuse, **dict(zip(surface, values, strict=True)))

    inputs = (*vectors, doubles([0.2]).requires_grad_(), *surface.values())
    assert torch.autograd.gradcheck(f, inputs, eps=1e-6, atol=1e-6, rtol=1e-5, check_forward_ad=True)


def test_derivatives_at_sigma0_zero():
    # even in sigma0: the unchecked function continues to negative ones
    surface = material(0.0, 1.0, 0.5, 1.5 + 0.1j)
    sigma0 = surface.pop("sigma0").requires_grad_()
    cosines = Cosines.of(*random_directions(4, dtype=torch.float64, generator=torch.Generator().manual_seed(0)))
    assert torch.autograd.gradcheck(lambda s: directional_diffuse(cosines, sigma0=s, **surface), sigma0)
    assert torch.autograd.gradcheck(
        lambda s: unchecked_specular_reflectivity(cosines.light, sigma0=s, **surface), sigma0
    )
    assert torch.autograd.gradgradcheck(lambda s: directional_diffuse(cosines, sigma0=s, **surface), sigma0)


def test_only_ratios_of_lengths_count():
    # raw lengths are logarithms: what one unit more for all of them changes is nothing
    surface = material(0.05, 0.7, 0.5, 0.77 + 6.08j)
    model = HeTorrance(**surface, diffuse=doubles([0.02]), solid_angle=0.5)
    f = model(*random_directions(50, dtype=torch.float64, generator=torch.Generator().manual_seed(0))).sum()
    raw = [model.raw_sigma0, model.raw_tau, model.raw_wavelength]
    slopes = torch.stack([g.sum() for g in torch.autograd.grad(f, raw)])
    assert slopes.sum().abs() < 1e-9 * slopes.abs().max()


def test_derivatives_of_the_specular_part_and_of_the_albedo():
    surface = {name: value.requires_grad_() for name, value in material(0.05, 0.7, 0.5, 0.77 + 6.08j).items()}
    theta = doubles([0.5, 0.9])
    offset = doubles([0.1, 0.3])
    light = torch.stack((theta.sin(), 0 * theta, theta.cos()), -1).requires_grad_()
    view = torch.stack((-(theta + offset).sin(), 0.1 + 0 * theta, (theta + offset).cos()), -1).requires_grad_()
    up = doubles([0.0, 0.0, 1.0])

    def averaged(light, view, *values):
        cosines = Cosines.of(up, light, view, normalize=True)
        return averaged_specular(cosines, solid_angle=0.5, **dict(zip(surface, values, strict=True)))

    assert torch.autograd.gradcheck(averaged, (light, view, *surface.values()), check_forward_ad=True)
    model = HeTorrance(**{name: value.detach() for name, value in surface.items()}, diffuse=doubles([0.02]))
    names = [name for name, _ in model.named_parameters()]

    def albedo(cos, *values):
        named = dict(zip(names, values, strict=True))
        return torch.func.functional_call(Albedo(model), {f"brdf.{name}": v for name, v in named.items()}, (cos,))

    inputs = (doubles([0.3, 0.8]).requires_grad_(), *(p.detach().requires_grad_() for p in model.parameters()))
    assert torch.autograd.gradcheck(albedo, inputs, eps=1e-5, atol=1e-6)


class Albedo(torch.nn.Module):
    def __init__(self, brdf):
        super().__init__()
        self.brdf = brdf

    def forward(self, cos):
        return self.brdf.directional_albedo(cos, nodes=12)


def extreme_vectors(n, dtype, generator):
    """Anywhere above the horizon, a third of it grazing, some in retro, mirror or normal directions."""
    u = torch.rand(n, 4, dtype=torch.float64, generator=generator)
    kind = torch.randint(0, 6, (n,), generator=generator)
    near = 10 ** (-12 * torch.rand(n, 2, dtype=torch.float64, generator=generator))
    theta = [u[:, i] * math.pi / 2 for i in range(2)]
    theta = [torch.where(kind == i, math.pi / 2 - near[:, i], theta[i]) for i in range(2)]
    theta[1] = torch.where((kind == 2) | (kind == 3), theta[0], theta[1])
    theta = [torch.where(kind == 4 + i, near[:, i], theta[i]) for i in range(2)]
    phi = [2 * math.pi * u[:, 2 + i] for i in range(2)]
    phi[1] = torch.where(kind == 2, phi[0], torch.where(kind == 3, phi[0] + math.pi, phi[1]))
    vectors = [
        torch.stack((t.sin() * p.cos(), t.sin() * p.sin(), t.cos()), -1).to(dtype)
        for t, p in zip(theta, phi, strict=True)
    ]
    return vectors[0].requires_grad_(), vectors[1].requires_grad_()


def assert_finite_everywhere(n, dtype, seed):
    generator = torch.Generator().manual_seed(seed)
    light, view = extreme_vectors(n, dtype, generator)
    wavelength = doubles([0.5]).to(dtype)
    sigma0 = log_uniform(1e-7, 5e3, n, generator, dtype)
    # half of the slopes in the range of surfaces, half from mirrors to needles
    ratio = torch.where(
        torch.arange(n) % 2 == 0, log_uniform(0.01, 5, n, generator, dtype), log_uniform(1e-6, 1e2, n, generator, dtype)
    )
    sigma0[::50] = 0.0
    tau = (sigma0 / ratio).clamp(min=1e-3, max=1e6)
    eta, k = log_uniform(1e-2, 1e2, n, generator, dtype)[:, None], log_uniform(1e-3, 1e2, n, generator, dtype)[:, None]
    k[::7] = 0.0
    surface = {"sigma0": sigma0, "tau": tau, "wavelength": wavelength, "eta": eta, "k": k}
    surface = {name: value.requires_grad_() for name, value in surface.items()}
    up = torch.tensor([0.0, 0.0, 1.0], dtype=dtype)
    cosines = Cosines.of(up, light, view, normalize=True)
    for what, f in (
        ("directional diffuse", he_torrance(cosines, diffuse=torch.tensor([0.1], dtype=dtype), **surface)),
        ("mirror", specular_reflectivity(cosines.light, **surface)),
        ("specular", cosines.zero_below_horizon(averaged_specular(cosines, solid_angle=0.1, **surface))),
    ):
        assert f.isfinite().all(), what
        assert (f >= 0).all(), what
        for name, g in zip(
            ("light", "view", *surface),
            torch.autograd.grad(f.sum(), (light, view, *surface.values()), allow_unused=True, retain_graph=True),
            strict=True,
        ):
            assert g is None or g.isfinite().all(), f"{what}: gradient to {name}"


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_finite_for_random_and_extreme_inputs(dtype):
    assert_finite_everywhere(100_000, dtype, 0)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_finite_for_ten_million_inputs(dtype):
    for seed in range(100):
        assert_finite_everywhere(100_000, dtype, seed)


@pytest.mark.parametrize("parameters", BOX)
def test_float32(parameters):
    # an exponent of x carries x rounding errors of its argument, which is what |ln f| stands for
    single = {name: value.float() for name, value in material(*parameters).items()}
    directions = random_directions(20_000, generator=torch.Generator().manual_seed(0))
    exact = {name: value.double() for name, value in single.items()}
    upcast = [torch.nn.functional.normalize(v.double(), dim=-1) for v in directions]
    f = directional_diffuse(Cosines.of(*directions), **single)
    reference = directional_diffuse(Cosines.of(*upcast), **exact)
    assert f.dtype == torch.float32
    held = reference > 1e-25
    error = (f.double() / reference - 1)[held].abs()
    allowed = 3e-6 + 8 * torch.finfo(torch.float32).eps * reference[held].log().abs()
    assert (error <= allowed).all(), (error / allowed).max()
    # the mirror share: e^-g
    cos = upcast[1][:, 2].abs().float()
    got, expected = specular_reflectivity(cos, **single), specular_reflectivity(cos.double(), **exact)
    held = expected > 1e-25
    error = (got.double() / expected - 1)[held].abs()
    assert (error <= 3e-6 + 8 * torch.finfo(torch.float32).eps * expected[held].log().abs()).all()


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_reciprocal_in_hard_directions(dtype):
    surface = {name: value.to(dtype) for name, value in material(0.28, 1.77, 0.5, 0.77 + 6.08j).items()}
    for normal, light, view in hard_directions(dtype).values():
        forth = he_torrance(Cosines.of(normal, light, view), diffuse=torch.zeros((), dtype=dtype), **surface)
        back = he_torrance(Cosines.of(normal, view, light), diffuse=torch.zeros((), dtype=dtype), **surface)
        assert_close(forth, back, rtol=2e-4 if dtype == torch.float32 else 1e-11, atol=1e-30)


def test_shapes():
    directions = random_directions(6, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    per_pixel = {"sigma0": torch.linspace(0.1, 0.6, 6).double(), "tau": torch.linspace(1.0, 2.0, 6).double()}
    channels = {"wavelength": doubles([0.6, 0.5, 0.4]), "eta": doubles([1.5, 1.6, 1.7]), "k": doubles(0.0)}
    cosines = Cosines.of(*directions)
    together = he_torrance(cosines, diffuse=doubles(0.1), **per_pixel, **channels)
    assert together.shape == (6, 3)
    for i in range(6):
        one = Cosines.of(*(v[i] for v in directions))
        alone = he_torrance(one, diffuse=doubles(0.1), **{n: v[i] for n, v in per_pixel.items()}, **channels)
        assert_close(together[i], alone, rtol=1e-13, atol=0)
    model = HeTorrance(**{n: fixed(v) for n, v in (per_pixel | channels).items()})
    assert model.directional_albedo(doubles([0.5] * 6), nodes=8).shape == (6, 3)
    with pytest.raises(ValueError, match="parameters are per pixel"):
        model.energy_bound()
