"""Text files from strangers: read within bounds; and written."""

from __future__ import annotations

from pathlib import Path
from stat import S_ISREG

from omnidrive.errors import CannotWrite, InvalidReference
from omnidrive.yaml_file import one_line

MAX_BYTES = 10_000_000


def read_text(file: Path) -> str:
    """The text in ``file``, in UTF-8 with or without a byte-order mark: no more than 10 MB.

    Raises:
        InvalidReference: It cannot be read, is too large or is not text.
    """
    name = one_line(str(file))
    check_is_file(file)
    try:
        with file.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise InvalidReference(
            f"cannot read the waypoints {name}: {error.strerror or error}"
        ) from None
    if len(content) > MAX_BYTES:
        raise InvalidReference(
            f"{name} is too large for waypoints: more than {MAX_BYTES:,} bytes; thin them out"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InvalidReference(f"{name}, line {line}: not UTF-8 text; save it as UTF-8") from None


def check_is_file(file: Path) -> None:
    """Refuse what is not a file: a pipe would be waited for.

    Raises:
        InvalidReference: There is no such file, or it is something else.
    """
    name = one_line(str(file))
    try:
        mode = file.stat().st_mode
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise InvalidReference(f"cannot read the waypoints {name}: {reason}") from None
    if not S_ISREG(mode):
        raise InvalidReference(f"cannot read the waypoints {name}: it is not a file")


def write_text(file: Path, text: str) -> None:
    """Write ``text`` in UTF-8; what :func:`read_text` would refuse is not written.

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
    try:
        file.write_bytes(content)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CannotWrite(f"cannot write the waypoints {name}: {reason}") from None
