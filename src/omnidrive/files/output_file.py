"""Output files that are complete or absent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from omnidrive.errors import CannotWrite, OmnidriveError
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
    with write_errors(path), atomic_file(path) as part:
        yield part


@contextmanager
def write_errors(path: Path, advice: str = "choose another path") -> Iterator[None]:
    """Convert errors of the operating system in a block that writes ``path``.

    Args:
        path: The file or folder.
        advice: Last part of the message: what the user can do.

    Raises:
        CannotWrite: The block raised an :class:`OSError`, or the path is invalid.
    """
    try:
        yield
    except OmnidriveError:  # some are ValueErrors
        raise
    except (OSError, ValueError) as error:  # ValueError: the path contains NUL
        reason = getattr(error, "strerror", None) or error
        raise CannotWrite(f"cannot write to {one_line(str(path))}: {reason}; {advice}") from None
