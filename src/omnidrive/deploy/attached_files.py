"""Files that are attached to a log, in a folder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from omnidrive.errors import InvalidLog, short_repr

_MAX_FILES = 100


@contextmanager
def attached_files(files: Mapping[str, bytes]) -> Iterator[Path]:
    """Yield a new folder with these files, which ends with the context.

    Raises:
        InvalidLog: There are more than 100 files, or one has an unusable name.
    """
    if len(files) > _MAX_FILES:
        raise InvalidLog(f"the log holds more than {_MAX_FILES} files of its scenario")
    for name in files:
        if not _is_plain(name):
            raise InvalidLog(f"the log holds a file with the unusable name {short_repr(name)}")
    with TemporaryDirectory(prefix="omnidrive-") as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        yield Path(folder)


def _is_plain(name: str) -> bool:
    """Return whether a name is that of a file in a folder, on every system."""
    return len(name) <= 100 and not name.startswith(".") and all(
        character.isalnum() or character in "._-" for character in name
    )  # fmt: skip
