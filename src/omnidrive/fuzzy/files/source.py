"""Text of a fuzzy system from a file that may be hostile, and errors that say where."""

from __future__ import annotations

from pathlib import Path

from omnidrive.errors import InvalidFuzzyFile
from omnidrive.files.bounded_file import one_line
from omnidrive.fuzzy.position import Position, malformed, parse_number

__all__ = ["MAX_BYTES", "Position", "malformed", "parse_number", "read_text"]

MAX_BYTES = 8_000_000
"""Largest file read; a system of 100,000 rules has about 3 MB."""


def read_text(path: Path) -> str:
    """Text of a file, at most :data:`MAX_BYTES` long; UTF-8, or else Latin-1.

    Raises:
        InvalidFuzzyFile: It cannot be read, is too large, or is not text.
    """
    name = one_line(str(path))
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise InvalidFuzzyFile(f"{name}: cannot be read: {reason}") from None
    if len(data) > MAX_BYTES:
        raise InvalidFuzzyFile(
            f"{name}: is larger than {MAX_BYTES // 1_000_000} MB, the most that is read"
        )
    if b"\0" in data:
        raise InvalidFuzzyFile(f"{name}: is not text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")
