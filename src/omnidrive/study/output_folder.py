"""Where results are to go: whether they can is found out before there are any."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.files.bounded_file import one_line

FORMATS = (".csv", ".path", ".traj", ".yaml", ".yml")
"""Endings of waypoint files that a plan can be written to."""

_PICTURES = (".png", ".svg")


def is_waypoint_file(path: Path) -> bool:
    """Whether a plan is to be written to a file; else to a folder.

    Raises:
        InvalidInput: The name ends as that of another kind of file.
    """
    if path.suffix.lower() in FORMATS:
        return True
    if path.suffix and not path.is_dir():
        raise InvalidInput(
            f"{one_line(str(path))}: waypoint files end in {', '.join(FORMATS[:-1])}; "
            "a folder's name has no ending"
        )
    return False


def check_picture_name(path: Path) -> None:
    """Refuse a name that no picture can have.

    Raises:
        InvalidInput: It ends neither in .png nor in .svg.
    """
    if path.suffix.lower() not in _PICTURES:
        raise InvalidInput(f"{one_line(str(path))}: pictures are written as .png or .svg")


def check_plan_targets(out: Path | None, picture: Path | None) -> None:
    """Refuse places that a plan and its picture cannot be written to; nothing is made.

    Args:
        out: A waypoint file or a new folder.
        picture: A file, perhaps in that new folder.

    Raises:
        InvalidInput: A name ends as that of another kind of file.
        CannotWrite: A file or folder could not be made, or the folder holds something already.
    """
    made: list[Path] = []
    if out is not None and is_waypoint_file(out):
        _check_file(out)
    elif out is not None:
        check_new_folder(out)
        made = [path.absolute() for path in (out, *out.parents)]
    if picture is not None:
        check_picture_name(picture)
        if picture.parent.absolute() not in made:
            _check_file(picture)


def check_new_folder(path: Path) -> None:
    """Refuse a folder for results that could not be made; nothing is made.

    Raises:
        CannotWrite: It holds something already, is no folder, or nothing can be written there.
    """
    with _refusing(path):
        if path.exists() and any(path.iterdir()):
            raise CannotWrite(f"{one_line(str(path))} is not empty; name a new folder with --out")
        _try_to_write_in(next(each for each in (path, *path.parents) if each.exists()))


def _check_file(path: Path) -> None:
    """Refuse a file that could not be written."""
    with _refusing(path):
        if path.is_dir():
            raise IsADirectoryError("it is a folder")
        if not path.parent.is_dir():
            raise NotADirectoryError(f"there is no folder {one_line(str(path.parent))}")
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError("it may not be changed")
        _try_to_write_in(path.parent)


def _try_to_write_in(folder: Path) -> None:
    """Make a file without a name, which is gone when it is closed."""
    with TemporaryFile(dir=folder):
        pass


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Turn the system's errors into :class:`CannotWrite`."""
    try:
        with suppress(FileNotFoundError):
            path.stat()  # which refuses what nothing can be called
        yield
    except (OSError, ValueError) as error:  # ValueError: the path holds a NUL
        reason = getattr(error, "strerror", None) or error
        raise CannotWrite(
            f"cannot write to {one_line(str(path))}: {reason}; name another place"
        ) from None
