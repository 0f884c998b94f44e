"""Folders of photographs read back as they were written, and every bad folder says what is wrong."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from helpers.png_files import png_bytes
from helpers.stack_folder import SIZE
from PIL import Image

from inverse import (
    Ambient,
    Arrival,
    Disc,
    Distant,
    Environment,
    Light,
    Point,
    Scene,
    Sensor,
    Sphere,
    StoredLight,
    fit,
    perspective,
    pinhole,
    read_stack,
    render,
    sphere,
    usable,
    vase,
    write_stack,
)
from torchbrdf import OrenNayar

GRAY_SPHERE = Path(__file__).parents[4] / "shared" / "data" / "gray_sphere"


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
        (write_png("image2.png", np.full((5, 5, 3), 9000)), r"image10\.png: must be \(5, 5\).*found \(20, 24\)"),
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
    assert torch.equal(photos.scene.surface.points[surface.mask], surface.points[surface.mask])
    for (read,), given in zip(photos.scene.lights, lights, strict=True):
        assert torch.equal(read.direction, given.direction)
        assert read.irradiance == given.irradiance
    write_stack(tmp_path / "new", photos.images, photos.scene, bits, overwrite=True)
    again = read_stack(tmp_path / "new")
    assert torch.equal(again.images, photos.images)


def test_written_stack_keeps_the_sensor(tmp_path):
    """Read back with an exposure of 1, a fit took albedo 0.7 of exposure 3 for 1 and sigma 40 deg for 18."""
    sensor = Sensor(exposure=3.0, psf_sigma=0.7, read_noise=1 / 300, full_well=20000.0, bits=12)
    scene = Scene(vase(32, 32), [Distant.from_angle(0), Distant.from_angle(30)], sensor)
    truth = OrenNayar(albedo=0.7, sigma=0.7)
    images = sensor.expose(render(scene, truth), torch.Generator().manual_seed(0)).detach()
    write_stack(tmp_path / "new", images, scene)
    photos = read_stack(tmp_path / "new")
    assert photos.sensor_stated
    assert photos.scene.sensor == sensor
    fitted = fit(photos.scene, photos.images, OrenNayar())
    for name, value in {"albedo": 0.7, "sigma": 0.7}.items():  # 5 standard errors
        assert abs(fitted.parameters[name].item() - value) < 5 * fitted.standard_error[name].item() < 0.2


class Ring(Light):
    """A user's own: eight directions at 30 degrees around the camera, and a glow."""

    uniform = 0.02

    def arrivals(self, points):
        for k in range(8):
            azimuth = 2 * math.pi * k / 8
            direction = points.new_tensor([math.cos(azimuth) / 2, math.sin(azimuth) / 2, math.sqrt(0.75)])
            yield Arrival(direction.expand(len(points), 3), points.new_full((len(points), 1), 0.1 * (k + 1)))


class TwoLamps(Light):
    """A user's own: what arrives depends on the point, so it says which lamps it is."""

    lamps = Point(torch.tensor([1.0, 0.0, 3.0]), 5.0), Point(torch.tensor([-1.0, 1.0, 4.0]), 3.0)

    def arrivals(self, points):
        for lamp in self.lamps:
            yield from lamp.arrivals(points)

    def stored(self, points):
        return StoredLight(
            positions=torch.stack([lamp.position for lamp in self.lamps]), intensities=torch.tensor([[5.0], [3.0]])
        )


class Spot(Light):
    """A user's own that depends on the point and does not say how."""

    def arrivals(self, points):
        yield Arrival(points.new_tensor([0.0, 0.0, 1.0]), (points[:, :1] > 0).to(points))


SKY = torch.rand(4, 8, 3, generator=torch.Generator().manual_seed(1))
COLOURED = torch.tensor([1.0, 0.5, 0.25])


@pytest.mark.parametrize(
    "lights",
    [
        Distant.from_angle(20, 1 / 3),
        Distant.from_angle(20, COLOURED),
        Point(torch.tensor([1.0, 2.0, 3.0]), 7.0),
        Point(torch.tensor([1.0, 2.0, 3.0]), COLOURED),
        Disc(torch.tensor([0.3, 0.2, 1.0]), 0.4, COLOURED),
        Environment(SKY),
        Ambient(0.1),
        Ambient(COLOURED),
        (Distant.from_angle(0), Distant.from_angle(50, COLOURED), Ambient(0.1)),
        Ring(),
        TwoLamps(),
    ],
    ids=lambda k: type(k).__name__,
)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_written_stack_keeps_every_light(tmp_path, lights, dtype):
    """The scene read back sends the same light to the camera; shadows aside, for which a folder has no solid."""
    scene = Scene(sphere(16, 16, dtype=dtype), [lights, lights], shadows=False)
    write_stack(tmp_path / "new", torch.full((2, 16, 16, 3), 0.5), scene)
    read = read_stack(tmp_path / "new", dtype=dtype).scene
    model = OrenNayar(albedo=0.7, sigma=0.7).to(dtype)
    expected = render(scene, model).detach()
    eps = torch.finfo(dtype).eps  # the sum of up to 36 rays, in another order
    torch.testing.assert_close(render(read, model).detach().expand_as(expected), expected, rtol=40 * eps, atol=eps)
    write_stack(tmp_path / "again", torch.full((2, 16, 16, 3), 0.5), read)
    again = read_stack(tmp_path / "again", dtype=dtype).scene
    assert torch.equal(render(again, model), render(read, model))


def test_written_stack_keeps_the_pinhole_and_its_lamp(tmp_path):
    surface = perspective(Sphere(0.5), pinhole(20, 20, field_of_view=40, distance=2.0), dtype=torch.float64)
    scene = Scene(surface, [Point(torch.tensor([1.0, 1.0, 2.0]).double(), 3.0)], shadows=False)
    write_stack(tmp_path / "new", torch.full((1, 20, 20, 1), 0.5), scene)
    read = read_stack(tmp_path / "new", dtype=torch.float64).scene
    model = OrenNayar(albedo=0.7, sigma=0.7).double()
    torch.testing.assert_close(render(read, model).detach(), render(scene, model).detach(), rtol=1e-14, atol=1e-15)


def test_lights_follow_the_names_of_their_images(tmp_path):
    lights = [Distant.from_angle(angle, 1.0 + angle) for angle in (0, 10, 20)]
    write_stack(tmp_path / "new", torch.full((3, 8, 8, 1), 0.5), Scene(sphere(8, 8), lights))
    ((light,),) = read_stack(tmp_path / "new", images="image_1*").scene.lights
    assert light.irradiance == 11.0


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
        ([Spot()], "Spot cannot be stored: what arrives depends on the point"),
        ([Distant.from_angle(0)] * 2, "images must have shape"),
    ],
)
def test_refuses_to_write_what_no_folder_can_hold(tmp_path, lights, message):
    with pytest.raises(ValueError, match=message):
        write_stack(tmp_path / "new", torch.full((1, 8, 8, 1), 0.5), Scene(sphere(8, 8), lights))
    assert list(tmp_path.iterdir()) == []


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
