"""Processes that execute calls; the loss of a process costs one call at most."""

from __future__ import annotations

import logging
import os
import signal
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from queue import Empty, SimpleQueue
from threading import Thread, current_thread, main_thread
from time import monotonic
from typing import Any, NamedTuple

from omnidrive.errors import WorkerLost
from omnidrive.study.heartbeat import Heartbeat

_ATTEMPTS = 2  # of a call whose process is killed
_MAX_FAILED_STARTS = 2  # in succession, of processes that end before they are ready
_TICK = 1.0  # s between checks while nothing happens
_TIME_TO_EXIT = 5.0  # s for processes without work, before they are killed

_TERMINAL_SIGNALS = {
    getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)
}
_END_SIGNALS = _TERMINAL_SIGNALS | {signal.SIGTERM}

_log = logging.getLogger("omnidrive")


class Lost(Enum):
    """Why a call has no result."""

    KILLED = "its process was killed twice, possibly because memory ran out"
    TIMED_OUT = "it exceeded the time limit"


class Call(NamedTuple):
    """A call that another process executes."""

    name: str
    """Name for messages."""
    function: Callable[[], Any]
    """Picklable function without arguments; its result must be picklable, too."""


class _Event(NamedTuple):
    """What a process sent: its readiness (the first event), a result or an exception."""

    worker: _Worker
    outcome: Any = None
    error: BaseException | None = None
    ended: bool = False
    """Whether the process ended, which is the last event."""


@dataclass(eq=False, slots=True)
class _Worker:
    """A process of this package and its present call.

    Attributes:
        process: The process.
        connection: Pipe to the process.
        since: When its start or its present call began, s on the monotonic clock.
        ready: Whether it has started.
        call: Index of the call that it executes. None: it waits.
        timed_out: Whether it was killed because of the time limit.
    """

    process: BaseProcess
    connection: Connection
    since: float
    ready: bool = False
    call: int | None = None
    timed_out: bool = False

    def execute(self, index: int, call: Call) -> None:
        """Send a call to the process."""
        self.call, self.since = index, monotonic()
        with suppress(OSError):  # the process has ended, which is an event of its own
            self.connection.send(call.function)


class Workers:
    """Processes that execute calls in parallel.

    A call whose process ends unexpectedly is executed once more in a new process; one that exceeds
    the time limit is not. Messages of a process are
    read by a thread, since the main thread must not wait for the rest of an incomplete message.
    """

    def __init__(
        self,
        count: int,
        setup: Callable[[], None],
        *,
        time_limit: float | None = None,
        start_limit: float = 60.0,
        on_tick: Callable[[], None] = lambda: None,
    ) -> None:
        """Prepare processes, which :meth:`outcomes` starts.

        Args:
            count: Largest number of processes at the same time.
            setup: Picklable function that every process executes first; if it raises, the start has
                failed.
            time_limit: Largest wall time of a call, s; the process is killed, and the outcome is
                :attr:`Lost.TIMED_OUT`. None: no limit.
            start_limit: Largest wall time of the start of a process, s; ``time_limit`` if that is
                larger. Ignored without ``time_limit``.
            on_tick: Called at least every second while :meth:`outcomes` waits, in its thread.
        """
        self._count, self._setup = count, setup
        self._time_limit, self._start_limit = time_limit, start_limit
        self._on_tick = on_tick
        self._events: SimpleQueue[_Event] = SimpleQueue()
        self._workers: list[_Worker] = []

    def outcomes(self, calls: Sequence[Call]) -> Generator[tuple[int, Any], None, None]:
        """Yield the index of each call and its result, or :class:`Lost`, when it is finished.

        Raises:
            WorkerLost: Two processes in succession ended before they were ready.
            Exception: That of a call, with the traceback in its process as a note; RuntimeError if
                it or the result cannot be pickled, and instead of SystemExit and the like. The
                other calls are abandoned.
        """
        waiting, attempts, left = deque(range(len(calls))), [0] * len(calls), len(calls)
        failed_starts = 0
        with Heartbeat() as heartbeat, self._ending():
            while left:
                self._distribute(calls, waiting, heartbeat)
                worker, outcome, error, ended = self._next_event()
                if error is not None:
                    raise error
                index, worker.call = worker.call, None
                if ended:
                    self._workers.remove(worker)
                    worker.process.kill()  # its pipe is closed, but it may still run
                    worker.process.join()
                    failed_starts += not worker.ready
                    if failed_starts == _MAX_FAILED_STARTS:
                        raise WorkerLost
                else:
                    worker.ready, failed_starts = True, 0
                if index is None:
                    continue
                heartbeat.end(calls[index].name)
                attempts[index] += 1
                if ended and not worker.timed_out and attempts[index] < _ATTEMPTS:
                    _log.warning(
                        "the process of %s was killed; starting it again", calls[index].name
                    )
                    waiting.appendleft(index)
                    continue
                left -= 1
                lost = Lost.TIMED_OUT if worker.timed_out else Lost.KILLED
                yield index, lost if ended else outcome

    def _distribute(self, calls: Sequence[Call], waiting: deque[int], heartbeat: Heartbeat) -> None:
        """Send waiting calls to idle processes, and start processes for the others."""
        for worker in self._workers:
            if waiting and worker.ready and worker.call is None:
                index = waiting.popleft()
                heartbeat.begin(calls[index].name)
                worker.execute(index, calls[index])
        starting = sum(not worker.ready for worker in self._workers)
        for _ in range(min(len(waiting) - starting, self._count - len(self._workers))):
            with _signals_deferred():  # no process is left out of the list
                self._start()

    def _next_event(self) -> _Event:
        """Wait for an event; kill processes that exceed the time limit."""
        while True:
            self._on_tick()
            if self._time_limit is not None:
                self._kill_late(self._time_limit)
            with suppress(Empty):
                return self._events.get(timeout=_TICK)

    def _kill_late(self, limit: float) -> None:
        """Kill processes that exceed the time limit of a call, s, or of their start."""
        for worker in self._workers:
            late = limit if worker.ready else max(limit, self._start_limit)
            busy = worker.call is not None or not worker.ready
            if busy and monotonic() - worker.since > late:
                worker.timed_out = True
                worker.process.kill()

    def _start(self) -> None:
        """Start a process and the thread that reads its messages."""
        context = get_context("spawn")
        ours, theirs = context.Pipe()
        with _signals_blocked():
            if os.name == "posix":
                resource_tracker.ensure_running()  # afterwards it unblocks signals itself
        with _signals_blocked():
            process = context.Process(target=_work, args=(self._setup, theirs))
            process.start()
        theirs.close()  # so that recv() raises EOFError when the process ends
        worker = _Worker(process, ours, monotonic())
        self._workers.append(worker)
        Thread(target=_read, args=(worker, self._events), daemon=True).start()

    @contextmanager
    def _ending(self) -> Iterator[None]:
        """End the processes after the block; kill them if it raises an exception."""
        try:
            yield
            for worker in self._workers:
                with suppress(OSError):
                    worker.connection.send(None)
            until = monotonic() + _TIME_TO_EXIT
            for worker in self._workers:
                worker.process.join(max(0.0, until - monotonic()))
        finally:
            for worker in self._workers:
                worker.process.kill()
            for worker in self._workers:
                worker.process.join()
            self._workers.clear()


@contextmanager
def _signals_deferred() -> Iterator[None]:
    """Handle the signals that end a command after the block: their handlers raise exceptions."""
    if current_thread() is not main_thread():  # handlers run in the main thread
        yield
        return
    arrived: list[int] = []
    before = {each: signal.getsignal(each) for each in _END_SIGNALS}
    try:
        for each, handler in before.items():
            if callable(handler):
                signal.signal(each, lambda number, _: arrived.append(number))
        yield
    finally:
        for each, handler in before.items():
            if callable(handler):
                signal.signal(each, handler)
        for number in arrived:
            signal.raise_signal(number)


def _read(worker: _Worker, events: SimpleQueue[_Event]) -> None:
    """Put what a process sends into ``events``, until it ends."""
    while True:
        try:
            outcome, error = worker.connection.recv()
        except (EOFError, OSError):
            events.put(_Event(worker, ended=True))
            return
        except Exception as failure:  # the result cannot be restored in this process
            outcome, error = None, failure
        events.put(_Event(worker, outcome, error))


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Block the signals that end a command, in this thread and in processes that it starts."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _END_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(setup: Callable[[], None], connection: Connection) -> None:
    """Execute calls, in a process of its own, until None is received."""
    for number in _TERMINAL_SIGNALS:  # the terminal sends them to all processes; the parent reacts
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _END_SIGNALS)
    Thread(target=_exit_with_parent, daemon=True).start()
    setup()
    connection.send((None, None))
    with suppress(EOFError, OSError):  # the parent process has ended
        while function := connection.recv():
            _answer(connection, function)


def _answer(connection: Connection, function: Callable[[], Any]) -> None:
    """Execute a call and send its result, or its exception with the traceback as a note."""
    result, error = None, None
    try:
        result = function()
    except Exception as raised:
        raised.add_note(f"in a worker process:\n{traceback.format_exc()}")
        error = raised
    except BaseException as raised:  # such as SystemExit, which ends this call only
        error = RuntimeError(f"{type(raised).__name__}: {raised}")
    try:
        connection.send((result, error))
    except OSError:
        raise
    except Exception as failure:  # it cannot be pickled
        what = error or failure
        connection.send((None, RuntimeError(f"{type(what).__name__}: {what}")))


def _exit_with_parent() -> None:
    """Exit when the parent process has ended for any reason."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
