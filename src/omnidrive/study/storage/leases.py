"""Leases of runs: several processes share the work on one study.

A process leases the numbers of runs before it computes them. The leases of a process that has ended
are free: at once if it ran on this computer, otherwise when its heartbeat, a counter, has stood
still for a while on the monotonic clock of the observer, so that clocks may differ and jump.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Sequence
from contextlib import closing, suppress
from itertools import count
from pathlib import Path
from platform import node
from threading import Event, Thread
from time import monotonic
from typing import NamedTuple
from uuid import uuid4

from omnidrive.study.storage.store import KeyedPlan, Store

_RANGE = 2048  # numbers that are looked up at once


class Leases:
    """Leases of this process on the runs of a plan, in a ``with`` statement that releases them."""

    def __init__(
        self,
        store: Store,
        plan: KeyedPlan,
        *,
        interval: float = 5.0,
        patience: float = 30.0,
        order: Sequence[int] = (),
    ) -> None:
        """Prepare the leases.

        Args:
            store: The store of the study.
            plan: The plan.
            interval: Time between two heartbeats, s.
            patience: Time without a heartbeat after which the leases of a process of another
                computer are free, s.
            order: All numbers of a small plan in the order in which they are leased. Empty:
                increasing.
        """
        self._store, self._plan = store, plan
        self._rank = {number: k for k, number in enumerate(order)}
        self._interval, self._patience = interval, patience
        self._id = uuid4().hex
        self._seen: dict[str, tuple[int, float]] = {}  # heartbeat of others, and since when
        self._first = 0  # all runs before it are stored
        self._next = 0  # where the search begins
        self._ended = Event()
        self._thread = Thread(target=self._beat_on, daemon=True)

    def __enter__(self) -> Leases:
        """Start the heartbeat.

        Raises:
            CannotWrite: The store cannot be written.
        """
        with self._store.transaction() as connection:
            self._beat(connection, 0)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        with suppress(Exception), self._store.transaction() as connection:
            _remove(connection, self._id)

    @property
    def left(self) -> int:
        """Number of runs behind the last one that was leased."""
        return len(self._plan) - self._next

    def take(self, count: int) -> list[int] | None:
        """Lease up to ``count`` runs that are not stored, and return their numbers.

        A run whose key another process has leased is left to that process.

        Returns:
            The numbers; empty if others have leased all that are left; None if none is left.

        Raises:
            CannotWrite: The leases cannot be stored.
        """
        with self._store.transaction() as connection:
            self._release_ended(connection)
            found = self._search(connection, self._next, count)
            if not found and self._next > self._first:
                found = self._search(connection, self._first, count)
            rows = [(number, key, self._id) for number, key in found]
            connection.executemany("INSERT INTO leases VALUES (?,?,?)", rows)
        if found:
            self._next = self._first if self._rank else found[-1][0] + 1
            return [number for number, _ in found]
        is_done = next(self._store.missing(self._plan, self._first), None) is None
        return None if is_done else []

    def _search(
        self, connection: sqlite3.Connection, start: int, count: int
    ) -> list[tuple[int, str]]:
        """Return numbers and keys of up to ``count`` runs that are neither stored nor leased."""
        found: list[tuple[int, str]] = []
        for low in range(start, len(self._plan), _RANGE):
            high = min(low + _RANGE, len(self._plan))
            stored = self._store.numbers(low, high)
            if low <= self._first <= high and len(stored) == high - low:
                self._first = high
            leased = {
                number
                for (number,) in connection.execute(
                    "SELECT number FROM leases WHERE number >= ? AND number < ?", (low, high)
                )
            }
            for number in sorted(range(low, high), key=lambda n: self._rank.get(n, n)):
                if number in stored or number in leased:
                    continue
                (key,) = self._plan.keys(number, number + 1)
                taken = connection.execute(
                    "SELECT 1 FROM leases WHERE key = ? AND owner != ?", (key, self._id)
                )
                if taken.fetchone() is None:
                    found.append((number, key))
                if len(found) == count:
                    return found
        return found

    def _release_ended(self, connection: sqlite3.Connection) -> None:
        """Release the leases of processes that have ended."""
        others = connection.execute(
            "SELECT id, host, pid, started, beat FROM processes WHERE id != ?", (self._id,)
        ).fetchall()
        for owner, host, pid, started, beat in others:
            if host == HOST:
                if _start_of(pid) == started:
                    continue
            elif not self._stands_still(owner, beat):
                continue
            _remove(connection, owner)

    def _stands_still(self, owner: str, beat: int) -> bool:
        """Return whether the heartbeat of a process of another computer has stopped."""
        last, since = self._seen.get(owner, (None, 0.0))
        if last != beat:
            self._seen[owner] = beat, monotonic()
            return False
        return monotonic() - since > self._patience

    def _beat_on(self) -> None:
        """Count the heartbeat, with a connection of this thread, until the leases end."""
        with closing(sqlite3.connect(self._store.path, isolation_level=None)) as connection:
            for beat in count(1):
                if self._ended.wait(self._interval):
                    return
                with suppress(sqlite3.Error):  # the next one may succeed
                    self._beat(connection, beat)

    def _beat(self, connection: sqlite3.Connection, beat: int) -> None:
        """Store the heartbeat; also if another process took this one for ended."""
        row = (self._id, HOST, os.getpid(), _start_of(os.getpid()), beat)
        connection.execute("INSERT OR REPLACE INTO processes VALUES (?,?,?,?,?)", row)


class AtWork(NamedTuple):
    """Work that is being done on a study."""

    runs: int
    """Runs that processes have leased."""
    processes: int
    """Number of these processes; those of other computers may have ended a moment ago."""


def at_work(store: Store) -> AtWork:
    """Return the number of leases of processes that may run, and that of these processes."""
    found = store.read("SELECT id, host, pid, started FROM processes")
    running = [owner for owner, host, pid, at in found if host != HOST or _start_of(pid) == at]
    leases = [owner for (owner,) in store.read("SELECT owner FROM leases")]
    return AtWork(sum(owner in running for owner in leases), len(running))


def _remove(connection: sqlite3.Connection, owner: str) -> None:
    """Remove a process and its leases."""
    connection.execute("DELETE FROM leases WHERE owner = ?", (owner,))
    connection.execute("DELETE FROM processes WHERE id = ?", (owner,))


def _host() -> str:
    """Return what processes have in common whose numbers are comparable: computer, boot, space."""
    parts = [node()]
    with suppress(OSError):
        parts.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip())
        parts.append(os.readlink("/proc/self/ns/pid"))
    return " ".join(parts)


HOST = _host()
"""Identity of this computer since its start; of a container, that of its process numbers."""


def _start_of(pid: int) -> str | None:
    """Return when a process of this computer started, in any unit; None: there is none.

    The number of a process that has ended may be that of another one, with another start. Without
    the file system ``proc``, the answer is empty.
    """
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return None
    except OSError:  # of another user
        pass
    if not os.path.isdir("/proc/self"):
        return ""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()
    return None if fields[0] in "ZX" else fields[19]
