"""Folders of photographs read back, every bad folder says what is wrong, and `usable` keeps to its angles."""

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from png_files import png_bytes

from inverse.files.stacks import read_stack, usable, write_stack
from inverse.scene.lights import Ambient, Distant
from inverse.scene.scene import Scene
from inverse.scene.surface import sphere, vase

GRAY_SPHERE = Path(__file__).parents[3] / "shared" / "data" / "gray_sphere"

SIZE = (20, 24)
LIGHTS = "2\n0 0 1\n0.6 0 0.8 2.5  # a comment\n"


@pytest.fixture
def folder(tmp_path):
    """Two images of a sphere of 8 pixels at column 12, row 9, in natural order image2, image10."""
    for number, level in ((10, 40000), (2, 20000)):
        (tmp_path / f"image{number}.png").write_bytes(png_bytes(np.full((*SIZE, 3), level)))
    (tmp_path / "lights.txt").write_text(LIGHTS)
    (tmp_path / "geometry.txt").write_text("# the ball\nsphere 12 9 8\n")
    return tmp_path


def test_reads_a_stack(folder):
    photos = read_stack(folder, dtype=torch.float64)
    assert photos.names == ("image2.png", "image10.png")
    assert photos.images.shape == (2, *SIZE, 3)
    torch.testing.assert_close(
        photos.images[:, 0, 0, 0], torch.tensor([20000.0, 40000]).double() / 65535, atol=1e-7, rtol=0
    )
    (first,), (second,) = photos.scene.lights
    torch.testing.assert_close(second.direction, torch.tensor([0.6, 0, 0.8], dtype=torch.float64))
    assert (first.irradiance, second.irradiance) == (1.0, 2.5)


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


def test_mask_restricts_the_geometry(folder):
    mask = np.zeros((*SIZE, 1))
    mask[:, :13] = 65535
    (folder / "The_Mask.png").write_bytes(png_bytes(mask))
    photos = read_stack(folder)
    assert photos.images.shape[0] == 2  # the mask is no image
    surface = photos.scene.surface
    assert surface.mask[9, 12]
    assert not surface.mask[9, 13]
    assert surface.normals[9, 13].tolist() == [0, 0, 1]


def test_arguments_override_the_folder(folder):
    (folder / "other.txt").write_text("0 1 0 3\n")
    photos = read_stack(folder, images="image2*", lights="other.txt", geometry="sphere 5 5 3", color="srgb")
    assert photos.names == ("image2.png",)
    assert photos.scene.lights[0][0].irradiance == 3.0
    assert photos.scene.surface.mask[5, 5]
    assert not photos.scene.surface.mask[9, 12]
    assert photos.images[0, 0, 0, 0] < 0.1  # 0.31 encoded


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


def write_lights(text):
    return lambda folder: (folder / "lights.txt").write_text(text)


def write_geometry(text):
    return lambda folder: (folder / "geometry.txt").write_text(text)


def write_png(name, array):
    return lambda folder: (folder / name).write_bytes(png_bytes(np.asarray(array)))


def save_normals(array):
    def damage(folder):
        np.save(folder / "n.npy", array)
        (folder / "geometry.txt").write_text("normals n.npy")

    return damage


def code_normals_in_8_bits(folder):
    Image.fromarray(np.full((*SIZE, 3), 200, np.uint8)).save(folder / "n.png")
    (folder / "geometry.txt").write_text("normals n.png")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (write_lights("0 0 1\n"), "one light an image; found 1 lights and 2 images"),
        (write_lights(""), "found 0 lights and 2 images"),
        (write_lights("3\n0 0 1\n0 0 1\n"), r"lights\.txt: the first line announces 3 lights; found 2"),
        (write_lights("0 0 1\n0 0 one\n"), r"lights\.txt, line 2: a light is x y z .* found '0 0 one'"),
        (write_lights("0 0 1\n\n# c\n0 1\n"), r"lights\.txt, line 4: a light is"),
        (write_lights("0 0 1\n0 0 nan\n"), r"lights\.txt, line 2: a light is"),
        (write_lights("0 0 0\n0 0 1\n"), r"lights\.txt, line 1: .* length 1.*\(length 0\)"),
        (write_lights("0 0 1\n0 0 2\n"), r"lights\.txt, line 2: .* length 1.*\(length 2\)"),
        (write_lights("0 0 1 -1\n0 0 1\n"), r"lights\.txt, line 1: .*irradiance > 0"),
        (lambda f: (f / "lights.txt").unlink(), "lights.txt"),
        (write_geometry("cube 1 2 3"), 'the geometry is "sphere cx cy r".*found \'cube 1 2 3\''),
        (write_geometry("sphere 1 2"), "found 'sphere 1 2'"),
        (write_geometry("sphere 1 2 -3"), "r > 0.*found 'sphere 1 2 -3'"),
        (write_geometry("sphere 1 2 3\nsphere 1 2 3"), "the geometry is"),
        (write_geometry(""), "the geometry is .* found ''"),
        (write_geometry("sphere 500 500 3"), "geometry 'sphere 500 500 3': .*mask is empty"),
        (write_geometry("normals absent.npy"), "geometry 'normals absent.npy': .*absent.npy"),
        (lambda f: (f / "geometry.txt").unlink(), "geometry.txt"),
        (save_normals(np.zeros((3, 3, 3))), r"n\.npy: must be \(20, 24, 3\).*found \(3, 3, 3\)"),
        (save_normals(np.array({"a": 1}, dtype=object)), "geometry 'normals n.npy'"),
        (save_normals(np.zeros((*SIZE, 3))), "mask is empty"),
        (code_normals_in_8_bits, r"n\.png: a normal map needs 16 bits"),
        (write_png("image2.png", np.full((5, 5, 3), 9000)), r"image10\.png: must be \(5, 5, 3\).*found \(20, 24, 3\)"),
        (write_png("image10.png", np.full((*SIZE, 1), 9000)), r"image10\.png: must be \(20, 24, 3\)"),
        (write_png("mask.png", np.full((5, 5, 1), 65535)), r"mask\.png: must be \(20, 24\).*found \(5, 5\)"),
        (write_png("mask.png", np.zeros((*SIZE, 1))), r"mask\.png: empty mask: none of its 0 bright pixels"),
        (write_png("image10.png", np.zeros((*SIZE, 3))), r"image10\.png: all dark: .*100\.0%"),
        (write_png("image2.png", np.full((*SIZE, 3), 65535)), r"image2\.png: saturated: .*100\.0%"),
        (lambda f: [p.unlink() for p in f.glob("*.png")], r"no images \*\.png"),
        (lambda f: [(f / n).write_bytes(b"?") for n in ("mask.png", "mask2.png")], "one image may have mask"),
        (lambda f: (f / "image2.png").write_bytes(b"?"), r"image2\.png: cannot be read"),
    ],
)  # fmt: skip
def test_bad_folder(folder, damage, message):
    damage(folder)
    with pytest.raises((ValueError, OSError), match=message):
        read_stack(folder)


def test_missing_folder(tmp_path):
    with pytest.raises(FileNotFoundError, match="absent: no such folder"):
        read_stack(tmp_path / "absent")


@pytest.mark.parametrize("bits", [8, 16])
def test_written_stack_reads_back(tmp_path, bits):
    generator = torch.Generator().manual_seed(0)
    surface = vase(24, 20)
    lights = [Distant.from_angle(20), Distant(torch.tensor([0.1, 0.7, 0.3]).double(), 2.5)]
    images = torch.rand(2, 24, 20, 3, generator=generator)
    write_stack(tmp_path / "new", images, Scene(surface, lights), bits)
    photos = read_stack(tmp_path / "new")
    torch.testing.assert_close(photos.images, images, atol=0.5001 / (2**bits - 1), rtol=0)
    assert torch.equal(photos.scene.surface.mask, surface.mask)
    torch.testing.assert_close(photos.scene.surface.normals, surface.normals)
    for (found,), given in zip(photos.scene.lights, lights, strict=True):
        torch.testing.assert_close(found.direction, given.direction, rtol=1e-15, atol=1e-16)
        assert found.irradiance == given.irradiance
    write_stack(tmp_path / "new", photos.images, photos.scene, bits)
    again = read_stack(tmp_path / "new")
    assert torch.equal(again.images, photos.images)


def test_written_stack_keeps_full_pixels_only(tmp_path):
    surface = sphere(16, 16, samples=4)
    write_stack(tmp_path, torch.full((1, 16, 16, 1), 0.5), Scene(surface, [Distant.from_angle(0)]))
    read = read_stack(tmp_path).scene.surface
    assert torch.equal(read.mask, surface.coverage() == 1)
    flat = read.mask & (read.normals[..., 2] > 0.7)  # nearer the rim the normal bends within a pixel
    torch.testing.assert_close(read.normals[flat], sphere(16, 16).normals[flat], atol=0.005, rtol=0)


@pytest.mark.parametrize(
    ("lights", "message"),
    [
        ([Ambient(0.1)], "image 0"),
        ([[Distant.from_angle(0), Distant.from_angle(5)]], "one distant light"),
        ([Distant.from_angle(0, torch.ones(3))], "scalar irradiance"),
        ([Distant.from_angle(0)] * 2, "images must have shape"),
    ],
)
def test_refuses_to_write_what_the_layout_cannot_hold(tmp_path, lights, message):
    with pytest.raises(ValueError, match=message):
        write_stack(tmp_path, torch.full((1, 8, 8, 1), 0.5), Scene(sphere(8, 8), lights))


def test_refuses_to_join_another_stack(folder):
    with pytest.raises(FileExistsError, match=r"holds other images.*image2\.png, image10\.png"):
        write_stack(folder, torch.full((1, 8, 8, 1), 0.5), Scene(sphere(8, 8), [Distant.from_angle(0)]))


# --- usable -----------------------------------------------------------------------------------------------


def test_usable_by_angles():
    surface = sphere(41, 41, dtype=torch.float64)
    angles = (-35.0, 0.0, 50.0)
    scene = Scene(surface, [Distant.from_angle(a) for a in angles])
    found = usable(scene, limb=60, highlight=12, shadow=75)
    nx, _, nz = (k.numpy() for k in surface.normals.unbind(-1))
    for image, angle in zip(found, np.radians(angles), strict=True):
        seen = np.degrees(np.arccos(nz))
        lit = np.degrees(np.arccos(np.clip(nx * np.sin(angle) + nz * np.cos(angle), -1, 1)))
        # half vector of horizontal light and view: at half the angle
        half = np.degrees(np.arccos(np.clip(nx * np.sin(angle / 2) + nz * np.cos(angle / 2), -1, 1)))
        expected = surface.mask.numpy() & (seen <= 60) & (lit <= 75) & (half > 12)
        np.testing.assert_array_equal(image.numpy(), expected)


def test_usable_takes_every_light_and_sample():
    left, right = Distant.from_angle(-50), Distant.from_angle(50)
    both = usable(Scene(sphere(21, 21), [[left, right, Ambient(0.1)]]))[0]
    each = usable(Scene(sphere(21, 21), [left, right]))
    assert torch.equal(both, each.all(0))
    fine = usable(Scene(sphere(21, 21, samples=4), [left]))
    assert fine.shape == (1, 21, 21)
    assert not (fine[0] & ~each[0] & (sphere(21, 21, samples=4).coverage() < 1)).any()


def test_usable_refuses():
    scene = Scene(sphere(21, 21), [Distant.from_angle(0)])
    with pytest.raises(ValueError, match=r"limits must lie in \[0, 90\] degrees; found limb 95"):
        usable(scene, limb=95)
    with pytest.raises(ValueError, match=r"no pixel is left with limb 30.*highlight 40"):
        usable(scene, limb=30, highlight=40)


@pytest.mark.skipif(not GRAY_SPHERE.is_dir(), reason=f"the photographs are not at {GRAY_SPHERE}")
def test_gray_sphere():
    photos = read_stack(GRAY_SPHERE, geometry="sphere 244.5 144.5 108")
    assert photos.names == tuple(f"gray.{k}.tga" for k in range(12))
    assert photos.images.shape == (12, 340, 512, 3)
    np.testing.assert_allclose(photos.images[3] * 255, np.asarray(Image.open(GRAY_SPHERE / "gray.3.tga")), atol=1e-4)
    # area of the circle of radius 108, within the 2 % that an antialiased rim may move
    assert int(photos.scene.surface.mask.sum()) == pytest.approx(np.pi * 108**2, rel=0.02)
    # The paint is nearly Lambertian: brightness follows the cosine, in this frame and no mirrored one.
    kept = usable(photos.scene)
    total = {}
    for image, valid, (light,) in zip(photos.images, kept, photos.scene.lights, strict=True):
        values, normals = image[valid][:, 1], photos.scene.surface.normals[valid]
        for flip in ((1, 1), (-1, 1), (1, -1)):
            cosine = normals @ (light.direction.float() * torch.tensor([*flip, 1]))
            score = torch.corrcoef(torch.stack((values, cosine)))[0, 1].item()
            total[flip] = total.get(flip, 0) + score / 12
    assert total[1, 1] > 0.95
    assert max(total[-1, 1], total[1, -1]) < 0.9
