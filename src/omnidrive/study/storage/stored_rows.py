"""Rows of the store of a study: their tables, their checksums, and what damage leaves of them.

Every row has a checksum (CRC-32) of its values; that of a run covers its result as well, so that
readers compute one checksum per run. The facts about the study include the number of stored runs,
so that lost rows are missed.
"""

from __future__ import annotations

import json
import sqlite3
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isnan, nan
from struct import pack, unpack
from typing import Any, NamedTuple
from zlib import crc32

from omnidrive.evaluation.run_record import RunRecord

APPLICATION = 0x6F6D6E69
"""Application id of the file: "omni"."""

VERSION = 4
"""Version of the tables; those of earlier versions have other columns or checksums."""

_CHUNK = 10_000  # rows in memory as Python objects
_MAX_READS = 5_000  # attempts to read what damaged pages leave
_MAX_VAIN_READS = 500  # as long as none succeeds
_NUMBERS = (-(2**63), 2**63 - 1)  # least and largest number of a row
_MAX_NAMED = 10  # runs that a message names

SCHEMA = f"""
CREATE TABLE results (
    id INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, outcome TEXT NOT NULL,
    finished INTEGER NOT NULL, names TEXT NOT NULL, floats BLOB NOT NULL, detail TEXT NOT NULL,
    checksum INTEGER NOT NULL
) STRICT;
CREATE TABLE runs (
    number INTEGER PRIMARY KEY, result INTEGER NOT NULL REFERENCES results (id),
    pairing INTEGER NOT NULL, controller TEXT NOT NULL, task TEXT NOT NULL, duration TEXT NOT NULL,
    variant TEXT NOT NULL, repetition INTEGER NOT NULL, repeat INTEGER NOT NULL,
    factors TEXT NOT NULL, checksum INTEGER NOT NULL
) STRICT;
CREATE TABLE facts (
    id INTEGER PRIMARY KEY, content TEXT NOT NULL, checksum INTEGER NOT NULL
) STRICT;
CREATE TABLE processes (
    id TEXT PRIMARY KEY, host TEXT NOT NULL, pid INTEGER NOT NULL, started TEXT NOT NULL,
    beat INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE leases (number INTEGER PRIMARY KEY, key TEXT NOT NULL, owner TEXT NOT NULL) STRICT;
CREATE INDEX leased_keys ON leases (key);
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {VERSION}
"""

_RESULT = ("key", "outcome", "finished", "names", "floats", "detail")
_RUN = ("number", "pairing", "controller", "task", "duration", "variant", "repetition",
        "repeat", "factors")  # fmt: skip


def _checksum(values: Sequence[str]) -> str:
    """Return the SQL expression of the checksum of values, which are SQL expressions."""
    return f"row_checksum({', '.join(f'CAST({value} AS BLOB)' for value in values)})"


def _parameters(count: int) -> list[str]:
    return [f"?{k}" for k in range(1, count + 1)]


_RESULT_COLUMNS = [f"results.{name}" for name in _RESULT]

_VALID_RESULT = f"results.checksum = {_checksum(_RESULT_COLUMNS)}"

_VALID_RUN = "runs.checksum = " + _checksum([*(f"runs.{name}" for name in _RUN), *_RESULT_COLUMNS])

_DAMAGED = "SELECT number FROM runs LEFT JOIN results ON results.id = runs.result "
_IS_DAMAGED = f"({_VALID_RUN}) IS NOT 1"

_VALID_ROWS = (
    "FROM runs CROSS JOIN results ON results.id = runs.result WHERE number BETWEEN ? AND ? "
    f"AND {_VALID_RUN}"
)

RESULT_OF_KEY = (
    "SELECT outcome, finished, names, floats, detail FROM results WHERE key = ?1 AND "
    f"checksum = {_checksum(['?1', *_RESULT[1:]])}"
)
"""SQL query of a valid result by its key; none if a damaged index leads to another row."""

INSERT_RESULT = f"""
INSERT INTO results ({", ".join(_RESULT)}, checksum)
VALUES ({", ".join(_parameters(len(_RESULT)))}, {_checksum(_parameters(len(_RESULT)))})
ON CONFLICT (key) DO UPDATE SET
{", ".join(f"{name} = excluded.{name}" for name in (*_RESULT, "checksum"))}
WHERE NOT ({_VALID_RESULT})
"""
"""SQL statement that adds a result, of :func:`result_row`; a valid one is kept."""

INSERT_RUN = f"""
INSERT INTO runs (result, {", ".join(_RUN)}, checksum)
SELECT id, {", ".join(_parameters(len(_RUN)))},
{_checksum([*_parameters(len(_RUN)), *_RESULT_COLUMNS])}
FROM results WHERE key = ?{len(_RUN) + 1}
"""
"""SQL statement that adds a run, of :func:`run_row`, whose result is stored."""


class Loss(NamedTuple):
    """Stored runs that cannot be read."""

    runs: int
    """Their number."""
    numbers: tuple[int, ...]
    """Numbers in the plan of those whose rows are damaged; those of lost rows are unknown."""

    def __str__(self) -> str:
        """Return a sentence without its end."""
        if not self.runs:
            return "no stored run is damaged"
        named = ", ".join(map(str, self.numbers[:_MAX_NAMED]))
        more = ", ..." if len(self.numbers) > _MAX_NAMED else ""
        which = f" (numbers {named}{more})" if named else ""
        unnamed = self.runs - len(self.numbers)
        lost = f", the numbers of {unnamed:,} of them are unknown" if named and unnamed > 0 else ""
        are = "run is" if self.runs == 1 else "runs are"
        return f"{self.runs:,} stored {are} damaged and left out{which}{lost}"


def add_functions(connection: sqlite3.Connection) -> None:
    """Add the function of the checksums to a connection."""
    connection.create_function("row_checksum", -1, _row_checksum, deterministic=True)


def _row_checksum(*values: Any) -> int:
    """Return the checksum of the values of a row as bytes; -1, which none is, if one is NULL."""
    try:
        return crc32(b"|".join(values))
    except TypeError:
        return -1


def result_row(record: RunRecord) -> tuple[Any, ...]:
    """Return the values of a result for :data:`INSERT_RESULT`."""
    floats = [nan if isnan(v) else v for v in (*record.metrics.values(), *record.timing.values())]
    return (
        record.key, record.outcome, int(record.finished),
        json.dumps([[*record.metrics], [*record.timing]]), pack(f"<{len(floats)}d", *floats),
        record.detail,
    )  # fmt: skip


def result_record(key: str, values: Sequence[Any]) -> RunRecord:
    """Return the record of a result without its labels.

    Args:
        key: Its key.
        values: Its outcome, finished, names, floats and detail, as they are stored.

    Raises:
        ValueError: The values do not fit.
    """
    outcome, finished, names, floats, detail = values
    metrics, timing = names_of(names)
    numbers = _unpack_floats(floats, len(metrics) + len(timing))
    return RunRecord(
        number=-1, key=key, pairing=-1, controller="", task="", repetition=0, factors={},
        outcome=outcome, finished=bool(finished),
        metrics=dict(zip(metrics, numbers, strict=False)),
        timing=dict(zip(timing, numbers[len(metrics) :], strict=True)), detail=detail,
    )  # fmt: skip


def names_of(text: str) -> tuple[list[str], list[str]]:
    """Return the names of metrics and of computing times of a result.

    Raises:
        ValueError: The text is another one.
    """
    found = json.loads(text)
    if not (isinstance(found, list) and len(found) == 2 and all(_is_names(e) for e in found)):
        raise ValueError("names of metrics are no lists")
    return found[0], found[1]


def _is_names(value: Any) -> bool:
    return (
        isinstance(value, list)
        and all(isinstance(name, str) for name in value)
        and len(set(value)) == len(value)
    )


def _unpack_floats(floats: bytes, count: int) -> tuple[float, ...]:
    """Return stored numbers.

    Raises:
        ValueError: There are not so many.
    """
    if len(floats) != 8 * count:
        raise ValueError("the number of metrics is wrong")
    return unpack(f"<{count}d", floats)


def run_row(record: RunRecord) -> tuple[Any, ...]:
    """Return the values of a run for :data:`INSERT_RUN`."""
    return (
        record.number, record.pairing, record.controller, record.task,
        repr(float(record.duration)), record.variant, record.repetition, record.repeat,
        json.dumps(record.factors), record.key,
    )  # fmt: skip


def is_corrupt(error: sqlite3.Error) -> bool:
    """Return whether an error of the database is that of a damaged page or of a huge value."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    return code in {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_TOOBIG}


def read_facts(connection: sqlite3.Connection) -> dict[str, Any] | None:
    """Return the facts about the study, with the number of stored runs; None: they are damaged."""
    try:
        rows = connection.execute(
            "SELECT CAST(content AS BLOB) FROM facts WHERE id = 1 "
            f"AND checksum = {_checksum(['content'])}"
        ).fetchall()
        found = json.loads(rows[0][0]) if rows else None
    except sqlite3.DatabaseError as error:
        if not is_corrupt(error):
            raise
        return None
    return found if isinstance(found, dict) and isinstance(found.get("runs"), int) else None


def write_facts(connection: sqlite3.Connection, facts: dict[str, Any]) -> None:
    """Store the facts about the study, in a transaction."""
    connection.execute(
        f"INSERT OR REPLACE INTO facts VALUES (1, ?1, {_checksum(['?1'])})",
        (json.dumps(facts),),
    )


def valid_rows(
    connection: sqlite3.Connection, columns: str, where: str = "1"
) -> Iterator[list[tuple[Any, ...]]]:
    """Yield the undamaged stored runs in the order of their numbers, in parts.

    Where pages are damaged, the runs on the other pages are found.

    Args:
        connection: The database.
        columns: Further columns of ``runs`` and ``results`` after the number, as SQL.
        where: Further SQL condition.

    Raises:
        sqlite3.Error: The database cannot be read at all.
    """
    rows = _VALID_ROWS.replace("WHERE", f"WHERE {where} AND", 1)  # before the checksums
    query = f"SELECT number, {columns} {rows} ORDER BY number"
    yield from _rows(connection, query)


def count_outcomes(connection: sqlite3.Connection) -> Counter[tuple[str, bool]]:
    """Return the number of undamaged stored runs by outcome and whether they are finished.

    Raises:
        sqlite3.Error: The database cannot be read at all.
    """
    count = "COUNT(DISTINCT number + 0)"  # a page may occur twice, which SQLite does not expect
    query = f"SELECT outcome, finished, {count} {_VALID_ROWS} GROUP BY outcome, finished"
    try:
        rows = connection.execute(query, _NUMBERS).fetchall()
    except sqlite3.DatabaseError as error:
        if not is_corrupt(error):
            raise
        parts = valid_rows(connection, "outcome, finished")
        return Counter((row[1], bool(row[2])) for part in parts for row in part)
    return Counter({(outcome, bool(finished)): count for outcome, finished, count in rows})


def copy_valid(source: sqlite3.Connection, target: sqlite3.Connection) -> tuple[int, int]:
    """Copy the undamaged rows of a database into an empty one, in a transaction.

    Results without a run are copied as well: runs are found by their keys.

    Returns:
        Number of copied runs and of copied results.

    Raises:
        sqlite3.Error: A database cannot be read or written at all.
    """
    columns = ", ".join([*_RESULT_COLUMNS, *(f"runs.{name}" for name in _RUN[1:])])
    split, runs = 1 + len(_RESULT), 0
    for rows in valid_rows(source, columns):
        target.executemany(INSERT_RESULT, (row[1:split] for row in rows))
        target.executemany(INSERT_RUN, ((row[0], *row[split:], row[1]) for row in rows))
        runs += len(rows)
    query = (
        f"SELECT id, {', '.join(_RESULT)} FROM results WHERE id BETWEEN ? AND ? "
        f"AND {_VALID_RESULT} ORDER BY id"
    )
    for rows in _rows(source, query):
        target.executemany(INSERT_RESULT, (row[1:] for row in rows))
    ((results,),) = target.execute("SELECT COUNT(*) FROM results")
    return runs, results


def _rows(connection: sqlite3.Connection, query: str) -> Iterator[list[tuple[Any, ...]]]:
    """Yield the rows of a query of a range of numbers, and those beside damaged pages."""
    ranges = [_NUMBERS]
    reads, last, found = 0, _NUMBERS[0] - 1, False
    while ranges:
        low, high = ranges.pop()
        low = max(low, last + 1)
        if low > high:
            continue
        reads += 1
        try:
            cursor = connection.execute(query, (low, high))
            while rows := cursor.fetchmany(_CHUNK):
                numbers = [last, *(row[0] for row in rows)]
                if not all(a < b for a, b in pairwise(numbers)):  # a page occurs twice
                    kept = {row[0]: row for row in rows if row[0] > last}
                    rows = [kept[number] for number in sorted(kept)]
                found = True
                if rows:
                    last = rows[-1][0]
                    yield rows
        except sqlite3.DatabaseError as error:
            if not is_corrupt(error):
                raise
            low = max(low, last + 1)
            maximum = _MAX_READS if found else _MAX_VAIN_READS
            if low < high and reads < maximum:
                middle = _middle(low, high)
                ranges += [(middle + 1, high), (low, middle)]


def _middle(low: int, high: int) -> int:
    """Return where a range is divided; most numbers are small."""
    if low < 0 <= high:
        return -1
    return (low + high) // 2 if low < 0 else min((low + high) // 2, 2 * low + 2**16)


def loss(connection: sqlite3.Connection, read: int, stored: int | None) -> Loss:
    """Return which stored runs cannot be read.

    Args:
        connection: The database.
        read: Number of runs that can be read.
        stored: Number of stored runs according to the facts about the study.
    """
    if read == stored:
        return Loss(0, ())
    query = f"{_DAMAGED} WHERE number BETWEEN ? AND ? AND {_IS_DAMAGED} ORDER BY number"
    found = (number for rows in _rows(connection, query) for (number,) in rows)
    numbers = tuple(number for number in found if not _is_valid(connection, number))
    return Loss(max(len(numbers), (stored or 0) - read), numbers)


def _is_valid(connection: sqlite3.Connection, number: int) -> bool:
    """Return whether a run can be read; a part of a page that was cut off has wrong numbers."""
    try:
        found = connection.execute(f"SELECT 1 {_VALID_ROWS}", (number, number)).fetchone()
    except sqlite3.DatabaseError as error:
        if not is_corrupt(error):
            raise
        return False
    return found is not None
