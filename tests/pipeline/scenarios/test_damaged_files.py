"""Files of every kind, damaged at random: what is read is read, all else is one refusal, at once."""

import random
import struct
import time

import numpy as np
import pytest
import tifffile
import torch
from helpers.png_files import png_bytes
from PIL import Image

from inverse import (
    Distant,
    Scene,
    Sensor,
    read_gonioreflectometer,
    read_image,
    read_merl,
    read_optical_constants,
    read_stack,
    render,
    sphere,
    write_stack,
)
from torchbrdf import Lambert

SECONDS, MESSAGE = 5.0, 600
CASES = [8, pytest.param(1000, marks=pytest.mark.slow)]
DAMAGES = (
    lambda r, d: d[: r.randrange(len(d) + 1)],
    lambda r, d: put(d, r.randrange(len(d)), bytes([r.randrange(256)])),
    lambda r, d: put(d, r.randrange(min(len(d), 200)), bytes([1 << r.randrange(8)])),
    lambda r, d: put(d, r.randrange(min(len(d), 64)), b"\xff\xff\xff\x7f"),
    lambda r, d: put(d, r.randrange(len(d)), b"\0" * 8),
    lambda r, d: put(d, r.randrange(len(d)), r.choice([b"nan", b"inf", b"-1", b"1e999", b"[[[[", b"\xfe\xff"])),
    lambda r, d: d[: (k := r.randrange(len(d)))] + d[k : k + r.randrange(40)] * 2 + d[k:],
)


def put(data, start, piece):
    return data[:start] + piece + data[start + len(piece) :]


def image_files(folder):
    rng = np.random.default_rng(0)
    fine = rng.integers(0, 2**16, (5, 7, 3)).astype(np.uint16)
    coarse = rng.integers(0, 2**8, (5, 7, 3)).astype(np.uint8)
    (folder / "fine.png").write_bytes(png_bytes(fine))
    Image.fromarray(coarse).save(folder / "coarse.png")
    Image.fromarray(coarse).save(folder / "packed.tga", compression="tga_rle")
    Image.fromarray(coarse).save(folder / "lzw.tiff", compression="tiff_lzw")
    tifffile.imwrite(folder / "fine.tif", fine, photometric="rgb")
    tifffile.imwrite(folder / "float.tif", fine.astype(np.float32) / 65535, photometric="rgb", compression="zlib")
    return dict.fromkeys(folder.iterdir(), read_image)


def reflectance_files(folder):
    (folder / "merl.binary").write_bytes(struct.pack("<iii", 4, 4, 8) + np.ones(3 * 4 * 4 * 8, "<f8").tobytes())
    (folder / "angles.txt").write_text("2\n450 650\n0.5 0 1 3 0.25 0.5\n0.1 0 1 3 0.25 0.5\n")
    (folder / "table.yml").write_text(
        "DATA:\n  - type: tabulated nk\n    data: |\n        0.4 1.0 3.0\n        0.6 2 4\n"
    )
    (folder / "formula.yml").write_text(
        "DATA:\n  - type: formula 1\n    wavelength_range: 0.27 5.58\n    coefficients: 0 1.02 0.06 1.06 0.11\n"
    )
    readers = {".binary": read_merl, ".txt": read_gonioreflectometer, ".yml": green_constants}
    return {path: readers[path.suffix] for path in folder.iterdir()}


def green_constants(path):
    return read_optical_constants(path, torch.tensor([550.0]))


def stack_files(folder):
    scene = Scene(sphere(12, 12), [Distant.from_angle(0.0), Distant.from_angle(20.0)], Sensor(exposure=3.0))
    write_stack(folder / "stack", render(scene, Lambert(albedo=0.5)).detach(), scene)
    (folder / "stack" / "SHA256SUMS").unlink()  # with it every change is refused as one
    (folder / "stack" / "lights.txt").write_text("0 0 1\n0.6 0 0.8 2\n")
    return {path: lambda path: read_stack(path.parent) for path in (folder / "stack").iterdir()}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("cases", CASES)
@pytest.mark.parametrize("files", [image_files, reflectance_files, stack_files])
def test_damage_is_read_or_refused(tmp_path, files, cases):
    r = random.Random(cases)
    refusals = []
    for path, read in files(tmp_path).items():
        whole = path.read_bytes()
        read(path)
        for _ in range(cases):
            path.write_bytes(r.choice(DAMAGES)(r, whole))
            start = time.perf_counter()
            try:
                read(path)
            except (ValueError, OSError) as refusal:
                refusals.append(str(refusal))
            assert time.perf_counter() - start < SECONDS
        path.write_bytes(whole)
    assert len(refusals) > cases  # damage that shows is not rare
    assert all(0 < len(refusal) < MESSAGE for refusal in refusals)
