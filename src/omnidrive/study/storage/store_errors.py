"""Messages for users of errors of the store of a study."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from omnidrive.errors import CannotWrite, InvalidStore, OmnidriveError, one_line

PATIENCE = 30.0
"""Time to wait for another process that writes, s."""

_CAUSES = {
    sqlite3.SQLITE_FULL: "no space left; free disk space and run the command again",
    sqlite3.SQLITE_READONLY: "it is read-only; choose a folder that can be written",
    sqlite3.SQLITE_CANTOPEN: "the folder does not exist or cannot be written; choose another",
    sqlite3.SQLITE_PERM: "no permission; choose a folder that can be written",
    sqlite3.SQLITE_BUSY: f"another program has locked it for {PATIENCE:g} s; close that program "
    "and run the command again",
    sqlite3.SQLITE_LOCKED: "it is locked; run the command again",
    sqlite3.SQLITE_IOERR: "the disk reports an error, or is full; check it and run the command "
    "again",
}
"""Causes of failed writes, by the primary error code of SQLite."""


def user_error(path: Path, error: Exception) -> CannotWrite | InvalidStore:
    """Return the error for users of an error of the database."""
    name, code = one_line(str(path)), getattr(error, "sqlite_errorcode", 0) & 0xFF
    if code in _CAUSES:
        return CannotWrite(f"cannot write to {name}: {_CAUSES[code]}. Finished runs are kept")
    if code == sqlite3.SQLITE_NOTADB:
        return InvalidStore(
            f"{name} is not a database of a study; it was not changed. Restore it from a copy, or "
            "choose another folder"
        )
    return InvalidStore(
        f"{name} is damaged ({one_line(str(error), 120)}). Restore it from a copy, or repeat the "
        "command that began the study, which keeps what can be read; if that fails, too, move the "
        "file away first"
    )


@contextmanager
def store_errors(path: Path) -> Iterator[None]:
    """Convert errors of the database in a block.

    Args:
        path: Its file.

    Raises:
        InvalidStore: The file is no database of a study, or is damaged.
        CannotWrite: The database cannot be written, or read because another process locks it.
    """
    try:
        yield
    except OmnidriveError:  # some are ValueErrors
        raise
    except (sqlite3.Error, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise user_error(path, error) from None
