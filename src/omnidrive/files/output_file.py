"""Output files that are complete or absent, also after a power failure."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EACCES, EINVAL, ENOTSUP
from glob import escape
from hashlib import sha256
from itertools import count
from pathlib import Path
from platform import node

from omnidrive.errors import CannotWrite, OmnidriveError, one_line

_COMPUTER = sha256(node().encode()).hexdigest()[:8]
_NUMBERS = count()
_PART = re.compile(r"\..*\.([0-9a-f]{8})-(\d+)-\d+\.part(?:-wal|-shm)?", re.DOTALL)
"""Name of a temporary file: computer, process and number of the file. A database has two more."""

_ADVICE = "choose another path"


@contextmanager
def output_file(path: Path, advice: str = _ADVICE) -> Iterator[Path]:
    """Yield a temporary path in the same folder; its file replaces ``path`` if the block succeeds.

    Every output is written here. The content is on the disk before the file gets its name, and the
    name before this function returns: after a power failure at any time the file is complete, or as
    it was before (Pillai et al. 2014, "All file systems are not created equal").

    Args:
        path: The file.
        advice: See :func:`write_errors`.

    Raises:
        CannotWrite: The file cannot be written; an :class:`OSError` of the block is converted.
    """
    with write_errors(path, advice):
        part = path.with_name(f".{path.name}.{_COMPUTER}-{os.getpid()}-{next(_NUMBERS)}.part")
        try:
            yield part
            _force_to_disk(part)
            os.replace(part, path)
            _force_to_disk(path.parent)
        finally:
            part.unlink(missing_ok=True)


def create_folder(path: Path) -> None:
    """Create a folder, and those above it, unless it exists.

    Raises:
        CannotWrite: It cannot be created.
    """
    with write_errors(path):
        path.mkdir(parents=True, exist_ok=True)


def remove_abandoned(folder: Path, name: str | None = None) -> None:
    """Remove the temporary files in a folder that killed processes of this computer left.

    A file whose process still runs is kept.

    Args:
        folder: The folder.
        name: Name of the file in it whose temporary files are removed. None: those of every file,
            also in the folders below.
    """
    pattern = "**/.*.part*" if name is None else f".{escape(name)}.*.part*"
    with suppress(OSError):
        for part in folder.glob(pattern):
            found = _PART.fullmatch(part.name)
            if found and found[1] == _COMPUTER and not _is_alive(int(found[2])):
                part.unlink()


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:  # of another user
        pass
    return True


def _force_to_disk(path: Path) -> None:
    """Wait until the content of a file, or the names in a folder, are on the disk."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in {EINVAL, ENOTSUP, EACCES}:  # the file system cannot do it
            raise


@contextmanager
def write_errors(path: Path, advice: str = _ADVICE) -> Iterator[None]:
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
