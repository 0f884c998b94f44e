"""One image on disk: PNG, TGA and TIFF as tensors in [0, 1], and PNG back."""

import math
import struct
from pathlib import Path

import kornia_rs
import numpy as np
import torch
from PIL import Image
from tifffile import TiffFile, TiffPage
from torch import Tensor

from inverse.files.regular import size_of

SUFFIXES = (".png", ".tga", ".tif", ".tiff")
# A few kilobytes can unpack into gigabytes; Pillow itself warns above 89 megapixels and stops at 179.
MAX_PIXELS = 80_000_000
_PNG = b"\x89PNG\r\n\x1a\n"


def image_size(path: str | Path) -> tuple[int, int]:
    """Rows and columns as the header states them; the pixels are not read. OSError: unreadable."""
    path = Path(path)
    try:
        return _stated_size(path)
    except Exception as error:  # each reader raises what it likes
        raise OSError(f"{path}: cannot be read: {error}") from error


def read_image(path: str | Path, color: str = "linear", *, max_pixels: int = MAX_PIXELS) -> Tensor:
    """PNG, TGA or TIFF of 8 or 16 bits (TIFF also float) as (rows, columns, 1 or 3) in [0, 1], float32, linear light.

    The file encodes light as `color`, "linear" or "srgb". OSError: unreadable; ValueError: no such image, or one of
    more than `max_pixels`.
    """
    if color not in ("linear", "srgb"):
        raise ValueError(f'color must be "linear" or "srgb"; found {color!r}.')
    path = Path(path)
    rows, columns = image_size(path)
    if rows * columns > max_pixels:
        limit = f"{max_pixels / 1e6:g} megapixels (max_pixels raises it)"
        raise ValueError(f"{path}: an image may have {limit}; found {rows} x {columns}.")
    try:
        data, bits = _decoded(path)
    except Exception as error:  # each reader raises what it likes, kornia_rs bare Exception
        raise OSError(f"{path}: cannot be read: {error}") from error
    if data.dtype.itemsize * 8 < bits:
        raise ValueError(f"{path}: the file has {bits} bits, but its reader delivered {data.dtype.itemsize * 8}.")
    if data.dtype.kind not in "uf" or data.ndim not in (2, 3) or (data.ndim == 3 and data.shape[2] > 4):
        raise ValueError(f"{path}: must be one grey or RGB image; found {data.dtype} {data.shape}.")
    scale = np.iinfo(data.dtype).max if data.dtype.kind == "u" else 1.0
    image = torch.from_numpy(data.astype(np.float64) / scale).float().reshape(*data.shape[:2], -1)
    image = image[..., : 1 if image.shape[-1] < 3 else 3]  # drops alpha
    broken = ~((image >= 0) & (image <= 1))  # so that NaN counts
    if broken.any():
        raise ValueError(f"{path}: pixels must be finite, in [0, 1]; {int(broken.sum())} of {broken.numel()} are not.")
    if color == "linear":
        return image
    from kornia.color import rgb_to_linear_rgb  # deferred: kornia imports all of itself

    linear = rgb_to_linear_rgb(image.movedim(-1, 0).expand(3, -1, -1)).movedim(0, -1)
    return linear[..., : image.shape[-1]].contiguous()


def write_image(path: str | Path, image: Tensor, bits: int = 16) -> None:
    """Write (rows, columns, 1 or 3) in [0, 1] as PNG of 8 or 16 bits; the values are stored as they are.

    Raises: ValueError for another suffix than .png, shape, bits or values; OSError.
    """
    if Path(path).suffix.lower() != ".png":
        raise ValueError(f"{path}: images are written as .png; found the suffix {Path(path).suffix!r}.")
    if bits not in (8, 16) or image.ndim != 3 or image.shape[-1] not in (1, 3):
        rule = "an image is (rows, columns, 1 or 3) of 8 or 16 bits"
        raise ValueError(f"{path}: {rule}; found {tuple(image.shape)} and {bits} bits.")
    outside = ~((image >= 0) & (image <= 1))  # so that NaN counts
    if outside.any():
        raise ValueError(f"{path}: pixels must lie in [0, 1]; {int(outside.sum())} of {outside.numel()} do not.")
    levels = (image.detach().cpu().double() * (2**bits - 1)).round().numpy()
    data = np.ascontiguousarray(levels, dtype=np.uint16 if bits == 16 else np.uint8)
    write = kornia_rs.io.write_image_png_u16 if bits == 16 else kornia_rs.io.write_image_png_u8
    try:
        write(str(path), data, "rgb" if image.shape[-1] == 3 else "mono")
    except Exception as error:  # kornia_rs raises bare Exception
        raise OSError(f"{path}: cannot be written: {error}") from error


def _stated_size(path: Path) -> tuple[int, int]:
    size_of(path)
    suffix = path.suffix.lower()
    if suffix in (".tif", ".tiff"):
        with TiffFile(path) as file:
            page = file.pages[0]
            if not isinstance(page, TiffPage) or page.samplesperpixel > 4:
                raise ValueError("a TIFF must hold one image, grey or RGB.")
            if len(page.dataoffsets) < math.prod(page.chunked):  # tifffile would look for each that is not there
                raise ValueError(f"has {len(page.dataoffsets)} of its {math.prod(page.chunked)} strips.")
            return int(page.imagelength), int(page.imagewidth)
    if suffix not in SUFFIXES:
        raise ValueError(f"must be one of {' '.join(SUFFIXES)}.")
    header = _head(path)
    if (header[:8] == _PNG) != (suffix == ".png"):  # a TGA has no signature of its own
        raise ValueError(f"its suffix is {suffix}, its content is {'' if suffix != '.png' else 'not '}PNG.")
    if suffix == ".png":
        columns, rows = struct.unpack(">II", header[16:24])
    else:
        columns, rows = struct.unpack("<HH", header[12:16])
    return rows, columns


def _head(path: Path) -> bytes:
    """The first 25 bytes, which hold the dimensions of a PNG and of a TGA."""
    with path.open("rb") as file:
        return file.read(25)


def _decoded(path: Path) -> tuple[np.ndarray, int]:
    """Pixels as stored, and the bits a sample the header declares. No one reader is right for all files."""
    suffix = path.suffix.lower()
    if suffix in (".tif", ".tiff"):
        with TiffFile(path) as file:
            page = file.pages[0]
            if len(file.pages) != 1 or not isinstance(page, TiffPage) or page.photometric not in (1, 2):
                raise ValueError("a TIFF must hold one image, grey (black is 0) or RGB.")
            try:
                data = page.asarray()
                return np.moveaxis(data, 0, -1) if page.axes == "SYX" else data, int(
                    page.bitspersample
                )  # planes, or pixels
            except (ValueError, KeyError):  # a codec that tifffile lacks and kornia has, such as LZW
                if page.planarconfig != 1:  # kornia would scramble the planes
                    raise
                return kornia_rs.io.read_image(str(path)), int(page.bitspersample)
    if suffix == ".png" and _head(path)[24:] == b"\x10":  # 16 bits, of which PIL would keep 8
        return kornia_rs.io.read_image(str(path)), 16
    with Image.open(path, formats=[suffix[1:].upper()]) as image:
        return np.asarray(image if image.mode in ("L", "LA", "RGB", "RGBA") else image.convert("RGB")), 8
