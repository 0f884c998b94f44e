"""Images on disk: every bit arrives, and what cannot be read says why."""

import struct
from pathlib import Path

import kornia_rs
import numpy as np
import pytest
import tifffile
import torch
from helpers.png_files import png_bytes
from PIL import Image

from inverse import read_image, write_image

GRAY_SPHERE = Path(__file__).parents[4] / "shared" / "data" / "gray_sphere"


def samples(bits: int, channels: int) -> np.ndarray:
    values = np.random.default_rng(0).integers(0, 2**bits, (5, 7, channels))
    return values.astype(np.uint8 if bits == 8 else np.uint16)


def assert_reads(path: Path, array: np.ndarray) -> None:
    """The tensor is the array over its full scale, to half a level of 24 bits."""
    image = read_image(path)
    assert image.dtype == torch.float32
    expected = array.astype(np.float64) / np.iinfo(array.dtype).max
    np.testing.assert_allclose(image.numpy(), expected, rtol=0, atol=2.0**-24)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_png_of_16_bits_arrives_as_16_bits(tmp_path, channels):
    array = samples(16, channels)
    (tmp_path / "a.png").write_bytes(png_bytes(array))
    assert_reads(tmp_path / "a.png", array[..., :3])


@pytest.mark.parametrize("suffix", ["png", "tga", "tif"])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_8_bits(tmp_path, suffix, channels):
    array = samples(8, channels)
    Image.fromarray(array[..., 0] if channels == 1 else array).save(tmp_path / f"a.{suffix}")
    assert_reads(tmp_path / f"a.{suffix}", array[..., : 1 if channels == 1 else 3])


@pytest.mark.parametrize(
    "layout", [{}, {"byteorder": ">"}, {"compression": "zlib"}, {"planarconfig": "separate"}], ids=str
)
def test_tiff_of_16_bits(tmp_path, layout):
    array = samples(16, 3)
    stored = np.moveaxis(array, -1, 0) if "planarconfig" in layout else array
    tifffile.imwrite(tmp_path / "a.tif", stored, photometric="rgb", **layout)
    assert_reads(tmp_path / "a.tif", array)


def test_compressed_tga_and_tiff(tmp_path):
    array = samples(8, 3)
    Image.fromarray(array).save(tmp_path / "a.tga", compression="tga_rle")
    Image.fromarray(array).save(tmp_path / "a.tiff", compression="tiff_lzw")
    assert_reads(tmp_path / "a.tga", array)
    assert_reads(tmp_path / "a.tiff", array)


def test_palette_is_looked_up(tmp_path):
    array = samples(8, 3) // 64 * 64
    Image.fromarray(array).quantize(256).save(tmp_path / "a.png")
    assert (read_image(tmp_path / "a.png") * 255 - torch.from_numpy(array).float()).abs().max() < 8


def test_float_tiff(tmp_path):
    array = np.linspace(0, 1, 35, dtype=np.float32).reshape(5, 7)
    tifffile.imwrite(tmp_path / "a.tif", array)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif")[..., 0].numpy(), array)


@pytest.mark.parametrize("channels", [1, 3])
def test_srgb_becomes_linear(tmp_path, channels):
    array = samples(16, channels)
    array.flat[:2] = 0, 65535
    (tmp_path / "a.png").write_bytes(png_bytes(array))
    v = array / 65535  # IEC 61966-2-1
    expected = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(read_image(tmp_path / "a.png", "srgb").numpy(), expected, atol=1e-6)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [1, 3])
def test_written_image_reads_back(tmp_path, bits, channels):
    array = samples(bits, channels)
    write_image(tmp_path / "a.png", torch.from_numpy(array.astype(np.float64)) / (2**bits - 1), bits)
    assert_reads(tmp_path / "a.png", array)
    if bits == 16:
        assert (tmp_path / "a.png").read_bytes()[24] == 16


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (torch.full((2, 2, 3), torch.nan), r"a.png: pixels must lie in \[0, 1\]; 12 of 12"),
        (torch.full((2, 2, 1), 1.5), r"pixels must lie in \[0, 1\]"),
        (torch.zeros(2, 2), r"an image is \(rows, columns, 1 or 3\)"),
    ],
)
def test_refuses_to_write(tmp_path, image, message):
    with pytest.raises(ValueError, match=message):
        write_image(tmp_path / "a.png", image)


def test_refuses_to_write_nowhere(tmp_path):
    with pytest.raises(OSError, match=r"a\.png: cannot be written"):
        write_image(tmp_path / "absent" / "a.png", torch.zeros(2, 2, 3))


def test_16_bits_read_as_8_are_refused(tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(png_bytes(samples(16, 3)))
    monkeypatch.setattr(kornia_rs.io, "read_image", lambda path: np.asarray(Image.open(path)))  # 8 bits from this file
    with pytest.raises(ValueError, match=r"a\.png: the file has 16 bits, but its reader delivered 8"):
        read_image(tmp_path / "a.png")


@pytest.mark.parametrize("name", ["a.png", "a.tga", "a.tif", "a.bmp", "absent.png"])
def test_unreadable_file(tmp_path, name):
    if name != "absent.png":
        (tmp_path / name).write_bytes(b"no image")
    with pytest.raises(OSError, match=rf"{name}: cannot be read"):
        read_image(tmp_path / name)


def test_truncated_file(tmp_path):
    (tmp_path / "a.png").write_bytes(png_bytes(samples(16, 3))[:120])
    with pytest.raises(OSError, match=r"a\.png: cannot be read"):
        read_image(tmp_path / "a.png")


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.1, 1.5])
def test_pixels_that_are_not_finite_or_in_range(tmp_path, value):
    array = np.full((4, 4), 0.5, dtype=np.float32)
    array[1, 2] = value
    tifffile.imwrite(tmp_path / "a.tif", array)
    with pytest.raises(ValueError, match=r"a\.tif: pixels must be finite, in \[0, 1\]; 1 of 16 are not"):
        read_image(tmp_path / "a.tif")


def test_other_images_are_refused(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((2, 5, 7), np.uint16), photometric="minisblack")
    with pytest.raises(OSError, match="must hold one image"):
        read_image(tmp_path / "a.tif")
    tifffile.imwrite(tmp_path / "b.tif", np.zeros((5, 7), np.int16))
    with pytest.raises(ValueError, match="must be one grey or RGB image; found int16"):
        read_image(tmp_path / "b.tif")
    with pytest.raises(ValueError, match='color must be "linear" or "srgb"; found \'sRGB\''):
        read_image(tmp_path / "b.tif", "sRGB")


def test_a_header_beyond_the_limit_is_refused_before_the_pixels_are_read(tmp_path):
    """A few hundred bytes that announce 10 000 million pixels, in each format."""
    (tmp_path / "a.png").write_bytes(png_bytes(samples(16, 3)).replace(struct.pack(">II", 7, 5), b"\0\x01\x86\xa0" * 2))
    (tmp_path / "a.tga").write_bytes(struct.pack("<BBB5xHHHHBB", 0, 0, 2, 0, 0, 65535, 65535, 24, 0))
    tifffile.imwrite(tmp_path / "a.tif", np.lib.stride_tricks.as_strided(np.zeros(1, np.uint8), (9500, 9500), (0, 0)),
                     compression="zlib", rowsperstrip=9500)  # fmt: skip
    for path in tmp_path.iterdir():
        with pytest.raises(ValueError, match=rf"{path.name}: an image may have 80 megapixels .*found \d+ x \d+"):
            read_image(path)


def test_the_limit_can_be_raised_and_lowered(tmp_path):
    write_image(tmp_path / "a.png", torch.rand(5, 7, 3))
    assert read_image(tmp_path / "a.png", max_pixels=35).shape == (5, 7, 3)
    with pytest.raises(ValueError, match=r"3\.4e-05 megapixels.*found 5 x 7"):
        read_image(tmp_path / "a.png", max_pixels=34)


@pytest.mark.parametrize("suffix", ["png", "tga"])
def test_the_suffix_says_what_a_file_is(tmp_path, suffix):
    other = {"png": "tga", "tga": "png"}[suffix]
    Image.fromarray(samples(8, 3)).save(tmp_path / f"a.{other}")
    (tmp_path / f"a.{other}").rename(tmp_path / f"a.{suffix}")
    with pytest.raises(OSError, match=f"a.{suffix}: cannot be read"):
        read_image(tmp_path / f"a.{suffix}")
