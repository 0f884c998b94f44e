"""Folders that are wholly there or not at all, and that say whether their files are still as they were written."""

import hashlib
import shutil
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from inverse.files.regular import read_text, size_of

# A line a file, "digest  name", as the common tool `sha256sum -c` reads it.
MANIFEST = "SHA256SUMS"


@contextmanager
def whole_folder(target: Path, *, overwrite: bool, ours: Callable[[str], bool]) -> Iterator[Path]:
    """An empty folder beside `target` to write files into; at the end of the block it takes the target's place.

    Until then the target stays as it was; a block that raises leaves it so. A process that is killed may leave the
    unfinished folder behind, under a name that starts with a dot. An old folder is moved aside before the new one
    takes its place: for that moment neither has the name, and a process killed just then leaves the old one beside
    it as `.NAME.old-...`.

    Args:
        overwrite: replace a target that is not empty.
        ours: whether a file of an old target without a manifest was written by us, so that it may go.
    Raises: FileExistsError for a target that is not empty, unless `overwrite`; and in any case for one with files
        that no manifest names and that are not ours: they would be lost.
    """
    target = target.resolve()
    old = _checked(target, overwrite, ours)
    target.parent.mkdir(parents=True, exist_ok=True)
    mark = uuid.uuid4().hex[:12]
    fresh, aside = (target.with_name(f".{target.name}.{what}-{mark}") for what in ("new", "old"))
    fresh.mkdir()
    try:
        yield fresh
        names = sorted(path.name for path in fresh.iterdir())
        (fresh / MANIFEST).write_text("".join(f"{_digest(fresh / name)}  {name}\n" for name in names))
        if old:
            target.rename(aside)
        elif target.is_dir():
            target.rmdir()  # empty; some systems rename onto nothing else than a free name
        try:
            fresh.rename(target)
        except BaseException:
            if old:
                aside.rename(target)
            raise
    except BaseException as error:
        shutil.rmtree(fresh, ignore_errors=True)
        if isinstance(error, OSError) and str(fresh) in str(error):  # a full disk, say; the user knows the target alone
            raise OSError(str(error).replace(str(fresh), str(target))) from error
        raise
    if old:
        shutil.rmtree(aside, ignore_errors=True)


def check_manifest(folder: Path) -> None:
    """ValueError, with the file, where a folder's files are not those its manifest was written for."""
    for name, digest in manifest(folder).items():
        path = folder / name
        if not path.is_file():
            raise ValueError(f"{path}: missing, and {MANIFEST} names it.")
        if _digest(path) != digest:
            raise ValueError(
                f"{path}: changed since it was written: not what {MANIFEST} says (without it, all is read)."
            )


def manifest(folder: Path) -> dict[str, str]:
    """Digest by file name; empty where there is no manifest."""
    path = folder / MANIFEST
    if not path.is_file():
        return {}
    lines = [line.split(maxsplit=1) for line in read_text(path).splitlines()]
    if not all(len(line) == 2 and Path(line[1]).name == line[1] for line in lines):
        raise ValueError(f"{path}: a line is a digest and the name of a file of this folder.")
    return {name: digest for digest, name in lines}


def _checked(target: Path, overwrite: bool, ours: Callable[[str], bool]) -> bool:
    """Whether there is something to replace."""
    if not target.exists():
        return False
    if not target.is_dir():
        raise FileExistsError(f"{target}: is a file, not a folder.")
    present = sorted(path.name for path in target.iterdir())
    if not present:
        return False
    if not overwrite:
        raise FileExistsError(f"{target}: exists and is not empty; it is replaced only with overwrite.")
    written = {MANIFEST, *manifest(target)}
    strangers = [name for name in present if name not in written and not ours(name)]
    if strangers:
        raise FileExistsError(f"{target}: holds other files, which would be lost: {', '.join(strangers)}.")
    return True


def _digest(path: Path) -> str:
    size_of(path)
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()
