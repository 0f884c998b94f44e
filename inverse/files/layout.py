"""What the text files of a stack say: lights.txt, geometry.txt and stack.json."""

import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from inverse.files.images import image_size, read_image
from inverse.files.regular import read_text, shortened, size_of
from inverse.scene import (
    Distant,
    Light,
    Sensor,
    StoredLight,
    Surface,
    from_depth,
    from_normals,
    from_numbers,
    sphere,
)

# A length in a text that is off from 1 by more than rounding would be an irradiance.
_LENGTH_TOLERANCE = 0.01


@dataclass(frozen=True)
class StackFile:
    """What stack.json holds; either is None where it does not say.

    Attributes:
        sensor: that took the photographs.
        lights: of each image, by the name of its file.
    """

    sensor: Sensor | None = None
    lights: dict[str, tuple[Light, ...]] | None = None

    @classmethod
    def read(cls, path: Path) -> "StackFile":
        """An empty one where there is no file. ValueError names the file and what is wrong with it."""
        if not path.is_file():
            return cls()
        try:
            content = json.loads(read_text(path))
            if not isinstance(content, dict) or not set(content) <= {"sensor", "lights"}:
                raise ValueError('must be {"sensor": {...}, "lights": {"IMAGE": [{...}, ...], ...}}, each optional')
            sensor = Sensor(**content["sensor"]) if "sensor" in content else None
            if "lights" not in content:
                return cls(sensor)
            return cls(sensor, {name: _of_numbers(name, lights) for name, lights in content["lights"].items()})
        except (ValueError, TypeError, AttributeError, RecursionError) as error:  # of values, names, kinds, nesting
            raise ValueError(f"{path}: {error}") from error


def stack_text(sensor: Sensor, lights: dict[str, list[StoredLight]]) -> str:
    """The text of stack.json. Numbers are written in full: what is read back is equal."""
    numbers = {
        name: [{key: value.tolist() for key, value in k._asdict().items() if value is not None} for k in group]
        for name, group in lights.items()
    }
    return json.dumps({"sensor": asdict(sensor), "lights": numbers}, indent=1, allow_nan=False) + "\n"


def text_lights(path: Path, images: int) -> list[Distant]:
    """The lights of lights.txt, one for each of so many images."""
    lines, lights = text_lines(path), []
    if lines and lines[0][1].isdecimal():
        announced = lines.pop(0)[1]
        if announced.lstrip("0") != str(len(lines)).lstrip("0"):
            raise ValueError(f"{path}: the first line announces {announced[:20]} lights; found {len(lines)}.")
    if len(lines) != images:
        raise ValueError(f"{path}: one light an image; found {len(lines)} lights and {images} images.")
    for number, line in lines:
        values = _floats(line.split())
        length = math.hypot(*values[:3])
        right = len(values) in (3, 4, 6) and abs(length - 1) <= _LENGTH_TOLERANCE
        strength = values[3:] or [1.0]
        if not right or min(strength) < 0 or max(strength) == 0:
            rule = "a light is x y z of length 1, then its irradiance > 0 if not 1, or red, green and blue"
            raise ValueError(f"{path}, line {number}: {rule}; found {shortened(line)} (length {length:.4g}).")
        direction = torch.tensor(values[:3], dtype=torch.float64)
        irradiance = strength[0] if len(strength) == 1 else torch.tensor(strength, dtype=torch.float64)
        lights.append(Distant(direction, irradiance))
    return lights


def text_surface(line: str, folder: Path, shape: tuple[int, int], dtype: torch.dtype) -> Surface:
    """The surface that a line as in geometry.txt describes, for images of a shape (rows, columns)."""
    kind, *rest = line.split() or [""]
    numbers = _floats(rest if kind == "sphere" else rest[1:])
    known = ("sphere", 3, 3), *(("normals", k, 0) for k in (1, 2, 3)), ("depth", 1, 0), ("depth", 5, 4)
    if (kind, len(rest), len(numbers)) not in known or (kind == "sphere" and numbers[2] <= 0):
        rule = 'the geometry is "sphere cx cy r" with r > 0, "normals FILE" or "depth FILE [fx fy cx cy]"'
        raise ValueError(f"{folder}: {rule}; found {shortened(line)}.")
    try:
        if kind == "sphere":
            pitch = 2 / shape[0]
            x, y = (numbers[0] + 0.5) * pitch - shape[1] / shape[0], 1 - (numbers[1] + 0.5) * pitch
            return sphere(*shape, radius=numbers[2] * pitch, centre=(x, y), dtype=dtype)
        if kind == "normals":
            return _of_normals([_map(folder / name, (*shape, 3)).to(dtype) for name in rest])
        depth = _map(folder / rest[0], shape).to(dtype)
        if not numbers:
            return from_depth(depth)
        fx, fy, cx, cy = numbers
        return from_depth(depth, torch.tensor([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], dtype=dtype))
    except Exception as error:  # NumPy raises EOFError, ValueError, TypeError and others
        raise ValueError(f"{folder}: geometry {shortened(line)}: {error}") from error


def text_lines(path: Path) -> list[tuple[int, str]]:
    """Numbered lines with something on them, comments removed."""
    stripped = [line.split("#")[0].strip() for line in read_text(path).splitlines()]
    return [(number, line) for number, line in enumerate(stripped, 1) if line]


def check_shape(path: Path, shape: tuple[int, ...], expected: tuple[int, ...]) -> None:
    """ValueError for another shape than the stack's."""
    if tuple(shape) != tuple(expected):
        raise ValueError(f"{path}: must be {tuple(expected)}, as the stack's first image; found {tuple(shape)}.")


def _of_numbers(name: str, lights: list[dict[str, Any]]) -> tuple[Light, ...]:
    try:
        numbers = [{key: torch.tensor(value, dtype=torch.float64) for key, value in k.items()} for k in lights]
        return tuple(light for k in numbers for light in from_numbers(StoredLight(**k)))
    except (ValueError, TypeError, AttributeError) as error:
        raise ValueError(f"lights of {name}: {error}") from error


def _of_normals(maps: list[Tensor]) -> Surface:
    """From a map of normals, and where given of positions and of directions to the camera."""
    normals, *more = maps
    surface = from_normals(normals)
    if more:
        surface = replace(surface, points=more[0])
    return replace(surface, view=more[1]) if len(more) > 1 else surface


def _floats(words: list[str]) -> list[float]:
    """The numbers, or none at all when one of the words is not a finite number."""
    try:
        values = [float(word) for word in words]
    except ValueError:
        return []
    return values if all(map(math.isfinite, values)) else []


def _map(path: Path, shape: tuple[int, ...]) -> Tensor:
    """Array of a .npy file, or normals from an image."""
    if path.suffix.lower() == ".npy":
        size_of(path)
        stored = np.load(path, mmap_mode="r", allow_pickle=False)  # its header alone, so far
        check_shape(Path(path.name), stored.shape, shape)
        if stored.dtype.kind not in "fiu":
            raise ValueError(f"{path.name}: must hold real numbers; found {stored.dtype}.")
        return torch.from_numpy(stored.astype(np.float64))
    check_shape(Path(path.name), (*image_size(path), *shape[2:]), shape)
    coded = read_image(path, max_pixels=math.prod(shape[:2]))
    check_shape(Path(path.name), coded.shape, shape)
    if ((coded * 255).round() - coded * 255).abs().max() < 1e-3:  # no level between those of 8 bits
        raise ValueError(f"{path.name}: a normal map needs 16 bits; 8 tilt the normals by up to 0.4 degrees.")
    return torch.where((coded == 0).all(-1, keepdim=True), 0.0, 2 * coded - 1)
