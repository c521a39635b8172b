"""Output files that are complete or absent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from omnidrive.errors import CannotWrite
from omnidrive.files.bounded_file import one_line


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path; its file replaces ``path`` if the block succeeds.

    Raises:
        OSError: The file cannot be renamed.
    """
    part = path.with_name(path.name + ".part")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def output_file(path: Path) -> Iterator[Path]:
    """As :func:`atomic_file`, but for a path that a user gave.

    Raises:
        CannotWrite: The file cannot be written; an :class:`OSError` of the block is converted.
    """
    try:
        with atomic_file(path) as part:
            yield part
    except (OSError, ValueError) as error:  # ValueError: the path contains NUL
        reason = getattr(error, "strerror", None) or error
        raise CannotWrite(
            f"cannot write to {one_line(str(path))}: {reason}; choose another path"
        ) from None
