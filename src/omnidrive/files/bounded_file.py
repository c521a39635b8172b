"""Untrusted files: reading with a size limit and one-line error messages."""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from omnidrive.errors import one_line

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
_BLOCK = 1 << 16  # bytes
_WITHOUT_WAITING = getattr(os, "O_NONBLOCK", 0)  # to open a pipe would wait for its other end


class _BoundedReader(io.BufferedReader):
    """Reader whose :meth:`read` allocates at most what the file has, whatever it is asked for.

    A library that trusts a length in a damaged file may ask for 4 GB.
    """

    def read(self, size: int | None = -1, /) -> bytes:
        """Return at most ``size`` bytes; all up to the end if it is negative or None."""
        if size is None or size <= _BLOCK:
            return super().read(size)
        rest = os.fstat(self.fileno()).st_size - self.tell()
        return super().read(min(size, max(rest, _BLOCK)))


@contextmanager
def open_file(path: Path, kind: str, error_type: type[Exception]) -> Iterator[BinaryIO]:
    """Open a regular file for reading bytes; operating system errors become ``error_type``.

    Every file that a user names is opened here. Folders, pipes, sockets and devices are refused,
    because reading them may wait forever or never end; ``/dev/stdin`` is accepted if it is
    redirected from a file. Errors during reading are converted as well.

    Args:
        path: The file.
        kind: Kind of the file for messages, such as "map" or "scenario".
        error_type: Type of the error raised, with a message of one line, if the path is not a
            regular file or cannot be read.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:  # ValueError: the path contains NUL
        raise _unreadable(path, kind, error_type, error) from None
    try:
        _check_is_file(status)  # to open a device may have effects
        with _BoundedReader(io.FileIO(path, opener=_open_at_once)) as file:
            _check_is_file(os.fstat(file.fileno()))  # it may have been replaced
            yield file
    except OSError as error:
        raise _unreadable(path, kind, error_type, error) from None


def _open_at_once(path: str | os.PathLike[str], flags: int) -> int:
    return os.open(path, flags | _WITHOUT_WAITING)


def _check_is_file(status: os.stat_result) -> None:
    """Raise OSError unless the status is that of a regular file."""
    if not stat.S_ISREG(status.st_mode):
        found = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        hint = "; save its content to a file first" if found == "a pipe" else ""
        raise OSError(f"it is not a file but {found}{hint}")


def read_head(path: Path, count: int, kind: str, error_type: type[Exception]) -> bytes:
    """Return at most ``count`` bytes from the start of a file; see :func:`open_file`."""
    with open_file(path, kind, error_type) as file:
        return file.read(count)


def read_bounded(
    path: Path, maximum: int, kind: str, error_type: type[Exception], *, excess: str
) -> bytes:
    """Return the content of a file of at most ``maximum`` bytes.

    Args:
        path: The file.
        maximum: Size limit in bytes; at most one byte more is read.
        kind: Kind of the file for messages, see :func:`open_file`.
        error_type: Type of the errors, see :func:`open_file`; also raised for a larger file.
        excess: Message for a larger file after its name, such as "is too large for a map".
    """
    content = read_head(path, maximum + 1, kind, error_type)
    if len(content) > maximum:
        raise error_type(f"{one_line(str(path))} {excess}")
    return content


def _unreadable(path: Path, kind: str, error_type: type[Exception], error: Exception) -> Exception:
    reason = getattr(error, "strerror", None) or error
    return error_type(f"cannot read the {kind} {one_line(str(path))}: {reason}")
