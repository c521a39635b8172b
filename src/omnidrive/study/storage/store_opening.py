"""Opening of the database of a study; a damaged one is rebuilt before it is written.

A reader accepts cut files and damaged pages: it finds the rows that can be read. A process that
writes needs a whole database: the valid rows are copied into a new file, which replaces the damaged
one, and the damaged one is kept beside it.
"""

from __future__ import annotations

import logging
import os
import sqlite3
from contextlib import closing
from functools import cache
from itertools import count
from pathlib import Path
from shutil import copyfile
from time import monotonic, sleep
from typing import Any

from omnidrive.errors import InvalidStore, one_line
from omnidrive.files.output_file import output_file, write_errors
from omnidrive.study.storage import store_errors
from omnidrive.study.storage.stored_rows import (
    APPLICATION,
    SCHEMA,
    VERSION,
    Loss,
    add_functions,
    copy_valid,
    count_outcomes,
    is_corrupt,
    loss,
    read_facts,
    write_facts,
)

_READ = ("facts", "results", "runs")  # tables that a reader needs
_LARGEST = 2**26  # bytes of a value; larger ones are damaged
_MAX_REBUILDS = 5  # attempts to get a whole database, also by other processes

_log = logging.getLogger("omnidrive")


def open_to_read(path: Path) -> sqlite3.Connection:
    """Return a connection to a database that is not changed.

    Raises:
        InvalidStore: It is that of another program or version, or has other tables.
        sqlite3.Error: It cannot be read.
    """
    uri = f"{path.absolute().as_uri()}?mode=ro"
    connection = _connected(uri)
    try:
        try:
            connection.execute("SELECT COUNT(*) FROM sqlite_master")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY:  # a process rebuilds it
                raise
            connection.close()  # no process writes in a read-only folder
            connection = _connected(f"{uri}&immutable=1")
        _check_identity(connection, path)
        _check_tables(connection)
    except BaseException:
        connection.close()
        raise
    return connection


def open_to_write(path: Path) -> sqlite3.Connection:
    """Return a connection to a whole database; create it, or rebuild it, if necessary.

    Raises:
        InvalidStore: It is that of another program or version.
        CannotWrite: A new file cannot be written.
        sqlite3.Error: It cannot be opened, or nothing in it can be read.
    """
    defect: str | None = None
    for _ in range(_MAX_REBUILDS):
        identity = path.stat().st_ino if path.exists() else None
        connection = _connected(path)
        try:
            defect = _defect(connection, path)
            if defect is None:
                return connection
        except BaseException:
            connection.close()
            raise
        connection.close()
        _rebuild(path, identity, defect)
    raise sqlite3.DatabaseError(f"also after it was rebuilt: {defect}")


def _connected(path: Path | str) -> sqlite3.Connection:
    """Return a connection to a database, which is read only if the path is a URI."""
    is_uri = isinstance(path, str)
    connection = sqlite3.connect(
        path, uri=is_uri, timeout=store_errors.PATIENCE, isolation_level=None
    )
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LARGEST)
    connection.execute("PRAGMA trusted_schema = OFF")
    if is_uri:
        connection.execute("PRAGMA writable_schema = ON")  # with which cut files are read
    add_functions(connection)
    return connection


def _check_identity(connection: sqlite3.Connection, path: Path) -> None:
    """Raise InvalidStore unless the database is one of a study of this version."""
    ((application,),) = connection.execute("PRAGMA application_id")
    ((version,),) = connection.execute("PRAGMA user_version")
    name = one_line(str(path))
    if application != APPLICATION:
        raise InvalidStore(
            f"{name} is a database of another program; it was not changed. Choose another folder"
        )
    if version != VERSION:
        age, advice = (
            ("a newer", "update omnidrive") if version > VERSION
            else ("an older", "compute the study again in another folder")
        )  # fmt: skip
        raise InvalidStore(
            f"{name} was written by {age} version of omnidrive (version {version} of the store, "
            f"this one reads {VERSION}); {advice}"
        )


def _schema(connection: sqlite3.Connection) -> set[tuple[Any, ...]]:
    """Return the tables of a database, and what else its schema names."""
    return set(connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master"))


def _check_tables(connection: sqlite3.Connection) -> None:
    """Raise DatabaseError unless the database has the tables that readers need."""
    for row in _own_schema() - _schema(connection):
        if row[1] in _READ:
            raise sqlite3.DatabaseError(f"its table {row[1]} is missing, or has other columns")


@cache
def _own_schema() -> set[tuple[Any, ...]]:
    """Return the schema of a whole database."""
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript(SCHEMA)
        return _schema(connection)


def _defect(connection: sqlite3.Connection, path: Path) -> str | None:
    """Return why a database must be rebuilt; None: it is whole. A new one gets its tables.

    Raises:
        InvalidStore: It is that of another program or version.
        sqlite3.Error: It cannot be opened.
    """
    try:
        connection.execute("PRAGMA synchronous = FULL")
        if not connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]:
            _create(connection)
        _check_identity(connection, path)
        if _schema(connection) != _own_schema():
            return "its tables are other ones"
        ((found, *_),) = connection.execute("PRAGMA quick_check(1)").fetchall()
        if found != "ok":
            return str(found)
        connection.execute("BEGIN")  # other processes may write
        facts = read_facts(connection)
        if facts is None:
            return "its stop rule is lost"
        lost = loss(connection, count_outcomes(connection).total(), facts["runs"])
        ((rows,),) = connection.execute("SELECT COUNT(*) FROM runs")
        if rows > facts["runs"]:
            return "it has rows of no stored run"
        return str(lost) if lost.runs else None
    except sqlite3.DatabaseError as error:
        if not is_corrupt(error):
            raise
        return str(error)
    finally:
        if connection.in_transaction:
            connection.execute("ROLLBACK")


def _create(connection: sqlite3.Connection) -> None:
    """Create the tables, all or none, unless another process did."""
    execute = connection.execute
    until = monotonic() + store_errors.PATIENCE
    while True:
        try:
            execute("PRAGMA journal_mode = WAL")
            break
        except sqlite3.OperationalError:  # another process does it, for which it does not wait
            if monotonic() > until:
                raise
            sleep(0.01)
    execute("BEGIN IMMEDIATE")
    try:
        if not execute("SELECT COUNT(*) FROM sqlite_master").fetchone()[0]:
            for statement in SCHEMA.split(";"):
                execute(statement)
            write_facts(connection, {"runs": 0})
        execute("COMMIT")
    except BaseException:
        if connection.in_transaction:
            execute("ROLLBACK")
        raise


def _rebuild(path: Path, identity: int | None, defect: str) -> None:
    """Replace a damaged database by one of its valid rows, and keep the damaged one beside it.

    Args:
        path: The file.
        identity: Number of the file in which the damage was found; another one is not rebuilt.
        defect: The damage.

    Raises:
        CannotWrite: A file cannot be written.
        sqlite3.Error: Nothing can be read, or another process uses the database.
    """
    damaged = _connected(path)
    try:
        if path.stat().st_ino != identity:  # another process has rebuilt it, and may use it
            return
        damaged.execute("PRAGMA writable_schema = ON")
        damaged.execute("PRAGMA locking_mode = EXCLUSIVE")
        damaged.execute("BEGIN EXCLUSIVE")
        if path.stat().st_ino != identity:  # another process has rebuilt it meanwhile
            return
        with output_file(path) as part:
            kept, lost = _copied(damaged, part, path)
            without = f" ({lost})" if lost.runs and str(lost) != defect else ""
            beside = _keep(path)
        _log.warning(
            "%s was damaged (%s): %s valid results are kept%s, lost ones are computed again; the "
            "damaged file is now %s",
            one_line(str(path)), one_line(defect, 120), f"{kept:,}", without, beside.name,
        )  # fmt: skip
    finally:
        damaged.close()


def _copied(damaged: sqlite3.Connection, part: Path, path: Path) -> tuple[int, Loss]:
    """Write the valid rows of a database to a new one; return their number and what is lost."""
    name = one_line(str(path))
    facts = read_facts(damaged)
    fresh = _connected(part)
    try:
        _create(fresh)
        fresh.execute("BEGIN")
        runs, results = copy_valid(damaged, fresh)
        if not results:
            raise InvalidStore(
                f"{name} is damaged, and no run in it can be read; it was not changed. Restore it "
                "from a copy, or move it away and compute the study again with the same command"
            )
        write_facts(fresh, {**(facts or {}), "runs": runs})
        fresh.execute("COMMIT")
    finally:
        fresh.close()
    return results, loss(damaged, runs, facts["runs"] if facts else None)


def _keep(path: Path) -> Path:
    """Give a damaged database, and its log, a second name, and return it."""
    names = (path.with_name(f"{path.stem}-damaged{f'-{k}' * (k > 1)}.sqlite") for k in count(1))
    beside = next(name for name in names if not os.path.lexists(name))
    with write_errors(path):
        log = path.with_name(f"{path.name}-wal")
        if log.exists() and log.stat().st_size:  # it would become a part of the new database
            os.replace(log, beside.with_name(f"{beside.name}-wal"))
        log.unlink(missing_ok=True)
        path.with_name(f"{path.name}-shm").unlink(missing_ok=True)
        try:
            os.link(path, beside)
        except OSError:  # a file system without links
            copyfile(path, beside)
    return beside
