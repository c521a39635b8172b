"""Stored results of a study: an SQLite database that survives the loss of any process.

Every change is one transaction, which is on the disk before the method returns (write-ahead log,
``synchronous=FULL``). A run has one row of results by its key, and one row per number of the plan,
both with checksums, see :mod:`omnidrive.study.storage.stored_rows`. Readers leave out damaged runs;
before a process writes, it is rebuilt without them, see
:mod:`omnidrive.study.storage.store_opening`. Several processes may work on one study: each leases
numbers, see :mod:`omnidrive.study.storage.leases`.
"""

from __future__ import annotations

import logging
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

from omnidrive.errors import InvalidStore, one_line
from omnidrive.evaluation.run_record import RunRecord
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.study.output_paths import STORE_FILE as FILE
from omnidrive.study.storage.store_errors import store_errors
from omnidrive.study.storage.store_opening import open_to_read, open_to_write
from omnidrive.study.storage.stored_rows import (
    INSERT_RESULT,
    INSERT_RUN,
    RESULT_OF_KEY,
    Loss,
    count_outcomes,
    loss,
    read_facts,
    result_record,
    result_row,
    run_row,
    valid_rows,
    write_facts,
)

if TYPE_CHECKING:
    import pyarrow as pa

    from omnidrive.study.design.planned_run import PlannedRun
    from omnidrive.study.storage.record_table import StoredTables

_log = logging.getLogger("omnidrive")

_RANGE = 2048  # numbers that are looked up at once
_MAX_FAILURES = 5  # failed runs that are named


@runtime_checkable
class KeyedPlan(Protocol):
    """The runs of a study in order, with their keys."""

    def __len__(self) -> int:
        """Return the number of runs."""
        ...

    def __getitem__(self, number: int) -> PlannedRun:
        """Return a run."""
        ...

    def keys(self, start: int, stop: int) -> Sequence[str]:
        """Return the keys of the runs from ``start`` to before ``stop``."""
        ...


class StoreStatus(NamedTuple):
    """Number of stored runs."""

    runs: int
    """Stored runs of the plan."""
    outcomes: dict[str, int]
    """Stored runs by outcome."""
    failures: list[tuple[int, str]]
    """Number and reason, or outcome without a reason, of the first runs that ended early."""
    loss: Loss
    """Stored runs that are damaged; they are not counted above."""


class Store:
    """The database of a study in a folder; use it in a ``with`` statement."""

    def __init__(self, folder: StrPath, *, read_only: bool = False) -> None:
        """Open the database, or create it.

        Args:
            folder: Folder of the study.
            read_only: Whether the database must exist and is not changed.

        Raises:
            InvalidStore: The file is no database of a study, is of another version of this
                package, or nothing in it can be read; it is not changed.
            CannotWrite: The database cannot be opened, created or read.
        """
        self.path = to_path(folder) / FILE
        if read_only and not self.path.is_file():
            raise InvalidStore(f"there is no study in {one_line(str(folder))}: no file {FILE}")
        with self.errors():
            self._connection = (open_to_read if read_only else open_to_write)(self.path)

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the database."""
        self._connection.close()

    def fact(self, name: str) -> str | None:
        """Return a fact about the study, such as the hash of its definition; None: unknown.

        Raises:
            InvalidStore: The facts are damaged.
        """
        found = self._facts().get(name)
        return None if found is None else str(found)

    def note(self, name: str, value: str) -> None:
        """Store a fact about the study.

        Raises:
            CannotWrite: It cannot be stored.
        """
        if self.fact(name) != value:
            with self.transaction() as connection:
                write_facts(connection, {**self._facts(), name: value})

    def _facts(self) -> dict[str, Any]:
        """Return the facts about the study, among them the number of stored runs, ``runs``."""
        with self.errors():
            found = read_facts(self._connection)
        if found is None:
            raise InvalidStore(
                f"{one_line(str(self.path))} is damaged: the number of its runs and its stop rule "
                "are lost. Repeat the command that began the study (omnidrive study FILE --out "
                "FOLDER); stored runs are kept"
            )
        return found

    def begin(self, definition: str) -> None:
        """Prepare the database for a plan.

        If it held the runs of another one, results are kept and found by their keys; the numbers
        of the other plan are forgotten.

        Args:
            definition: Hash of the definition of the study, without the number of repetitions.

        Raises:
            CannotWrite: The database cannot be written.
        """
        if self.fact("definition") == definition:
            return
        with self.transaction() as connection:
            facts = self._facts()
            if facts.get("definition") != definition:  # another process may have done it
                if facts["runs"]:
                    _log.warning(
                        "%s: what its runs depend on has changed (the study, a file, code or a "
                        "version); stored runs that it does not concern are kept",
                        one_line(str(self.path.parent)),
                    )
                connection.execute("DELETE FROM runs")
                connection.execute("DELETE FROM leases")
                write_facts(connection, {**facts, "definition": definition, "runs": 0})

    def add(self, records: Sequence[RunRecord]) -> None:
        """Store records in one transaction, and release the leases of their runs.

        A result that is stored already is kept.

        Raises:
            CannotWrite: They cannot be written; none of them is stored.
        """
        results = [result_row(record) for record in records]
        runs = [run_row(record) for record in records]
        numbers = [(record.number,) for record in records]
        with self.transaction() as connection:
            connection.executemany(INSERT_RESULT, results)
            old = connection.executemany("DELETE FROM runs WHERE number = ?", numbers).rowcount
            new = connection.executemany(INSERT_RUN, runs).rowcount
            facts = self._facts()
            write_facts(connection, {**facts, "runs": facts["runs"] + max(new, 0) - max(old, 0)})
            connection.executemany("DELETE FROM leases WHERE number = ?", numbers)

    def forget(self, numbers: Iterable[int]) -> None:
        """Remove stored runs and their results, so that they are computed again.

        Raises:
            CannotWrite: They cannot be removed.
        """
        rows = [(number,) for number in numbers]
        with self.transaction() as connection:
            connection.executemany(
                "DELETE FROM results WHERE id IN (SELECT result FROM runs WHERE number = ?)", rows
            )
            removed = connection.executemany("DELETE FROM runs WHERE number = ?", rows).rowcount
            facts = self._facts()
            write_facts(connection, {**facts, "runs": facts["runs"] - max(removed, 0)})

    def missing(self, plan: KeyedPlan, start: int = 0) -> Iterator[int]:
        """Yield the numbers of the runs from ``start`` on that are not stored."""
        for low in range(start, len(plan), _RANGE):
            high = min(low + _RANGE, len(plan))
            stored = self.numbers(low, high)
            if len(stored) < high - low:
                yield from (number for number in range(low, high) if number not in stored)

    def numbers(self, start: int, stop: int) -> set[int]:
        """Return the stored numbers from ``start`` to before ``stop``."""
        with self.errors():
            return {
                number
                for (number,) in self._connection.execute(
                    "SELECT number FROM runs WHERE number >= ? AND number < ?", (start, stop)
                )
            }

    def results(self, keys: Iterable[str]) -> dict[str, RunRecord]:
        """Return the stored results with these keys; see :func:`~.run_recording.relabelled`."""
        with self.errors():
            rows = {key: self._connection.execute(RESULT_OF_KEY, (key,)).fetchone() for key in keys}
            return {key: result_record(key, row) for key, row in rows.items() if row is not None}

    def records(self) -> pa.Table:
        """Return the undamaged stored runs in the order of the plan, without computing times.

        The columns are number, key, pairing, controller, task, duration, variant, repetition,
        repeat, outcome and finished, then ``factor:PATH`` of each factor, then the metrics, by
        name. The table does not depend on the order in which the runs were stored.
        """
        return self.tables().records

    def timing(self) -> pa.Table:
        """Return the computing times of the undamaged stored runs, us, by ``number``."""
        return self.tables().timing

    def tables(self) -> StoredTables:
        """Return the tables of :meth:`records` and :meth:`timing`, and which runs are damaged."""
        from omnidrive.study.storage.record_table import stored_tables  # noqa: PLC0415 - takes a second

        with self.errors(), self._snapshot():
            return stored_tables(self._connection, self._facts()["runs"])

    def status(self) -> StoreStatus:
        """Return the number of stored runs, in total and by outcome."""
        counts: Counter[str] = Counter()
        failures: list[tuple[int, str]] = []
        with self.errors(), self._snapshot():
            found = count_outcomes(self._connection)
            for (outcome, _), number in found.items():
                counts[outcome] += number
            if not all(finished for _, finished in found):
                failures = self._failures(_MAX_FAILURES)
            lost = loss(self._connection, counts.total(), self._facts()["runs"])
        return StoreStatus(counts.total(), dict(sorted(counts.items())), failures, lost)

    def failures(self, count: int) -> list[tuple[int, str]]:
        """Return number and reason, or outcome, of the first ``count`` runs that ended early."""
        with self.errors(), self._snapshot():
            return self._failures(count)

    def _failures(self, count: int) -> list[tuple[int, str]]:
        columns = "substr(detail, 1, 500), outcome"
        first = next(valid_rows(self._connection, columns, "NOT finished"), [])[:count]
        return [
            (number, (text.splitlines() or [outcome.replace("_", " ")])[0])
            for number, text, outcome in first
        ]

    @property
    def count(self) -> int:
        """Number of stored runs, according to the facts about the study."""
        return int(self._facts()["runs"])

    def read(self, query: str) -> list[tuple[Any, ...]]:
        """Return the rows of a query."""
        with self.errors():
            return self._connection.execute(query).fetchall()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Yield the connection; the changes of the block are stored together, or not at all.

        Raises:
            CannotWrite: They cannot be stored.
        """
        with self.errors():
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    @contextmanager
    def _snapshot(self) -> Iterator[None]:
        """Read one state of the database in a block, although other processes write."""
        self._connection.execute("BEGIN")
        try:
            yield
        finally:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Convert errors of the database in a block.

        Raises:
            InvalidStore: The file is no database of a study, or is damaged.
            CannotWrite: The database cannot be written, or read because another process locks it.
        """
        with store_errors(self.path):
            yield
