"""Bounded reading and writing of waypoint files as text."""

from __future__ import annotations

from pathlib import Path

from omnidrive.errors import InvalidReference, one_line
from omnidrive.files.bounded_file import read_bounded
from omnidrive.files.output_file import output_file

MAX_BYTES = 10_000_000
"""Largest size of a waypoint file, in bytes."""


def read_text(file: Path) -> str:
    """Read a UTF-8 file, with or without a byte-order mark, of at most 10 MB.

    Raises:
        InvalidReference: The file cannot be read, is too large or is not text.
    """
    excess = f"is too large for waypoints: more than {MAX_BYTES:,} bytes; thin them out"
    content = read_bounded(file, MAX_BYTES, "waypoint file", InvalidReference, excess=excess)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InvalidReference(
            f"{one_line(str(file))}, line {line}: not UTF-8 text; save it as UTF-8"
        ) from None


def write_text(file: Path, text: str) -> None:
    """Write ``text`` in UTF-8, unless it is too large for :func:`read_text`.

    Raises:
        InvalidReference: The text is larger than 10 MB.
        CannotWrite: The file cannot be written.
    """
    name = one_line(str(file))
    content = text.encode("utf-8")
    if len(content) > MAX_BYTES:
        raise InvalidReference(
            f"{name} would have {len(content):,} bytes, more than {MAX_BYTES:,}; "
            "save fewer samples: choose a longer dt"
        )
    with output_file(file) as part:
        part.write_bytes(content)
