"""File formats of fuzzy systems, selected by suffix."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from omnidrive.errors import InvalidFuzzyFile, InvalidInput, one_line
from omnidrive.files.bounded_file import read_bounded
from omnidrive.files.output_file import output_file
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.fuzzy.files.fcl import read_fcl, write_fcl
from omnidrive.fuzzy.files.fis import read_fis, write_fis
from omnidrive.fuzzy.files.fll import read_fll, write_fll
from omnidrive.fuzzy.files.fml import read_fml, write_fml
from omnidrive.fuzzy.system import FuzzySystem
from omnidrive.fuzzy.variables import FuzzySet


class GapWarning(UserWarning):
    """Part of the range of an input belongs to no fuzzy set."""


class SigmaWarning(UserWarning):
    """A Gaussian function has a negative sigma, whose sign has no effect."""


class Format(NamedTuple):
    """Reader and writer of a file format."""

    read: Callable[[str], FuzzySystem]
    """Returns the system that a text describes."""
    write: Callable[[FuzzySystem], str]
    """Returns the text of a system; raises InvalidInput if the format does not support it."""


_FML = Format(read_fml, write_fml)

FORMATS = {
    ".fis": Format(read_fis, write_fis),
    ".fll": Format(read_fll, write_fll),
    ".fcl": Format(read_fcl, write_fcl),
    ".fml": _FML,
    ".xml": _FML,
}
"""Formats by suffix, in lower case."""

MAX_BYTES = 8_000_000
"""Size of the largest file that is read; a system of 100,000 rules has about 3 MB."""


def load(path: StrPath, block: str | None = None) -> FuzzySystem:
    """Read a fuzzy system from a file: ``.fis``, ``.fll``, ``.fcl``, ``.fml`` or ``.xml`` (FML).

    Args:
        path: The file.
        block: Name of the FUNCTION_BLOCK of an ``.fcl`` file; None: its first one.

    Warns:
        GapWarning: Part of the range of an input belongs to no fuzzy set.
        SigmaWarning: The sigma of a Gaussian function is negative.
        UnreadBlockWarning: The file has several FUNCTION_BLOCKs, and ``block`` is None.

    Raises:
        InvalidFuzzyFile: The file cannot be read, is too large, or does not contain a system; the
            message names the file, the position and what was expected.
        InvalidInput: A block of a file without blocks is given.
    """
    path = to_path(path)
    name = one_line(str(path))
    _reader(path, block)  # raises errors of the name before the file is read
    system = system_of(read_text(path), path, block)
    for variable in system.inputs:
        gaps = [_interval_text(low, high) for low, high in variable.gaps()]
        if gaps:
            shown = ", ".join(gaps[:4]) + (", ..." if len(gaps) > 4 else "")
            warnings.warn(
                f"{name}: no set of {variable.name!r} covers {shown}; rules may not fire there",
                GapWarning,
                stacklevel=2,
            )
    if signs := _negative_sigmas(system):
        shown = ", ".join(signs[:4]) + (", ..." if len(signs) > 4 else "")
        warnings.warn(
            f"{name}: sigma is negative in {shown}; the formula squares it, as in Matlab, so that "
            "its sign has no effect",
            SigmaWarning,
            stacklevel=2,
        )
    return system


def system_of(text: str, path: Path, block: str | None = None) -> FuzzySystem:
    """Return the system in the text of a file; arguments and errors as of :func:`load`."""
    read = _reader(path, block)
    try:
        return read(text)
    except InvalidInput as error:
        raise InvalidFuzzyFile(f"{one_line(str(path))}: {error}") from None


def _reader(path: Path, block: str | None) -> Callable[[str], FuzzySystem]:
    """Return the reader of the format of a file."""
    name, read = one_line(str(path)), _format_of(path, InvalidFuzzyFile).read
    if read is read_fcl:
        return partial(read_fcl, block=block, source=name)
    if block is not None:
        raise InvalidInput(f"{name}: only .fcl files have blocks; leave out the block")
    return read


def _negative_sigmas(system: FuzzySystem) -> list[str]:
    """Return variable and name of the sets with a negative sigma."""
    sigmas = {"gaussmf": slice(0, 1), "gauss2mf": slice(0, 4, 2)}
    return [
        f"{variable.name!r} is {each.name!r}"
        for variable in system.variables
        for each in variable.sets
        if isinstance(each, FuzzySet)
        and each.upper.shape in sigmas
        and min(each.upper.parameters[sigmas[each.upper.shape]]) < 0.0
    ]


def save(system: FuzzySystem, path: StrPath) -> None:
    """Write a system to a file in the format of its suffix, as :func:`load` reads it.

    An existing file is replaced only when the new one is complete.

    Raises:
        InvalidInput: The format does not support a part of the system; the message names the part.
        CannotWrite: The file cannot be written.
    """
    path = to_path(path)
    name = one_line(str(path))
    write = _format_of(path, InvalidInput).write
    try:
        data = write(system).encode()
    except UnicodeEncodeError as error:
        raise InvalidInput(
            f"{name}: the character {error.object[error.start]!r} cannot be encoded"
        ) from None
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from None
    with output_file(path) as part:
        part.write_bytes(data)


def read_text(path: Path) -> str:
    """Return the text of a file of at most :data:`MAX_BYTES`, in UTF-8 or else Latin-1.

    Raises:
        InvalidFuzzyFile: The file cannot be read, is too large, or contains no text.
    """
    excess = f"is larger than the limit of {MAX_BYTES // 1_000_000} MB"
    data = read_bounded(path, MAX_BYTES, "fuzzy system", InvalidFuzzyFile, excess=excess)
    if b"\0" in data:
        raise InvalidFuzzyFile(f"{one_line(str(path))}: is not text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _interval_text(low: float, high: float) -> str:
    return f"{low:.6g}" if low == high else f"[{low:.6g}, {high:.6g}]"


def _format_of(path: Path, refusal: type[InvalidInput]) -> Format:
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise refusal(
            f"{one_line(str(path))}: is not a fuzzy system's file; its suffix must be one of "
            f"{', '.join(FORMATS)}"
        )
    return FORMATS[suffix]
