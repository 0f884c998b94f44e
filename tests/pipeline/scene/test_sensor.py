"""Focus, exposure, noise statistics, quantisation and clipping."""

import math

import pytest
import torch

from inverse.scene.sensor import Sensor

D = torch.float64


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def test_ideal_sensor_only_exposes():
    radiance = torch.rand(2, 5, 6, 3, generator=generator(), dtype=D) / 4
    torch.testing.assert_close(Sensor(exposure=2.5).expose(radiance), 2.5 * radiance)


# Statistical tests compare with intervals of 4 standard deviations: a right sensor fails one with
# probability 6e-5. Seeds are fixed, so it fails always or never.
ALARM = 4.0


@pytest.mark.parametrize(("read_noise", "full_well"), [(0.01, None), (0.0, 1000.0), (0.02, 5000.0)])
@pytest.mark.parametrize("level", [0.2, 0.6])
def test_noise_has_the_stated_mean_and_variance(read_noise, full_well, level):
    count = 200_000
    sensor = Sensor(exposure=2.0, read_noise=read_noise, full_well=full_well)
    values = sensor.expose(torch.full((1, count // 100, 100, 1), level / 2, dtype=D), generator()).flatten()
    variance = read_noise**2 + (level / full_well if full_well else 0)
    assert abs(values.mean().item() - level) < ALARM * math.sqrt(variance / count)
    # the variance of Gaussian samples is known to a relative sqrt(2/count)
    assert abs(values.var().item() / variance - 1) < ALARM * math.sqrt(2 / count)
    kurtosis = ((values - values.mean()) ** 4).mean().item() / values.var().item() ** 2
    assert abs(kurtosis - 3) < ALARM * math.sqrt(24 / count)


def test_noise_is_independent_between_pixels():
    values = Sensor(read_noise=0.05).expose(torch.full((300, 300, 1), 0.5, dtype=D), generator())[..., 0] - 0.5
    for neighbour in (values.roll(1, 0), values.roll(1, 1)):
        correlation = (values * neighbour).mean().item() / 0.05**2
        assert abs(correlation) < ALARM / 300


def test_noise_repeats_with_the_seed():
    radiance = torch.full((4, 4, 3), 0.5)
    sensor = Sensor(read_noise=0.1)
    assert torch.equal(sensor.expose(radiance, generator(3)), sensor.expose(radiance, generator(3)))
    assert not torch.equal(sensor.expose(radiance, generator(3)), sensor.expose(radiance, generator(4)))


def test_darkness_has_no_shot_noise():
    assert (Sensor(full_well=100.0).expose(torch.zeros(5, 5, 1), generator()) == 0).all()


@pytest.mark.parametrize("bits", [1, 8, 12, 16])
def test_quantisation(bits):
    levels = 2**bits - 1
    signal = torch.rand(20, 20, 1, generator=generator(), dtype=D)
    values = Sensor(bits=bits).expose(signal)
    torch.testing.assert_close(values * levels, (values * levels).round(), atol=1e-9, rtol=0)
    assert (values - signal).abs().max() <= 0.5 / levels + 1e-12
    exact = torch.linspace(0, 1, min(levels, 255) + 1, dtype=D).reshape(1, -1, 1)
    if bits <= 8:
        torch.testing.assert_close(Sensor(bits=bits).expose(exact), exact)


def test_clipping():
    values = Sensor(exposure=2.0, bits=8).expose(torch.tensor([-1.0, 0.0, 0.25, 0.5, 3.0]).reshape(1, 5, 1))
    torch.testing.assert_close(values.flatten(), torch.tensor([0, 0, 128 / 255, 1, 1]))


# --- point-spread function ---------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [0.7, 1.5, 3.0])
def test_focus_keeps_energy_and_has_the_stated_width(width):
    image = torch.zeros(1, 61, 61, 1, dtype=D)
    image[0, 30, 28] = 1.0
    spot = Sensor(psf_sigma=width).focus(image)[0, :, :, 0]
    rows, columns = torch.meshgrid(torch.arange(61, dtype=D), torch.arange(61, dtype=D), indexing="ij")
    assert spot.sum().item() == pytest.approx(1, abs=1e-12)
    assert (spot * rows).sum().item() == pytest.approx(30, abs=1e-9)
    assert (spot * columns).sum().item() == pytest.approx(28, abs=1e-9)
    # Second moment of Gaussian samples one pixel apart, by Poisson's sum; the cut at 4 sigma takes 1e-3 of it.
    alias = 2 * math.exp(-2 * math.pi**2 * width**2)
    expected = (width**2 - alias * (2 * math.pi * width**2) ** 2) / (1 + alias)
    assert (spot * (rows - 30) ** 2).sum().item() == pytest.approx(expected, rel=1.2e-3)
    assert (spot * (columns - 28) ** 2).sum().item() == pytest.approx(expected, rel=1.2e-3)


def test_focus_matches_the_gaussian():
    image = torch.zeros(41, 41, 1, dtype=D)
    image[20, 20] = 1.0
    spot = Sensor(psf_sigma=2.0).focus(image)[..., 0]
    for dr, dc in ((0, 0), (1, 0), (2, 3), (-4, 1)):
        expected = math.exp(-(dr**2 + dc**2) / 8) / (2 * math.pi * 4)
        assert spot[20 + dr, 20 + dc].item() == pytest.approx(expected, rel=1e-3)


def test_focus_treats_images_and_channels_alike():
    images = torch.rand(2, 3, 16, 16, 3, generator=generator(), dtype=D)
    sensor = Sensor(psf_sigma=1.0)
    whole = sensor.focus(images)
    assert whole.shape == images.shape
    torch.testing.assert_close(whole[1, 2, ..., 1:2], sensor.focus(images[1, 2, ..., 1:2]))
    flat = torch.full((16, 16, 3), 0.3, dtype=D)
    torch.testing.assert_close(sensor.focus(flat), flat)  # borders reflect
    assert Sensor().focus(images) is images


# --- gradients ---------------------------------------------------------------------------------------------


def test_gradient_of_the_exact_parts():
    radiance = (0.1 + 0.3 * torch.rand(9, 9, 1, generator=generator(), dtype=D)).requires_grad_()
    sensor = Sensor(exposure=1.5, psf_sigma=0.8, read_noise=0.01, full_well=1000.0)
    # the same seed each time holds the drawn noise
    assert torch.autograd.gradcheck(lambda r: sensor.expose(r, generator(1)), radiance)


def test_gradient_of_clipping_and_quantisation():
    radiance = torch.tensor([-0.5, 0.3, 0.7, 1.5], dtype=D).reshape(1, 4, 1).requires_grad_()
    Sensor(bits=4).expose(radiance).sum().backward()
    assert radiance.grad is not None
    assert radiance.grad.flatten().tolist() == [0, 1, 1, 0]


def test_gradient_is_finite_in_darkness():
    radiance = torch.zeros(3, 3, 1, dtype=D, requires_grad=True)
    Sensor(full_well=100.0).expose(radiance, generator()).sum().backward()
    assert radiance.grad is not None
    assert radiance.grad.isfinite().all()


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"exposure": 0.0}, r"Sensor\.exposure must be positive and finite; found 0\.0"),
        ({"exposure": math.nan}, r"Sensor\.exposure must be positive and finite; found nan"),
        ({"psf_sigma": -1.0}, r"Sensor\.psf_sigma must not be negative \[pixel\]; found -1\.0"),
        ({"read_noise": -0.1}, r"Sensor\.read_noise must not be negative"),
        ({"full_well": 0.0}, r"Sensor\.full_well must be positive \[electrons\]; found 0\.0"),
        ({"bits": 0}, r"Sensor\.bits must be 1 to 32; found 0"),
    ],
)
def test_bad_sensor(bad, message):
    with pytest.raises(ValueError, match=message):
        Sensor(**bad)


@pytest.mark.parametrize("noise", [{"read_noise": 0.1}, {"full_well": 100.0}])
def test_noise_needs_a_generator(noise):
    with pytest.raises(ValueError, match=r"a noisy Sensor needs a torch\.Generator"):
        Sensor(**noise).expose(torch.full((2, 2, 1), 0.5))
