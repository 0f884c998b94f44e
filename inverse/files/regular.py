"""Regular files of a bounded size: what a reader makes sure of before it parses."""

import stat
from pathlib import Path

# Far above any table of lights or angles; a text beyond it is not one of ours.
TEXT_LIMIT = 64 * 2**20
_SHOWN = 80


def size_of(path: str | Path) -> int:
    """Bytes of a regular file, links followed. OSError for anything else: pipes block, devices never end."""
    status = Path(path).stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(f"{path}: must be a file; found a folder.")
    if not stat.S_ISREG(status.st_mode):
        raise OSError(f"{path}: must be a regular file; found a pipe, a socket or a device.")
    return status.st_size


def read_text(path: str | Path) -> str:
    """Text in UTF-8, with or without a byte-order mark; what is not UTF-8 is marked, for a parser to refuse.

    Raises: OSError; ValueError for more than 64 MiB.
    """
    if size_of(path) > TEXT_LIMIT:
        raise ValueError(f"{path}: a text may have {TEXT_LIMIT >> 20} MiB; found {size_of(path) >> 20} MiB.")
    return Path(path).read_bytes().decode("utf-8-sig", errors="replace")


def shortened(text: str) -> str:
    """A text as a message may quote it: quoted, and cut where it is long."""
    return repr(text) if len(text) <= _SHOWN else f"{text[:_SHOWN]!r}... ({len(text)} characters)"
