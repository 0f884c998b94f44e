"""Tables on disk: arrays behind a checksum, kept for the next process; without a place to write, nothing is lost.

The folder is $TORCHBRDF_CACHE, else torchbrdf in $XDG_CACHE_HOME, else ~/.cache/torchbrdf. It may be deleted at any
time. A file is the SHA-256 of what follows, and NumPy's archive of plain arrays (read without pickles).
"""

import hashlib
import io
import os
import tempfile
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

Arrays = dict[str, np.ndarray]

_DIGEST_BYTES = hashlib.sha256().digest_size


def cache_folder() -> Path:
    """Where tables are kept."""
    chosen = os.environ.get("TORCHBRDF_CACHE")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "torchbrdf"


def kept_or_built(name: str, settings: str, sources: Iterable[Path], build: Callable[[], Arrays]) -> Arrays:
    """The arrays that `build` makes, from disk where they were written before by the same code for the same settings.

    Args:
        name: start of the file's name.
        settings: all that the arrays depend on besides the code.
        sources: folders of the code that makes them: another byte in one of their modules is another table.
    """
    try:
        path = cache_folder() / f"{name}-{_key(settings, sources)}.bin"
    except RuntimeError:  # no home
        return build()
    arrays = read_arrays(path)
    if arrays is None:
        arrays = build()
        with suppress(OSError):  # a folder that is read only, a disk that is full
            write_arrays(path, arrays)
    return arrays


def read_arrays(path: Path) -> Arrays | None:
    """What `write_arrays` wrote, or None where there is no such file or not all of it."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, body = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
    if hashlib.sha256(body).digest() != digest:
        return None
    try:
        with np.load(io.BytesIO(body), allow_pickle=False) as archive:
            return {key: archive[key] for key in archive.files}
    except (ValueError, OSError, EOFError, BadZipFile):
        return None


def write_arrays(path: Path, arrays: Arrays) -> None:
    """Write at once, so that no reader ever meets half a file; raises OSError."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    body = buffer.getvalue()
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        try:
            file.write(hashlib.sha256(body).digest() + body)
            file.close()
            os.replace(file.name, path)
        except BaseException:
            with suppress(OSError):
                os.unlink(file.name)
            raise


def _key(settings: str, sources: Iterable[Path]) -> str:
    digest = hashlib.sha256(settings.encode())
    for folder in sources:
        for module in sorted(folder.glob("*.py")):
            digest.update(module.read_bytes())
    return digest.hexdigest()[:24]
