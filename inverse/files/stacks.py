"""Photographs on disk and as tensors.

A folder holds one stack: one camera that did not move, one distant light an image. Text after # is ignored.

    *.png *.tga *.tif *.tiff   images in natural order (2 before 10), 8 or 16 bits, grey or RGB (8-bit alpha is ignored)
    *mask*                     image; the object is where it exceeds half of full scale. Optional
    lights.txt                 a line an image: x y z, a unit vector towards the light, then its irradiance if not 1;
                               the number of lights may stand on a line before them
    geometry.txt               one of
        sphere cx cy r              centre and radius in pixels
        normals FILE                (rows, columns, 3) .npy, or 16-bit image of (n + 1) / 2, black off the object
        depth FILE [fx fy cx cy]    (rows, columns) .npy: lengths, with focal lengths and principal point of a pinhole
                                    in pixels; otherwise orthographic, in pixel widths

Pixel (0, 0) is the centre of the upper left one; columns run right, rows down. Directions: x right, y up, z to camera.
"""

import math
import re
from dataclasses import dataclass, replace
from glob import glob
from pathlib import Path

import kornia_rs
import numpy as np
import torch
from kornia.color import rgb_to_linear_rgb
from PIL import Image
from tifffile import TiffFile, TiffPage
from torch import Tensor
from torch.nn.functional import normalize

from inverse.scene import TO_CAMERA, Distant, Scene, Surface, from_depth, from_normals, pixel_average, sphere

_SUFFIXES = (".png", ".tga", ".tif", ".tiff")


@dataclass(frozen=True)
class Photographs:
    """Images (image, rows, columns, channel) in [0, 1], linear; what they show; the files they come from."""

    images: Tensor
    scene: Scene
    names: tuple[str, ...]


def read_image(path: str | Path, color: str = "linear") -> Tensor:
    """PNG, TGA or TIFF of 8 or 16 bits (TIFF also float) as (rows, columns, 1 or 3) in [0, 1], float32, linear light.

    The file encodes light as `color`, "linear" or "srgb". OSError: unreadable; ValueError: no such image.
    """
    if color not in ("linear", "srgb"):
        raise ValueError(f'color must be "linear" or "srgb"; found {color!r}.')
    path = Path(path)
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
    linear = rgb_to_linear_rgb(image.movedim(-1, 0).expand(3, -1, -1)).movedim(0, -1)
    return linear[..., : image.shape[-1]].contiguous()


def write_image(path: str | Path, image: Tensor, bits: int = 16) -> None:
    """Write (rows, columns, 1 or 3) in [0, 1] as PNG of 8 or 16 bits; the values are stored as they are."""
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


def read_stack(
    folder: str | Path, *, images: str | None = None, mask: str | None = None, lights: str | None = None,
    geometry: str | None = None, color: str = "linear", dtype: torch.dtype = torch.float32,
) -> Photographs:  # fmt: skip
    """Read a folder of the layout above; ValueError or OSError names the file, the rule and what was found.

    `images` (a pattern), `mask`, `lights` (files, relative to the folder) and `geometry` (a line as in
    geometry.txt) stand in for the folder's own. `color` is "linear" or "srgb".
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder.")
    line = geometry or " ".join(text for _, text in _text(folder / "geometry.txt"))
    named = [p for p in _image_files(folder, "*") if "mask" in p.name.lower()]
    masks = [folder / mask] if mask else named
    if len(masks) > 1:
        raise ValueError(f"{folder}: one image may have mask in its name; found {', '.join(p.name for p in masks)}.")
    others = {*named, *masks, *(folder / word for word in line.split()[1:])}
    paths = [p for p in _image_files(folder, images or "*") if p not in others]
    if not paths:
        raise FileNotFoundError(f"{folder}: no images {images or ' '.join('*' + s for s in _SUFFIXES)}.")
    directions = _lights(folder / (lights or "lights.txt"))
    if len(directions) != len(paths):
        raise ValueError(f"{folder}: one light an image; found {len(directions)} lights and {len(paths)} images.")
    stack = [read_image(path, color) for path in paths]
    for path, image in zip(paths, stack, strict=True):
        _check_shape(path, image, stack[0].shape)
    surface = _surface(line, folder, (stack[0].shape[0], stack[0].shape[1]), dtype)
    for path in masks:
        surface = _masked(surface, path)
    for path, image in zip(paths, stack, strict=True):
        _check_exposed(path, image[surface.mask])
    return Photographs(torch.stack(stack).to(dtype), Scene(surface, directions), tuple(path.name for path in paths))


def write_stack(folder: str | Path, images: Tensor, scene: Scene, bits: int = 16) -> None:
    """Write images (image, rows, columns, channel) in [0, 1] and their scene as a folder for `read_stack`.

    The geometry becomes a normal map of the pixels that show nothing but the object.
    """
    folder, surface = Path(folder), scene.surface
    shape = (scene.images, *surface.resolution)
    if images.ndim != 4 or images.shape[:3] != shape:
        raise ValueError(f"images must have shape {shape} and channels; found {tuple(images.shape)}.")
    if surface.view.ndim > 1:
        raise ValueError("write_stack holds an orthographic view; this surface is seen in perspective.")
    lines = []
    for number, (light, *more) in enumerate(map(tuple, scene.lights)):  # pyright: ignore[reportArgumentType]
        if more or not isinstance(light, Distant) or torch.as_tensor(light.irradiance).ndim:
            raise ValueError(
                f"write_stack holds one distant light of scalar irradiance an image; not so image {number}."
            )
        lines.append(" ".join(f"{float(k):.17g}" for k in (*light.direction, light.irradiance)))
    names = [f"image_{number:0{len(str(scene.images - 1))}d}.png" for number in range(scene.images)]
    strangers = [p.name for p in _image_files(folder, "*") if p.name not in (*names, "mask.png")]
    if strangers:
        raise FileExistsError(f"{folder}: holds other images, which would join the stack: {', '.join(strangers)}.")
    folder.mkdir(parents=True, exist_ok=True)
    for name, image in zip(names, images, strict=True):
        write_image(folder / name, image, bits)
    mask = (surface.coverage() == 1)[..., None]
    normals = normalize(pixel_average(surface.normals, surface.samples), dim=-1) * mask
    write_image(folder / "mask.png", mask.float(), 8)
    np.save(folder / "normals.npy", normals.detach().cpu().numpy())
    (folder / "lights.txt").write_text("\n".join(lines) + "\n")
    (folder / "geometry.txt").write_text("normals normals.npy\n")


def usable(scene: Scene, *, limb: float = 70.0, highlight: float = 0.0, shadow: float = 80.0) -> Tensor:
    """Which pixels of which image to trust, (image, rows, columns) bool, from geometry and lights alone.

    A mask that followed the fit could improve it by turning the lights away from the object. Left out
    are points seen at more than `limb` from their normal, lit at more than `shadow` by any light of the
    image that has a direction, or with the normal within `highlight` of halfway between light and view. [deg]
    """
    limits = f"limb {limb}, highlight {highlight}, shadow {shadow}"
    if not all(0 <= k <= 90 for k in (limb, highlight, shadow)):
        raise ValueError(f"usable: the limits must lie in [0, 90] degrees; found {limits}.")
    least_view, most_half, least_light = (math.cos(math.radians(k)) for k in (limb, highlight, shadow))
    surface, normals, view = scene.surface, scene.surface.normals.double(), scene.surface.view.double()
    near = surface.mask & ((normals * view).sum(-1) >= least_view)
    images = []
    for lights in scene.lights:
        kept = near
        for light in (beam for k in lights for beam in k.beams()):
            direction = next(light.arrivals(surface.points.double())).direction
            dull = (normals * normalize(direction + view, dim=-1)).sum(-1) < most_half if highlight > 0 else True
            kept = kept & ((normals * direction).sum(-1) >= least_light) & dull
        images.append(pixel_average(kept[..., None].double(), surface.samples)[..., 0] == 1)
    if not torch.stack(images).any():
        raise ValueError(f"usable: no pixel is left with {limits} degrees.")
    return torch.stack(images)


def _decoded(path: Path) -> tuple[np.ndarray, int]:
    """Pixels as stored, and the bits a sample the header declares. No one reader is right for all files."""
    suffix = path.suffix.lower()
    if suffix in (".tif", ".tiff"):
        with TiffFile(path) as file:
            page = file.pages[0]
            if len(file.pages) != 1 or not isinstance(page, TiffPage) or page.photometric not in (1, 2):
                raise ValueError("a TIFF must hold one image, grey (black is 0) or RGB.")
            try:
                return page.asarray(), page.bitspersample
            except (ValueError, KeyError):  # a codec that tifffile lacks and kornia has, such as LZW
                if page.planarconfig != 1:  # kornia would scramble the planes
                    raise
                return kornia_rs.io.read_image(str(path)), page.bitspersample
    if suffix not in _SUFFIXES:
        raise ValueError(f"must be one of {' '.join(_SUFFIXES)}.")
    header = path.read_bytes()[:25]
    if header[:8] == b"\x89PNG\r\n\x1a\n" and header[24:] == b"\x10":  # 16 bits, of which PIL would keep 8
        return kornia_rs.io.read_image(str(path)), 16
    with Image.open(path) as image:
        return np.asarray(image if image.mode in ("L", "LA", "RGB", "RGBA") else image.convert("RGB")), 8


def _image_files(folder: Path, pattern: str) -> list[Path]:
    found = [folder / name for name in glob(pattern, root_dir=folder) if Path(name).suffix.lower() in _SUFFIXES]
    return sorted(found, key=lambda p: [int(t) if t.isdecimal() else t.lower() for t in re.split(r"(\d+)", p.name)])


def _check_shape(path: Path, array: Tensor, shape: torch.Size) -> None:
    if array.shape != shape:
        raise ValueError(f"{path}: must be {tuple(shape)}, as the stack's first image; found {tuple(array.shape)}.")


def _check_exposed(path: Path, pixels: Tensor) -> None:
    """Refuse photographs (pixel, channel) of an object that show nothing."""
    faults = {"all dark: below 1/1000 of": (pixels < 1e-3).all(-1), "saturated: at": (pixels >= 1).any(-1)}
    for fault, found in faults.items():
        if (share := found.float().mean().item()) > 0.95:
            raise ValueError(f"{path}: {fault} full scale in {share:.1%} of the object's pixels.")


def _masked(surface: Surface, path: Path) -> Surface:
    inside = read_image(path).amax(-1) > 0.5
    _check_shape(path, inside, surface.mask.shape)
    kept = surface.mask & inside
    if not kept.any():
        raise ValueError(f"{path}: empty mask: none of its {int(inside.sum())} bright pixels is on the geometry.")
    normals = torch.where(kept[..., None], surface.normals, surface.normals.new_tensor(TO_CAMERA))
    return replace(surface, mask=kept, normals=normals)


def _text(path: Path) -> list[tuple[int, str]]:
    """Numbered lines with something on them, comments removed."""
    stripped = [line.split("#")[0].strip() for line in path.read_text(errors="replace").splitlines()]
    return [(number, line) for number, line in enumerate(stripped, 1) if line]


def _floats(words: list[str]) -> list[float]:
    """The numbers, or none at all when one of the words is not a finite number."""
    try:
        values = [float(word) for word in words]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []


def _lights(path: Path) -> list[Distant]:
    lines, found = _text(path), []
    count = int(lines.pop(0)[1]) if lines and lines[0][1].isdecimal() else len(lines)
    if count != len(lines):
        raise ValueError(f"{path}: the first line announces {count} lights; found {len(lines)}.")
    for number, line in lines:
        values = _floats(line.split())  # text rounds; a length that is off by more holds the irradiance
        length = math.hypot(*values[:3])
        if len(values) not in (3, 4) or abs(length - 1) > 0.01 or (values[3:] and values[3] <= 0):
            rule = "a light is x y z of length 1, then its irradiance > 0 if not 1"
            raise ValueError(f"{path}, line {number}: {rule}; found {line!r} (length {length:.4g}).")
        found.append(Distant(torch.tensor(values[:3], dtype=torch.float64), *values[3:]))
    return found


def _surface(line: str, folder: Path, shape: tuple[int, int], dtype: torch.dtype) -> Surface:
    kind, *rest = line.split() or [""]
    numbers = _floats(rest if kind == "sphere" else rest[1:])
    known = ("sphere", 3, 3), ("normals", 1, 0), ("depth", 1, 0), ("depth", 5, 4)
    if (kind, len(rest), len(numbers)) not in known or (kind == "sphere" and numbers[2] <= 0):
        rule = 'the geometry is "sphere cx cy r" with r > 0, "normals FILE" or "depth FILE [fx fy cx cy]"'
        raise ValueError(f"{folder}: {rule}; found {line!r}.")
    try:
        if kind == "sphere":
            pitch = 2 / shape[0]
            x, y = (numbers[0] + 0.5) * pitch - shape[1] / shape[0], 1 - (numbers[1] + 0.5) * pitch
            return sphere(*shape, radius=numbers[2] * pitch, centre=(x, y), dtype=dtype)
        array = _map(folder / rest[0]).to(dtype)
        _check_shape(Path(rest[0]), array, torch.Size(shape if kind == "depth" else (*shape, 3)))
        if not numbers:
            return from_normals(array) if kind == "normals" else from_depth(array)
        fx, fy, cx, cy = numbers
        return from_depth(array, torch.tensor([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=dtype))
    except Exception as error:  # NumPy raises EOFError, ValueError, TypeError and others
        raise ValueError(f"{folder}: geometry {line!r}: {error}") from error


def _map(path: Path) -> Tensor:
    """Array of a .npy file, or normals from an image."""
    if path.suffix.lower() != ".npy":
        coded = read_image(path)
        if ((coded * 255).round() - coded * 255).abs().max() < 1e-3:  # no level between those of 8 bits
            raise ValueError(f"{path.name}: a normal map needs 16 bits; 8 tilt the normals by up to 0.4 degrees.")
        return torch.where((coded == 0).all(-1, keepdim=True), 0.0, 2 * coded - 1)
    return torch.from_numpy(np.load(path, allow_pickle=False))
