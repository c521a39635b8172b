"""A reader of one format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple


class Reader(NamedTuple):
    """A reader of one format.

    Attributes:
        file: Name of the file that is mutated.
        valid: Valid contents of it.
        read: Reads the file at a path; raises an error of the package if it is not valid.
        others: Further files in its folder, by name.
    """

    file: str
    valid: tuple[bytes, ...]
    read: Callable[[Path], object]
    others: Mapping[str, bytes] = MappingProxyType({})

    def write(self, folder: Path, content: bytes) -> Path:
        """Write the file and the further ones into a folder; return the path of the file."""
        for name, each in (*self.others.items(), (self.file, content)):
            (folder / name).write_bytes(each)
        return folder / self.file
