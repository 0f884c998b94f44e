"""Tables on disk: written whole, read whole or made anew."""

import hashlib
import io
from pathlib import Path

import numpy as np
import pytest

from torchbrdf.interpolation.store import cache_folder, kept_or_built, read_arrays, write_arrays

ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "b": np.array([1.5], dtype=np.float32)}


class Builder:
    """Counts how often it was asked."""

    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1
        return ARRAYS


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("TORCHBRDF_CACHE", str(tmp_path / "tables"))
    return tmp_path / "tables"


def same(arrays):
    return set(arrays) == set(ARRAYS) and all(
        np.array_equal(arrays[k], v) and arrays[k].dtype == v.dtype for k, v in ARRAYS.items()
    )


def test_built_once_and_read_from_then_on(folder):
    build = Builder()
    for _ in range(2):
        assert same(kept_or_built("t", "s", [], build))
    assert build.calls == 1
    assert len(list(folder.iterdir())) == 1  # nothing half written beside it


def test_the_same_bytes_every_time(folder):
    for name in ("x", "y"):
        write_arrays(folder / name, ARRAYS)
    assert (folder / "x").read_bytes() == (folder / "y").read_bytes()


def test_settings_and_code_make_another_table(folder, tmp_path):
    build, code = Builder(), tmp_path / "code"
    code.mkdir()
    for source in ("x = 1", "x = 2"):
        (code / "model.py").write_text(source)
        for settings in ("a", "b"):
            kept_or_built("t", settings, [code], build)
    assert build.calls == 4


@pytest.mark.parametrize("damage", [lambda c: c[:-7], lambda c: c[:40] + b"?" + c[41:], lambda c: b"", lambda c: c[:9]])
def test_a_damaged_file_is_made_anew(folder, damage):
    build = Builder()
    kept_or_built("t", "s", [], build)
    (path,) = folder.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    assert same(kept_or_built("t", "s", [], build))
    assert same(kept_or_built("t", "s", [], build))
    assert build.calls == 2


def test_a_pickle_is_refused_even_with_its_checksum(tmp_path):
    buffer = io.BytesIO()
    np.savez(buffer, a=np.array([{}], dtype=object))
    body = buffer.getvalue()
    (tmp_path / "t").write_bytes(hashlib.sha256(body).digest() + body)
    assert read_arrays(tmp_path / "t") is None


def test_works_where_nothing_can_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")  # also root cannot write below a file
    monkeypatch.setenv("TORCHBRDF_CACHE", str(tmp_path / "file" / "tables"))
    build = Builder()
    for _ in range(2):
        assert same(kept_or_built("t", "s", [], build))
    assert build.calls == 2


def test_where_tables_are_kept(monkeypatch):
    monkeypatch.delenv("TORCHBRDF_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert cache_folder() == Path("/x/torchbrdf")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/h")
    assert cache_folder() == Path("/h/.cache/torchbrdf")
    monkeypatch.setenv("TORCHBRDF_CACHE", "/t")
    assert cache_folder() == Path("/t")


def test_without_a_home_tables_are_built(monkeypatch):
    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    for name in ("TORCHBRDF_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", nowhere)
    assert same(kept_or_built("t", "s", [], Builder()))
