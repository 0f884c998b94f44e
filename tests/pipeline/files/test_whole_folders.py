"""A stack on disk is wholly old or wholly new: interrupted, killed, or asked not to overwrite."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from inverse import Distant, Scene, Sensor, read_stack, sphere, write_stack
from inverse.files import stacks

IMAGES = 3


def stack(level, exposure):
    lights = [Distant.from_angle(10 * k, exposure) for k in range(IMAGES)]
    return torch.full((IMAGES, 8, 8, 1), level), Scene(sphere(8, 8), lights, Sensor(exposure=exposure))


OLD, NEW = stack(0.25, 2.0), stack(0.75, 4.0)


def state(folder):
    """Which stack a folder holds; it must be one of them, whole."""
    photos = read_stack(folder)
    levels, exposure = photos.images.unique(), photos.scene.sensor.exposure
    irradiances = {light.irradiance for lights in photos.scene.lights for light in lights}
    assert len(photos.images) == IMAGES
    assert len(levels) == 1
    assert irradiances == {exposure}
    assert levels.item() == pytest.approx({2.0: 0.25, 4.0: 0.75}[exposure], abs=1e-4)
    return exposure


def fail_after(monkeypatch, files):
    write, written = stacks.write_image, []

    def fails(*arguments):
        if len(written) == files:
            raise OSError("the disk is full")
        written.append(arguments)
        write(*arguments)

    monkeypatch.setattr(stacks, "write_image", fails)


@pytest.mark.parametrize("files", range(IMAGES + 1))
def test_a_write_that_fails_leaves_the_old_stack(tmp_path, monkeypatch, files):
    write_stack(tmp_path / "s", *OLD)
    fail_after(monkeypatch, files)
    with pytest.raises(OSError, match="the disk is full"):
        write_stack(tmp_path / "s", *NEW, overwrite=True)
    assert state(tmp_path / "s") == 2.0
    with pytest.raises(OSError, match="the disk is full"):
        write_stack(tmp_path / "t", *NEW)
    assert [p.name for p in tmp_path.iterdir()] == ["s"]


def test_a_swap_that_fails_gives_the_old_stack_back(tmp_path, monkeypatch):
    write_stack(tmp_path / "s", *OLD)
    rename = Path.rename

    def fails(self, target):
        if ".new-" in self.name:
            raise OSError("no such luck")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fails)
    with pytest.raises(OSError, match="no such luck"):
        write_stack(tmp_path / "s", *NEW, overwrite=True)
    assert state(tmp_path / "s") == 2.0
    assert [p.name for p in tmp_path.iterdir()] == ["s"]


def test_nothing_is_overwritten_unasked(tmp_path):
    write_stack(tmp_path / "s", *OLD)
    with pytest.raises(FileExistsError, match="s: exists and is not empty"):
        write_stack(tmp_path / "s", *NEW)
    assert state(tmp_path / "s") == 2.0
    write_stack(tmp_path / "s", *NEW, overwrite=True)
    assert state(tmp_path / "s") == 4.0
    assert [p.name for p in tmp_path.iterdir()] == ["s"]


def test_overwriting_destroys_nothing_but_a_stack(tmp_path):
    write_stack(tmp_path / "s", *OLD)
    (tmp_path / "s" / "thesis.tex").write_text("ten years of work")
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "image.png").write_text("a stranger's")
    for folder, name in (("s", "thesis.tex"), ("home", "image.png")):
        with pytest.raises(FileExistsError, match=f"holds other files, which would be lost: {name}"):
            write_stack(tmp_path / folder, *NEW, overwrite=True)
        assert (tmp_path / folder / name).exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(FileExistsError, match="is a file, not a folder"):
        write_stack(tmp_path / "file", *NEW, overwrite=True)


def test_a_stack_of_version_0_1_is_replaced_when_asked(tmp_path):
    write_stack(tmp_path / "s", *OLD)
    for name in ("SHA256SUMS", "stack.json", "points.npy"):
        (tmp_path / "s" / name).unlink()
    (tmp_path / "s" / "lights.txt").write_text("0 0 1\n" * IMAGES)
    (tmp_path / "s" / "geometry.txt").write_text("normals normals.npy\n")
    assert read_stack(tmp_path / "s").scene.lights[0][0].irradiance == 1.0
    write_stack(tmp_path / "s", *NEW, overwrite=True)
    assert state(tmp_path / "s") == 4.0


@pytest.mark.parametrize("name", ["image_1.png", "stack.json", "normals.npy", "mask.png", "geometry.txt"])
def test_a_changed_file_is_named(tmp_path, name):
    write_stack(tmp_path / "s", *OLD)
    path = tmp_path / "s" / name
    data = bytearray(path.read_bytes())
    data[-2] ^= 1
    path.write_bytes(data)
    with pytest.raises(ValueError, match=f"{name}: changed since it was written"):
        read_stack(tmp_path / "s")
    path.unlink()
    with pytest.raises(ValueError, match=f"{name}: missing, and SHA256SUMS names it"):
        read_stack(tmp_path / "s")


def test_the_manifest_is_what_a_common_tool_reads(tmp_path):
    write_stack(tmp_path / "s", *OLD)
    check = subprocess.run(["sha256sum", "-c", "SHA256SUMS"], cwd=tmp_path / "s", capture_output=True, check=False)
    assert check.returncode == 0
    listed = {line.split()[1] for line in (tmp_path / "s" / "SHA256SUMS").read_text().splitlines()}
    assert listed == {p.name for p in (tmp_path / "s").iterdir()} - {"SHA256SUMS"}


# Forks a child for every step: it overwrites a stack and kills itself at that step; two more are killed from outside.
KILLER = """
import os, signal, sys, time
from pathlib import Path
import test_whole_folders as t
from inverse.files import stacks, whole_folders

calls, last = 0, 0

def lethal(act):
    def acts(*arguments, **options):
        global calls
        calls += 1
        if calls == last:
            os.kill(os.getpid(), signal.SIGKILL)
        return act(*arguments, **options)
    return acts

stacks.write_image = lethal(stacks.write_image)
stacks.np.save = lethal(stacks.np.save)
Path.rename = lethal(Path.rename)
whole_folders.shutil.rmtree = lethal(whole_folders.shutil.rmtree)
home = Path(sys.argv[1])
for step in (*t.STEPS, *t.DELAYS):
    folder = home / str(step) / "s"
    stacks.write_stack(folder, *t.OLD)
    child = os.fork()
    if not child:
        calls, last = 0, step
    while not child:
        stacks.write_stack(folder, *t.NEW, overwrite=True)
    if step in t.DELAYS:
        time.sleep(step)
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    assert os.WTERMSIG(status) == signal.SIGKILL
"""
# Steps 1-3 are images, 4 the mask, 5-6 maps, 7-8 the renamings, 9 clears the old one away.
STEPS = {1: 2.0, 3: 2.0, 6: 2.0, 7: 2.0, 8: None, 9: 4.0}
DELAYS = (0.011, 0.067)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_killed_writer_leaves_the_old_stack_or_the_new(tmp_path):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(Path(__file__).parent), *sys.path))}
    subprocess.run([sys.executable, "-c", KILLER, str(tmp_path)], env=environment, check=True)
    for step, expected in STEPS.items():
        if expected is None:  # between the renamings there is none of the name; the old one lies beside it
            assert not (tmp_path / str(step) / "s").exists()
            (old,) = (tmp_path / str(step)).glob(".s.old-*")
            assert state(old) == 2.0
        else:
            assert state(tmp_path / str(step) / "s") == expected
    for delay in DELAYS:
        if (tmp_path / str(delay) / "s").exists():
            state(tmp_path / str(delay) / "s")
