"""Photographs on disk and as tensors.

A folder holds one stack: one camera that did not move, lit anew for every image. Text after # is ignored.

    *.png *.tga *.tif *.tiff   images in natural order (2 before 10), 8 or 16 bits, grey or RGB (8-bit alpha is ignored)
    *mask*                     image; the object is where it exceeds half of full scale. Optional
    lights.txt                 a line an image: x y z, a unit vector towards a distant light, then its irradiance if
                               not 1, or red, green and blue; the number of lights may stand on a line before them
    geometry.txt               one of
        sphere cx cy r              centre and radius in pixels
        normals FILE [FILE [FILE]]  (rows, columns, 3) .npy, or 16-bit image of (n + 1) / 2, black off the object;
                                    then, .npy of that shape, positions and unit vectors to the camera where known
        depth FILE [fx fy cx cy]    (rows, columns) .npy: lengths, with focal lengths and principal point of a pinhole
                                    in pixels; otherwise orthographic, in pixel widths
    stack.json                 what `write_stack` writes, optional: {"sensor": the attributes of `Sensor`, "lights": by
                               image the list of its lights, each with attributes of `StoredLight`}. Such lights stand
                               instead of lights.txt; without a sensor it is Sensor(), of exposure 1
    SHA256SUMS                 digests of all the others, optional: with it, a file that changed is refused

Pixel (0, 0) is the centre of the upper left one; columns run right, rows down. Directions: x right, y up, z to camera.
"""

import re
from dataclasses import dataclass, replace
from glob import glob
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from inverse.files.images import MAX_PIXELS, SUFFIXES, image_size, read_image, write_image
from inverse.files.layout import StackFile, check_shape, stack_text, text_lights, text_lines, text_surface
from inverse.files.whole_folders import check_manifest, whole_folder
from inverse.scene import TO_CAMERA, Light, Scene, Surface, pixel_average

# What version 0.1 wrote, without a manifest.
_OLD_NAMES = re.compile(r"image_\d+\.png|mask\.png|normals\.npy|lights\.txt|geometry\.txt")


@dataclass(frozen=True)
class Photographs:
    """Images (image, rows, columns, channel) in [0, 1], linear; what they show; the files they come from.

    `sensor_stated` says whether the folder states its sensor; the scene's is `Sensor()` where it does not.
    """

    images: Tensor
    scene: Scene
    names: tuple[str, ...]
    sensor_stated: bool = False


def read_stack(
    folder: str | Path, *, images: str | None = None, mask: str | None = None, lights: str | None = None,
    geometry: str | None = None, color: str = "linear", dtype: torch.dtype = torch.float32,
    max_pixels: int = MAX_PIXELS,
) -> Photographs:  # fmt: skip
    """Read a folder of the layout above; ValueError or OSError names the file, the rule and what was found.

    `images` (a pattern), `mask`, `lights` (a file as lights.txt; both relative to the folder) and `geometry` (a line
    as in geometry.txt) stand in for the folder's own. `color` is "linear" or "srgb". No image may have more than
    `max_pixels`; their sizes are compared before one of them is read.
    """
    if not str(folder):
        raise FileNotFoundError("the folder of a stack must have a name; found an empty one.")
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder.")
    check_manifest(folder)
    line = geometry or " ".join(text for _, text in text_lines(folder / "geometry.txt"))
    named = [p for p in _image_files(folder, "*") if "mask" in p.name.lower()]
    masks = [folder / mask] if mask else named
    if len(masks) > 1:
        raise ValueError(f"{folder}: one image may have mask in its name; found {', '.join(p.name for p in masks)}.")
    others = {*named, *masks, *(folder / word for word in line.split()[1:])}
    paths = [p for p in _image_files(folder, images or "*") if p not in others]
    if not paths:
        raise FileNotFoundError(f"{folder}: no images {images or ' '.join('*' + s for s in SUFFIXES)}.")
    stack_file = StackFile.read(folder / "stack.json")
    light_sets = _light_sets(folder, [path.name for path in paths], lights, stack_file)
    for path in paths:
        check_shape(path, image_size(path), image_size(paths[0]))
    stack = [read_image(path, color, max_pixels=max_pixels) for path in paths]
    for path, image in zip(paths, stack, strict=True):
        check_shape(path, image.shape, stack[0].shape)
    surface = text_surface(line, folder, (stack[0].shape[0], stack[0].shape[1]), dtype)
    for path in masks:
        surface = _masked(surface, path)
    for path, image in zip(paths, stack, strict=True):
        _check_exposed(path, image[surface.mask])
    scene = Scene(surface, light_sets, stack_file.sensor)
    names = tuple(path.name for path in paths)
    return Photographs(torch.stack(stack).to(dtype), scene, names, sensor_stated=stack_file.sensor is not None)


def write_stack(
    folder: str | Path, images: Tensor, scene: Scene, bits: int = 16, *, overwrite: bool = False
) -> None:  # fmt: skip
    """Write images (image, rows, columns, channel) in [0, 1] and their scene as a folder for `read_stack`.

    Sensor and lights come back equal, lights that are the same at every point as their directions (a `Disc` or an
    `Environment` as its nodes, as `Rays`). The geometry becomes maps of the pixels that show nothing but the object;
    the solid is not kept, so that the scene read back knows of no shadows and no light between parts.

    The folder appears when all of it is written. One that is not empty is replaced only with `overwrite`, whole, and
    only if it holds a stack and nothing else; for a moment between two renamings there is none of that name, and a
    process that is killed then leaves the old one beside it.
    Raises: ValueError for images that do not fit the scene or a light that no numbers hold (`Light.stored`), before
        anything is written; FileExistsError.
    """
    folder, surface = Path(folder), scene.surface
    shape = (scene.images, *surface.resolution)
    if images.ndim != 4 or images.shape[:3] != shape:
        raise ValueError(f"images must have shape {shape} and channels; found {tuple(images.shape)}.")
    names = [f"image_{number:0{len(str(scene.images - 1))}d}.png" for number in range(scene.images)]
    points = surface.points[surface.mask].detach().double().nan_to_num(0.0)
    lights = {name: [light.stored(points) for light in group] for name, group in zip(names, scene.lights, strict=True)}
    mask = (surface.coverage() == 1)[..., None]
    maps = {
        "normals.npy": normalize(pixel_average(surface.normals, surface.samples), dim=-1) * mask,
        "points.npy": pixel_average(surface.points, surface.samples),
    }
    if not torch.equal(surface.view, surface.view.new_tensor(TO_CAMERA)):
        views = surface.view.expand(surface.points.shape)
        maps["views.npy"] = normalize(pixel_average(views, surface.samples), dim=-1)
    with whole_folder(folder, overwrite=overwrite, ours=lambda name: _OLD_NAMES.fullmatch(name) is not None) as fresh:
        for name, image in zip(names, images, strict=True):
            write_image(fresh / name, image, bits)
        write_image(fresh / "mask.png", mask.float(), 8)
        for name, array in maps.items():
            _save(fresh / name, array.detach().cpu().numpy())
        (fresh / "stack.json").write_text(stack_text(scene.sensor, lights))
        (fresh / "geometry.txt").write_text(f"normals {' '.join(maps)}\n")


def _save(path: Path, array: np.ndarray) -> None:
    try:
        np.save(path, array)
    except OSError as error:  # of a full disk, without the name
        raise OSError(f"{path}: cannot be written: {error}") from error


def _light_sets(
    folder: Path, names: list[str], text: str | None, stack_file: StackFile
) -> list[Light] | list[tuple[Light, ...]]:
    """The lights of each of the images."""
    if text is None and stack_file.lights is not None:
        dark = [name for name in names if name not in stack_file.lights]
        if dark:
            raise ValueError(f"{folder / 'stack.json'}: has no lights for the images {', '.join(dark)}.")
        return [stack_file.lights[name] for name in names]
    return list(text_lights(folder / (text or "lights.txt"), len(names)))


def _image_files(folder: Path, pattern: str) -> list[Path]:
    paths = [folder / name for name in glob(pattern, root_dir=folder) if Path(name).suffix.lower() in SUFFIXES]
    return sorted(paths, key=lambda p: [int(t) if t.isdecimal() else t.lower() for t in re.split(r"(\d+)", p.name)])


def _check_exposed(path: Path, pixels: Tensor) -> None:
    """Refuse photographs (pixel, channel) of an object that show nothing."""
    faults = {"all dark: below 1/1000 of": (pixels < 1e-3).all(-1), "saturated: at": (pixels >= 1).any(-1)}
    for fault, faulty in faults.items():
        if (share := faulty.float().mean().item()) > 0.95:
            raise ValueError(f"{path}: {fault} full scale in {share:.1%} of the object's pixels.")


def _masked(surface: Surface, path: Path) -> Surface:
    check_shape(path, image_size(path), surface.mask.shape)
    inside = read_image(path, max_pixels=surface.mask.numel()).amax(-1) > 0.5
    kept = surface.mask & inside
    if not kept.any():
        raise ValueError(f"{path}: empty mask: none of its {int(inside.sum())} bright pixels is on the geometry.")
    normals = torch.where(kept[..., None], surface.normals, surface.normals.new_tensor(TO_CAMERA))
    return replace(surface, mask=kept, normals=normals)
