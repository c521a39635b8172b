"""Untrusted files: reading with a size limit and one-line error messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from stat import S_ISREG
from typing import Any, BinaryIO


@contextmanager
def open_file(path: Path, kind: str, error_type: type[Exception]) -> Iterator[BinaryIO]:
    """Open a file for reading bytes; operating system errors are raised as ``error_type``.

    Errors during reading are converted as well.

    Args:
        path: The file.
        kind: Kind of the file for messages, such as "map" or "scenario".
        error_type: Type of the error raised, with a message of one line, if the path is not a
            regular file or cannot be read.
    """
    check_is_file(path, kind, error_type)
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise _unreadable(path, kind, error_type, error) from None


def check_is_file(path: Path, kind: str, error_type: type[Exception]) -> None:
    """Raise unless the path is a regular file (a pipe would block); see :func:`open_file`."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:  # ValueError: the path contains NUL
        raise _unreadable(path, kind, error_type, error) from None
    if not S_ISREG(mode):
        raise _unreadable(path, kind, error_type, "it is not a file")


def read_head(path: Path, count: int, kind: str, error_type: type[Exception]) -> bytes:
    """Return at most ``count`` bytes from the start of a file; see :func:`open_file`."""
    with open_file(path, kind, error_type) as file:
        return file.read(count)


def read_bounded(
    path: Path, most: int, kind: str, error_type: type[Exception], *, excess: str
) -> bytes:
    """Return the content of a file of at most ``most`` bytes.

    Args:
        path: The file.
        most: Size limit in bytes; at most one byte more is read.
        kind: Kind of the file for messages, see :func:`open_file`.
        error_type: Type of the errors, see :func:`open_file`; also raised for a larger file.
        excess: Message for a larger file after its name, such as "is too large for a map".
    """
    content = read_head(path, most + 1, kind, error_type)
    if len(content) > most:
        raise error_type(f"{one_line(str(path))} {excess}")
    return content


def short_repr(value: Any) -> str:
    """Return the representation of a value for messages: one line of at most 60 characters."""
    return one_line(repr(value), 60)


def one_line(text: str, limit: int = 300) -> str:
    """Return ``text`` with unprintable characters escaped, truncated to ``limit`` characters."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[: limit + 1])
    return line if len(line) <= limit else line[: limit - 3] + "..."


def _unreadable(
    path: Path, kind: str, error_type: type[Exception], fact: Exception | str
) -> Exception:
    reason = getattr(fact, "strerror", None) or fact
    return error_type(f"cannot read the {kind} {one_line(str(path))}: {reason}")
