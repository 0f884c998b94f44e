"""What the text files of a stack say, and what is wrong with those that say nothing."""

import numpy as np
import pytest
import torch
from helpers.png_files import png_bytes
from helpers.stack_folder import SIZE

from inverse import Sensor, read_stack, sphere


def test_sphere_stands_where_the_line_says(folder):
    surface = read_stack(folder, dtype=torch.float64).scene.surface
    for row, column in ((9, 12), (9, 19), (3, 12), (14, 8)):
        x, y = (column - 12) / 8, (9 - row) / 8  # rows run down, y up
        expected = torch.tensor([x, y, (1 - x * x - y * y) ** 0.5], dtype=torch.float64)
        torch.testing.assert_close(surface.normals[row, column], expected)
    row, column = torch.meshgrid(torch.arange(20), torch.arange(24), indexing="ij")
    distance = (row - 9) ** 2 + (column - 12) ** 2
    sure = distance != 64  # a pixel exactly on the circle may fall on either side
    assert torch.equal(surface.mask[sure], (distance < 64)[sure])


@pytest.mark.parametrize("kind", ["npy", "png"])
def test_normal_map(folder, kind):
    truth = sphere(*SIZE, radius=0.7)
    if kind == "npy":
        np.save(folder / "shape.npy", torch.where(truth.mask[..., None], truth.normals, torch.nan).numpy())
        tolerance = 1e-6
    else:
        coded = torch.where(truth.mask[..., None], (truth.normals + 1) / 2, 0.0)
        (folder / "shape.png").write_bytes(png_bytes((coded * 65535).round().numpy()))
        tolerance = 2 / 65535
    surface = read_stack(folder, geometry=f"normals shape.{kind}").scene.surface
    assert torch.equal(surface.mask, truth.mask)
    torch.testing.assert_close(surface.normals, truth.normals, atol=tolerance, rtol=0)


def test_depth_map(folder):
    rows, columns = np.indices(SIZE)
    np.save(folder / "depth.npy", 50 - 0.5 * columns + 0.25 * rows)  # nearer to the right and to the top
    surface = read_stack(folder, geometry="depth depth.npy").scene.surface
    n = torch.tensor([-0.5, 0.25, 1.0])
    # z = 0.5 x + 0.25 y in a frame with y up; its normal is (-0.5, -0.25, 1)
    n[1] = -0.25
    torch.testing.assert_close(surface.normals[10, 10], n / n.norm())
    np.save(folder / "depth.npy", np.full(SIZE, 5.0))
    seen = read_stack(folder, geometry="depth depth.npy 30 30 11.5 9.5").scene.surface
    torch.testing.assert_close(seen.normals[10, 10], torch.tensor([0.0, 0, 1]), atol=1e-5, rtol=0)
    assert seen.view.shape == (*SIZE, 3)


def test_a_folder_without_a_sensor_says_so(folder):
    photos = read_stack(folder)
    assert not photos.sensor_stated
    assert photos.scene.sensor == Sensor()
    (folder / "stack.json").write_text('{"sensor": {"exposure": 2.5}}')
    assert read_stack(folder).scene.sensor == Sensor(exposure=2.5)
    assert len(read_stack(folder).scene.lights) == 2  # of lights.txt


def test_lights_of_a_text_may_be_coloured(folder):
    (folder / "lights.txt").write_text("0 0 1 1 .5 .25\n0.6 0 0.8\n")
    (first,), (second,) = read_stack(folder).scene.lights
    assert first.irradiance.tolist() == [1, 0.5, 0.25]
    assert second.irradiance == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "stack.json: "),
        ("[]", "stack.json: must be"),
        ('{"exposure": 3}', "stack.json: must be"),
        ('{"sensor": {"gain": 3}}', "stack.json: .*gain"),
        ('{"sensor": {"exposure": -3}}', r"stack.json: Sensor\.exposure must be positive and finite; found -3"),
        ('{"lights": {"image2.png": [{"uniform": 1}]}}', "stack.json: has no lights for the images image10.png"),
        ('{"lights": [1]}', "stack.json: "),
        ('{"lights": {"image2.png": [{"glow": 1}]}}', "stack.json: lights of image2.png: .*glow"),
        ('{"lights": {"image2.png": [{"directions": [[0, 0, 1]]}]}}', "irradiances with its directions"),
        ('{"lights": {"image2.png": [{"directions": [[0, 0, 2]], "irradiances": [[1]]}]}}', "must be unit vectors"),
        ('{"lights": {"image2.png": [{"directions": [[0, 0, 1]], "irradiances": [[-1]]}]}}', "not negative"),
        ('{"lights": {"image2.png": [{"positions": [0, 0, 1], "intensities": [[1]]}]}}', r"positions \(lamp, 3\)"),
        ('{"lights": {"image2.png": [{}]}}', "found none of them"),
    ],
)
def test_bad_stack_file(folder, text, message):
    (folder / "stack.json").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_stack(folder)
