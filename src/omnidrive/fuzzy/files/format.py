"""Formats of fuzzy systems' files, by suffix."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from omnidrive.errors import CannotWrite, InvalidFuzzyFile, InvalidInput
from omnidrive.files.bounded_file import one_line
from omnidrive.fuzzy.files.fcl import read_fcl, write_fcl
from omnidrive.fuzzy.files.fis import read_fis, write_fis
from omnidrive.fuzzy.files.fll import read_fll, write_fll
from omnidrive.fuzzy.files.fml import read_fml, write_fml
from omnidrive.fuzzy.files.source import read_text
from omnidrive.fuzzy.system import FuzzySystem


class GapWarning(UserWarning):
    """The sets of an input leave a part of its range to no set."""


class Format(NamedTuple):
    """One format."""

    read: Callable[[str], FuzzySystem]
    """System that a text describes."""
    write: Callable[[FuzzySystem], str]
    """Text that describes a system; refuses what the format cannot say."""


_FML = Format(read_fml, write_fml)

FORMATS = {
    ".fis": Format(read_fis, write_fis),
    ".fll": Format(read_fll, write_fll),
    ".fcl": Format(read_fcl, write_fcl),
    ".fml": _FML,
    ".xml": _FML,
}
"""Every format by its suffix, in lower case."""


def load(path: Path | str) -> FuzzySystem:
    """System in a file: ``.fis``, ``.fll``, ``.fcl``, ``.fml`` or (also FML) ``.xml``.

    Warns:
        GapWarning: The sets of an input leave a gap in its range.

    Raises:
        InvalidFuzzyFile: The file cannot be read, is too large, or does not hold a system; the
            message names the file, the line and what was expected.
    """
    path = Path(path)
    name = one_line(str(path))
    read = _format_of(path, InvalidFuzzyFile).read
    text = read_text(path)
    try:
        system = read(text)
    except InvalidInput as error:
        raise InvalidFuzzyFile(f"{name}: {error}") from None
    for variable in system.inputs:
        gaps = [_interval_text(low, high) for low, high in variable.gaps()]
        if gaps:
            shown = ", ".join(gaps[:4]) + (", ..." if len(gaps) > 4 else "")
            warnings.warn(
                f"{name}: no set of {variable.name!r} covers {shown}; there, rules may not fire",
                GapWarning,
                stacklevel=2,
            )
    return system


def save(system: FuzzySystem, path: Path | str) -> None:
    """Write a system to a file in the format of its suffix, as :func:`load` reads it.

    What was there before stays whole until the new text is.

    Raises:
        InvalidInput: The format cannot say what the system is; the message names the part.
        CannotWrite: There is no room, or no permission.
    """
    path = Path(path)
    name = one_line(str(path))
    write = _format_of(path, InvalidInput).write
    try:
        data = write(system).encode()
    except UnicodeEncodeError as error:
        raise InvalidInput(
            f"{name}: cannot hold the character {error.object[error.start]!r}"
        ) from None
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            part.write_bytes(data)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise CannotWrite(f"cannot write {name}: {reason}") from None


def _interval_text(low: float, high: float) -> str:
    return f"{low:.6g}" if low == high else f"[{low:.6g}, {high:.6g}]"


def _format_of(path: Path, refusal: type[InvalidInput]) -> Format:
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise refusal(
            f"{one_line(str(path))}: is not the name of a fuzzy system's file; its suffix must be "
            f"one of {', '.join(FORMATS)}"
        )
    return FORMATS[suffix]
