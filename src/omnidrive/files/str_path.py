"""Paths given as ``str`` or ``os.PathLike``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from omnidrive.errors import InvalidInput, short_repr

StrPath = str | os.PathLike[str]
"""Path of a file or folder, as every public function accepts it."""


def is_path(text: str) -> bool:
    """Return whether a text that may be a name has the form of a path: a separator or a suffix.

    A file or folder does not hide a built-in object of the same name: ``./NAME`` is its path.
    """
    return bool(Path(text).suffix) or "/" in text or os.sep in text


def to_path(path: Any) -> Path:
    """Return ``path`` as a :class:`pathlib.Path`.

    Raises:
        InvalidInput: It is neither a ``str`` nor an ``os.PathLike`` of text.
    """
    try:
        return Path(path)
    except TypeError:
        raise InvalidInput(
            f"a path must be text, such as 'map.yaml', or a pathlib.Path, got {short_repr(path)}"
        ) from None
