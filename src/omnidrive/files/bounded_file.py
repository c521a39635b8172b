"""Files from strangers: read within a bound, refused in one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from stat import S_ISREG
from typing import Any, BinaryIO


@contextmanager
def open_file(path: Path, what: str, refusal: type[Exception]) -> Iterator[BinaryIO]:
    """A file to read bytes from; the system's errors become ``refusal``, also those of reading.

    Args:
        path: The file.
        what: What it should hold, for messages: "map", "scenario".
        refusal: Raised with one short line if it cannot be read or is no file.
    """
    check_is_file(path, what, refusal)
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise _unreadable(path, what, refusal, error) from None


def check_is_file(path: Path, what: str, refusal: type[Exception]) -> None:
    """Refuse a folder, and a pipe, which would be waited for; arguments as of :func:`open_file`."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        raise _unreadable(path, what, refusal, error) from None
    if not S_ISREG(mode):
        raise _unreadable(path, what, refusal, "it is not a file")


def read_head(path: Path, count: int, what: str, refusal: type[Exception]) -> bytes:
    """The first ``count`` bytes of a file, or all; other arguments as of :func:`open_file`."""
    with open_file(path, what, refusal) as file:
        return file.read(count)


def read_bounded(
    path: Path, most: int, what: str, refusal: type[Exception], *, excess: str
) -> bytes:
    """All of a file that has at most ``most`` bytes.

    Args:
        path: As for :func:`open_file`.
        most: Size of the largest file that is read; no more of a larger one is.
        what: As for :func:`open_file`.
        refusal: As for :func:`open_file`; also raised of a larger file.
        excess: What to say of a larger file, after its name: "is too large for a map".
    """
    content = read_head(path, most + 1, what, refusal)
    if len(content) > most:
        raise refusal(f"{one_line(str(path))} {excess}")
    return content


def short_repr(value: Any) -> str:
    """A value as messages show it: one line of at most 60 characters."""
    return one_line(repr(value), 60)


def one_line(text: str, limit: int = 300) -> str:
    """``text`` with everything unprintable escaped, cut to ``limit`` characters."""
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[: limit + 1])
    return line if len(line) <= limit else line[: limit - 3] + "..."


def _unreadable(
    path: Path, what: str, refusal: type[Exception], fact: Exception | str
) -> Exception:
    reason = getattr(fact, "strerror", None) or fact
    return refusal(f"cannot read the {what} {one_line(str(path))}: {reason}")
