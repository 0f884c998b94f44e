"""Only regular files of a bounded size are read."""

import os

import pytest

from inverse import read_image, read_merl, read_stack
from inverse.files.regular import read_text, shortened, size_of


def test_a_text_may_start_with_a_byte_order_mark(tmp_path):
    (tmp_path / "a.txt").write_text("0 0 1", encoding="utf-8-sig")
    assert read_text(tmp_path / "a.txt") == "0 0 1"


def test_bytes_that_are_no_text_are_left_to_the_parser(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"1 \xff\0")
    assert read_text(tmp_path / "a.txt") == "1 \ufffd\0"


def test_a_text_has_a_largest_size(tmp_path):
    with (tmp_path / "a.txt").open("wb") as file:
        file.truncate(65 * 2**20)  # no block of it is on the disk
    with pytest.raises(ValueError, match=r"a\.txt: a text may have 64 MiB; found 65 MiB"):
        read_text(tmp_path / "a.txt")


@pytest.mark.parametrize("name", ["x.png", "x.tga", "x.tif"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_only_regular_files(tmp_path, name, kind):
    """A pipe would block for ever, a device give bytes for ever."""
    path = tmp_path / name
    {"pipe": os.mkfifo, "device": lambda p: p.symlink_to("/dev/zero"), "folder": os.mkdir}[kind](path)
    for read in (size_of, read_text, read_image, read_merl):
        with pytest.raises(OSError, match=r"must be a (regular )?file; found a"):
            read(path)


@pytest.mark.parametrize("name", ["lights.txt", "geometry.txt", "image2.png", "mask.png", "SHA256SUMS"])
def test_no_file_of_a_folder_may_block(folder, name):
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    if name == "SHA256SUMS":  # no manifest, as far as the reader is concerned
        read_stack(folder)
    else:
        with pytest.raises(OSError, match=rf"{name}: .*must be a regular file"):
            read_stack(folder)


def test_a_manifest_cannot_name_files_elsewhere(folder):
    (folder / "SHA256SUMS").write_text("0" * 64 + "  ../secret\n")
    with pytest.raises(ValueError, match="the name of a file of this folder"):
        read_stack(folder)


def test_a_loop_of_links_is_one_error(folder):
    (folder / "lights.txt").unlink()
    (folder / "lights.txt").symlink_to("lights.txt")
    with pytest.raises(OSError, match=r"lights\.txt"):
        read_stack(folder)


def test_what_a_message_quotes_is_short():
    assert shortened("cube 1") == "'cube 1'"
    assert len(shortened("9 " * 10**6)) < 120


def test_a_line_of_megabytes_is_not_echoed(folder):
    (folder / "geometry.txt").write_text("sphere " + "9" * 10**6)
    with pytest.raises(ValueError, match="the geometry is") as refusal:
        read_stack(folder)
    assert len(str(refusal.value)) < 500


def test_lights_are_counted_before_they_are_parsed(folder):
    """A hundred thousand of them took 19 s to be told that they are too many."""
    (folder / "lights.txt").write_text("0 0 1\n" * 10**5 + "no light\n")
    with pytest.raises(ValueError, match="one light an image; found 100001 lights and 2 images"):
        read_stack(folder)
