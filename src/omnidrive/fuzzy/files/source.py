"""Text of a fuzzy system from a file that may be hostile, and errors that say where."""

from __future__ import annotations

from math import isnan, nan
from pathlib import Path
from typing import NamedTuple

from omnidrive.errors import InvalidFuzzyFile

MAX_BYTES = 8_000_000
"""Largest file read; a system of 100,000 rules has about 3 MB."""


class Place(NamedTuple):
    """Where in a file something stands."""

    line: int
    """From 1."""
    column: int
    """From 1."""


def read_text(path: Path) -> str:
    """Text of a file, at most :data:`MAX_BYTES` long; UTF-8, or else Latin-1.

    Raises:
        InvalidFuzzyFile: It cannot be read, is too large, or is not text.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InvalidFuzzyFile(
                f"{path}: is larger than {MAX_BYTES // 1_000_000} MB, the most that is read"
            )
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise InvalidFuzzyFile(f"{path}: cannot be read: {error.strerror}") from error
    if len(data) > MAX_BYTES:
        raise InvalidFuzzyFile(f"{path}: is longer than {MAX_BYTES // 1_000_000} MB")
    if b"\0" in data:
        raise InvalidFuzzyFile(f"{path}: is not text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def malformed(place: Place | None, what: str) -> InvalidFuzzyFile:
    """Error at a place: what was found, and what was expected; the reader adds the file's name."""
    where = f"line {place.line}, column {place.column}: " if place else ""
    return InvalidFuzzyFile(f"{where}{what}")


def number(text: str, place: Place | None) -> float:
    """A finite or infinite number; never NaN.

    Raises:
        InvalidFuzzyFile: ``text`` is none.
    """
    try:
        value = float(text) if "_" not in text and len(text) <= 400 else nan
    except ValueError:
        value = nan
    if isnan(value):
        raise malformed(place, f"expected a number, got {text[:40]!r}")
    return value
