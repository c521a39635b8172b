"""Checks of output paths before any result is computed.

One rule holds for all commands: a folder of results is new or empty, a file that users edit (a
robot, a fuzzy system, a table) is replaced only on demand, and a figure, film or planned motion is
replaced.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from omnidrive.errors import CannotWrite, InvalidInput, one_line
from omnidrive.files.output_file import remove_abandoned, write_errors
from omnidrive.files.str_path import StrPath, to_path

WAYPOINT_FORMATS = (".csv", ".path", ".traj", ".yaml", ".yml")
"""Suffixes of waypoint files that a plan can be written to."""

POSE_FORMATS = (".path", ".yaml", ".yml")
"""Suffixes of those without velocities."""

DEFINITION_FILE = "study.yaml"
"""Name of the definition in the folder of a study."""

STORE_FILE = "runs.sqlite"
"""Database of finished runs in the folder of a study."""

_FIGURE_SUFFIXES = (".png", ".svg")


def is_waypoint_file(path: StrPath) -> bool:
    """Return whether a path names a waypoint file; otherwise it names a folder.

    Raises:
        InvalidInput: The suffix is that of another kind of file.
    """
    path = to_path(path)
    if path.suffix.lower() in WAYPOINT_FORMATS:
        return True
    if path.suffix and not os.path.isdir(path):
        raise InvalidInput(
            f"{one_line(str(path))}: the suffix of a waypoint file is one of "
            f"{', '.join(WAYPOINT_FORMATS[:-1])}; a folder has no suffix"
        )
    return False


def check_figure_name(path: Path) -> None:
    """Check the suffix of a figure.

    Raises:
        InvalidInput: The suffix is neither .png nor .svg.
    """
    if path.suffix.lower() not in _FIGURE_SUFFIXES:
        raise InvalidInput(f"{one_line(str(path))}: the suffix of a figure must be .png or .svg")


def check_page_name(path: Path) -> None:
    """Check the suffix of a page.

    Raises:
        InvalidInput: The suffix is not .html.
    """
    if path.suffix.lower() != ".html":
        raise InvalidInput(f"{one_line(str(path))}: the suffix of a page must be .html")


def check_figure(path: StrPath) -> None:
    """Check that a figure can be written; nothing is created.

    Raises:
        InvalidInput: The suffix is neither .png nor .svg.
        CannotWrite: The file cannot be created.
    """
    path = to_path(path)
    check_figure_name(path)
    _check_file(path)


def check_plan_targets(
    out: StrPath | None, figure: StrPath | None, page: StrPath | None = None
) -> None:
    """Check that a plan, its figure and its page can be written; nothing is created.

    Args:
        out: A waypoint file or a new folder; None: no output.
        figure: A figure, possibly in that new folder; None: no figure.
        page: An HTML page, likewise.

    Raises:
        InvalidInput: A suffix is that of another kind of file.
        CannotWrite: A file or folder cannot be created, or the folder is not empty.
    """
    out = None if out is None else to_path(out)
    new_folders: list[Path] = []
    if out is not None and is_waypoint_file(out):
        _check_file(out)
    elif out is not None:
        check_new_folder(out)
        new_folders = [path.absolute() for path in (out, *out.parents)]
    for target, check_name in ((figure, check_figure_name), (page, check_page_name)):
        path = None if target is None else to_path(target)
        if path is None:
            continue
        check_name(path)
        if path.parent.absolute() not in new_folders:
            _check_file(path)


def check_new_file(path: StrPath, *, force: bool) -> None:
    """Check that a file that users edit can be written; nothing is created.

    Args:
        path: The file.
        force: Whether an existing file may be replaced.

    Raises:
        CannotWrite: It is not a plain file, it exists and ``force`` is not set, or it cannot be
            created.
    """
    path = to_path(path)
    with _write_errors(path):
        if path.is_symlink() or (path.exists() and not path.is_file()):  # such as /dev/stdout
            raise CannotWrite(f"{one_line(str(path))} is not a plain file; choose another")
        if path.exists() and not force:
            raise CannotWrite(
                f"{one_line(str(path))} already exists; choose another, or add --force"
            )
    _check_file(path)


def check_new_folder(path: StrPath) -> None:
    """Check that a folder for results can be created; nothing is created.

    A folder is empty, too, if it holds temporary files of killed commands only; they are removed.

    Raises:
        CannotWrite: It is not empty, is not a folder, or is not writable.
    """
    path = to_path(path)
    with _write_errors(path):
        if path.exists() and all(each.suffix == ".part" for each in path.iterdir()):
            remove_abandoned(path)
        if path.exists() and any(path.iterdir()):
            raise CannotWrite(f"{one_line(str(path))} is not empty; choose a new folder with --out")
        present = next(each for each in (path, *path.parents) if os.path.lexists(each))
        if not present.exists():
            raise FileExistsError(f"{one_line(str(present))} is a link to nothing")
        _check_writable(present)


def check_study_folder(path: StrPath) -> None:
    """Check that a study can be written to a folder; nothing is created.

    The folder is new or empty, or holds a study, which is then continued if it is the same one.

    Raises:
        CannotWrite: See :func:`check_new_folder`.
    """
    path = to_path(path)
    with _write_errors(path):
        holds_a_study = any((path / each).is_file() for each in (STORE_FILE, DEFINITION_FILE))
    if holds_a_study:
        remove_abandoned(path)
        with _write_errors(path):
            _check_writable(path)
    else:
        check_new_folder(path)


def _check_file(path: Path) -> None:
    """Check that a file can be written; remove its temporary files of killed commands."""
    with _write_errors(path):
        if path.is_dir():
            raise IsADirectoryError("it is a folder")
        if not path.parent.is_dir():
            raise NotADirectoryError(f"there is no folder {one_line(str(path.parent))}")
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError("it is read-only")
        _check_writable(path.parent)
        remove_abandoned(path.parent, path.name)


def _check_writable(folder: Path) -> None:
    """Create a temporary file in a folder and remove it."""
    with TemporaryFile(dir=folder):
        pass


@contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    """As :func:`write_errors`; an invalid path is an error as well."""
    with write_errors(path):
        with suppress(FileNotFoundError):
            path.stat()
        yield
