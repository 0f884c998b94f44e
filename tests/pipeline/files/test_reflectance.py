"""Readers of measured reflectance and optical constants, on files written here."""

import math

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from inverse.files.reflectance import read_gonioreflectometer, read_merl, read_optical_constants
from torchbrdf.testing import random_directions

ANGLES = "# num wls\n2\n# wls\n450 650\n\n# theta i\n0.5 0.0 1.0 3.0 0.25 0.5\n0.0 0.0 0.2 0.1 0.125 1.0  # last\n"


def write(folder, text):
    path = folder / "file"
    path.write_bytes(text) if isinstance(text, bytes) else path.write_text(text)
    return path


def test_gonioreflectometer(tmp_path):
    m = read_gonioreflectometer(write(tmp_path, ANGLES))
    assert m.wavelengths.tolist() == [450, 650]
    assert m.values.tolist() == [[0.25, 0.5], [0.125, 1.0]]
    cosines = m.cosines()
    expected = math.sin(0.5) * math.sin(1.0) * math.cos(3.0) + math.cos(0.5) * math.cos(1.0)
    assert float(cosines.light[0]) == pytest.approx(math.cos(0.5))
    assert float(cosines.view[0]) == pytest.approx(math.cos(1.0))
    assert float(cosines.phase[0]) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "announces 0 wavelengths"),
        ("2\n450 650\n0.5 0 1 3 0.25", r"rows have 6 numbers; found 5"),
        ("2\n450 650\n0.5 0 1 3 0.25 x", "could not convert"),
        ("1\n450\n2.5 0 1 3 0.25", r"polar angles must lie in \[0, 1.571\]"),
        ("1\n450\n0.5 0 1 3 nan", "finite"),
        ("1.5\n450\n0.5 0 1 3 1", "announces 1"),
        ("1\nnan\n0.5 0 1 3 1", "wavelengths must be finite and positive"),
        ("1\n0\n0.5 0 1 3 1", "wavelengths must be finite and positive"),
    ],
)
def test_gonioreflectometer_refuses(tmp_path, text, match):
    with pytest.raises(ValueError, match=match):
        read_gonioreflectometer(write(tmp_path, text))


def merl(values):
    """Bytes of a MERL file of values (channel, theta_h, theta_d, phi_d)."""
    return np.array(values.shape[1:], "<i4").tobytes() + values.astype("<f8").tobytes()


def test_merl(tmp_path):
    scale = np.array([1, 1.15, 1.66]) / 1500
    h, d, _p = np.meshgrid(np.arange(8) / 8, np.arange(6) / 6, np.arange(12) / 12, indexing="ij")
    # linear in the angles where the nodes are: theta_h = h^2 pi/2, theta_d = d pi/2
    values = np.stack([np.full_like(h, 0.3), 0.1 + h**2, 0.2 + d]) / scale[:, None, None, None]
    brdf = read_merl(write(tmp_path, merl(values)))
    normal, light, view = random_directions(200, max_angle=0.9, generator=torch.Generator().manual_seed(0))
    half = torch.nn.functional.normalize(light + view, dim=-1)
    theta_h, theta_d = ((half * v).sum(-1).clamp(max=1).acos() * 2 / math.pi for v in (normal, light))
    got = brdf(normal, light, view)
    inside = (theta_h < 49 / 64) & (theta_d < 5 / 6)
    assert_close(got[:, 0], torch.full_like(theta_h, 0.3), rtol=1e-5, atol=0)
    assert_close(got[inside, 1], (0.1 + theta_h)[inside], rtol=1e-3, atol=1e-3)
    assert_close(got[inside, 2], (0.2 + theta_d)[inside], rtol=1e-3, atol=1e-3)
    values[:, 0, 0, 0] = -1.0
    assert float(read_merl(write(tmp_path, merl(values))).values[0, 0, 0].sum()) == 0


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"short", "5 bytes, its header alone has 12"),
        (merl(np.zeros((3, 2, 2, 2)))[:-1], "found 203"),
        (merl(np.zeros((3, 2, 2, 3))), "with an even third"),
        (merl(np.full((3, 2, 2, 2), np.nan)), "24 of 24 values are not finite"),
    ],
)
def test_merl_refuses(tmp_path, data, match):
    with pytest.raises(ValueError, match=match):
        read_merl(write(tmp_path, data))


TABLE = (
    "DATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.0 3.0\n        0.6 2.0 4.0\n"
    "CONDITIONS:\n    temperature: 3\n"
)
SAPPHIRE = (
    "DATA:\n  - type: formula 1\n    wavelength_range: 0.2652 5.577\n"
    "    coefficients: 0 1.023798 0.06144821 1.058264 0.1106997 5.280792 17.92656\n"
)
RUTILE = (
    "DATA:\n  - type: formula 4\n    wavelength_range: 0.43 1.53\n    coefficients: 5.913 0.2441 0 0.0803 1 0 0 0 1\n"
)


def test_optical_constants(tmp_path):
    n, k = read_optical_constants(write(tmp_path, TABLE), torch.tensor([400.0, 500.0, 550.0]))
    assert_close(n, torch.tensor([1.0, 1.5, 1.75]))
    assert_close(k, torch.tensor([3.0, 3.5, 3.75]))
    # sodium light: the ordinary indices of sapphire and rutile as handbooks give them
    line = torch.tensor([589.3], dtype=torch.float64)
    n, k = read_optical_constants(write(tmp_path, SAPPHIRE), line)
    assert float(n) == pytest.approx(1.768, abs=1e-3)
    assert float(k) == 0
    n, _ = read_optical_constants(write(tmp_path, RUTILE), line)
    assert float(n) == pytest.approx(math.sqrt(5.913 + 0.2441 / (0.5893**2 - 0.0803)))
    assert float(n) == pytest.approx(2.61, abs=0.01)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("nothing", "no refractive index found"),
        (TABLE.replace("0.6 2.0", "0.6 x"), "could not convert"),
        (TABLE.replace("0.6", "0.49"), "covers 400 to 490 nm"),
        (TABLE.replace("tabulated nk", "tabulated n2"), "type 'tabulated n2' is not an index"),
        (SAPPHIRE.replace("coefficients", "numbers"), "coefficients is missing"),
        (TABLE.replace("0.6 2.0", "0.6 nan"), "a table must be finite"),
        (TABLE.replace("0.6 2.0 4.0", "0.6 2.0 4.0\n        0.5 2.0 4.0"), "its wavelengths increasing"),
        (TABLE.replace("0.4 1.0 3.0", "0.4 -3.0 3.0"), "n must be finite and above 0"),
        (TABLE.replace("0.4 1.0 3.0", "0.4 1.0 -9.0"), "k finite and not below it"),
        (SAPPHIRE.replace("0.06144821", "0.5"), r"n must be .*not so at \[500\.\] nm"),  # a pole of formula 1
        (SAPPHIRE.replace("0 1.023798", "-9 1.023798"), "n must be"),  # n^2 below 0
    ],
)
def test_optical_constants_refuse(tmp_path, text, match):
    with pytest.raises(ValueError, match=match):
        read_optical_constants(write(tmp_path, text), torch.tensor([500.0]))
