"""Processes that execute calls; the loss of a process costs one call at most.

Each process is the only worker of an executor of loky, so that a lost process names its call.
Messages to and from a process are short: longer data pass through files. A process that is killed
within a message therefore blocks no other process. Compilations in the processes are reported here.
"""

from __future__ import annotations

import logging
import os
import pickle
import shutil
import signal
import tempfile
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from enum import Enum
from multiprocessing import Pipe, resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread, current_thread, main_thread
from time import monotonic, sleep
from typing import Any, NamedTuple
from uuid import uuid4

import cloudpickle
from loky import BrokenProcessPool, Future, ProcessPoolExecutor, process_executor, wait
from loky.backend import resource_tracker as loky_tracker

from omnidrive.compiled.compilation import CompileRelay, compile_listeners
from omnidrive.errors import WorkerLost
from omnidrive.execution.heartbeat import Heartbeat
from omnidrive.files.child_processes import safe_path

_ATTEMPTS = 3  # of a call whose process is killed
_MAX_FAILED_STARTS = 3  # in succession, of processes that end before they are ready
_TICK = 1.0  # s between checks while nothing happens
_SHORT = 2000  # bytes of a message; a pipe takes it at once, even without a reader

_TERMINAL_SIGNALS = {
    getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)
}
_END_SIGNALS = _TERMINAL_SIGNALS | {signal.SIGTERM}

_ONE_THREAD = {
    f"{library}_NUM_THREADS": "1"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB", "NUMEXPR")
}
"""Environment of a process: the parallel calls use the cores, not the linear algebra of one."""

_log = logging.getLogger("omnidrive")


class Lost(Enum):
    """Why a call has no result."""

    KILLED = "its process was killed three times, possibly because memory ran out"
    TIMED_OUT = "it exceeded the time limit"


class Call(NamedTuple):
    """A call that another process executes."""

    name: str
    """Name for messages."""
    function: Callable[[], Any]
    """Picklable function without arguments; its result must be picklable, too."""


class Ended(NamedTuple):
    """A call that has ended."""

    call: Call
    result: Any
    """The result, or why there is none: :attr:`Lost.KILLED` after one loss of its process."""


@dataclass(eq=False, slots=True)
class _Worker:
    """A process and its present call.

    Attributes:
        executor: The executor whose only worker is the process.
        future: Outcome of the start or of the present call. None: it waits for a call.
        since: When that began, s on the monotonic clock.
        call: The present call. None: it starts, or waits.
        timed_out: Whether it was killed because of the time limit.
    """

    executor: ProcessPoolExecutor
    future: Future | None
    since: float = field(default_factory=monotonic)
    call: Call | None = None
    timed_out: bool = False

    def kill(self) -> None:
        """Kill the process."""
        self.executor.shutdown(wait=True, kill_workers=True)


class WorkerPool:
    """Processes that execute calls in parallel, in a ``with`` statement that ends them.

    Attributes:
        size: Largest number of processes at the same time.
    """

    def __init__(
        self,
        size: int,
        setup: Callable[[], None],
        *,
        time_limit: float | None = None,
        start_limit: float = 60.0,
    ) -> None:
        """Prepare processes, which start with the first calls.

        Args:
            size: Largest number of processes at the same time.
            setup: Picklable function that every process executes first; if it raises, the start has
                failed.
            time_limit: Largest wall time of a call, s; the process is killed, and the result is
                :attr:`Lost.TIMED_OUT`. None: no limit.
            start_limit: Largest wall time of the start of a process, s; ``time_limit`` if that is
                larger. Ignored without ``time_limit``.
        """
        self.size = size
        self._setup = setup
        self._time_limit, self._start_limit = time_limit, start_limit
        self._relay = CompileRelay()
        self._workers: list[_Worker] = []
        self._waiting: deque[Call] = deque()
        self._failed_starts = 0
        self._heartbeat = Heartbeat()
        self._lifeline, self._held = Pipe(duplex=False)
        self._folder = Path()

    def __enter__(self) -> WorkerPool:
        self._folder = Path(tempfile.mkdtemp(prefix="omnidrive-"))
        self._heartbeat.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            for worker in self._workers:
                worker.kill()
            self._workers.clear()
        finally:
            self._heartbeat.__exit__()
            self._held.close()
            self._lifeline.close()
            shutil.rmtree(self._folder, ignore_errors=True)

    @property
    def free(self) -> int:
        """Number of calls that would start at once, or as soon as a process is ready."""
        return self.size - self.unfinished

    @property
    def unfinished(self) -> int:
        """Number of calls that have not ended."""
        return len(self._waiting) + sum(each.call is not None for each in self._workers)

    def submit(self, call: Call, *, first: bool = False) -> None:
        """Queue a call, at the beginning of the queue if ``first``; start a process if needed."""
        (self._waiting.appendleft if first else self._waiting.append)(call)
        self._distribute()

    def wait(self, timeout: float | None = None) -> list[Ended]:
        """Wait until at least one call ends, and return those that have ended.

        Args:
            timeout: Return an empty list after this wall time, s. None: do not.

        Raises:
            WorkerLost: Three processes in succession ended before they were ready.
            Exception: That of a call, with the traceback in its process as a note; RuntimeError if
                it or the result cannot be pickled, and instead of SystemExit and the like.
        """
        until = None if timeout is None else monotonic() + timeout
        while True:
            self._relay.forward()
            self._kill_late()
            self._distribute()
            pending = {each.future: each for each in self._workers if each.future}
            left = _TICK if until is None else max(min(_TICK, until - monotonic()), 0.0)
            if not pending:
                sleep(left)
            done = wait(list(pending), timeout=left, return_when="FIRST_COMPLETED").done
            ended = [each for future in done if (each := self._ended(pending[future]))]
            if ended or (until is not None and monotonic() >= until):
                self._distribute()
                return ended

    def outcomes(self, calls: Sequence[Call]) -> Generator[tuple[int, Any], None, None]:
        """Yield the index of each call and its result, or :class:`Lost`, when it has ended.

        A call whose process is killed is executed three times at most.

        Raises:
            Exception: As :meth:`wait`; the other calls are abandoned.
        """
        indices = {id(call): index for index, call in enumerate(calls)}
        attempts = [0] * len(calls)
        for call in calls:
            self.submit(call)
        while self.unfinished:
            for call, result in self.wait():
                index = indices[id(call)]
                attempts[index] += 1
                if result is Lost.KILLED and attempts[index] < _ATTEMPTS:
                    _log.warning("the process of %s was killed; starting it again", call.name)
                    self.submit(call, first=True)
                else:
                    yield index, result

    def _distribute(self) -> None:
        """Send waiting calls to idle processes, and start processes for the others."""
        for worker in self._workers:
            if self._waiting and worker.future is None:
                worker.call, worker.since = self._waiting.popleft(), monotonic()
                self._heartbeat.begin(worker.call.name)
                packed = _pack(worker.call.function, self._folder)
                with suppress(BrokenProcessPool):  # it has ended, which the future tells
                    worker.future = _broken()
                    worker.future = worker.executor.submit(_execute, packed, self._folder)
        starting = sum(each.call is None and each.future is not None for each in self._workers)
        for _ in range(min(len(self._waiting) - starting, self.size - len(self._workers))):
            with _signals_deferred():  # no process is left out of the list
                self._start()

    def _start(self) -> None:
        """Start a process."""
        setup = _pack(self._setup, self._folder)
        with _signals_blocked(), safe_path():
            if os.name == "posix":
                resource_tracker.ensure_running()  # afterwards it unblocks signals itself
                loky_tracker.ensure_running()
        with _signals_blocked(), safe_path():
            executor = ProcessPoolExecutor(
                1,
                initializer=_start_worker,
                initargs=(self._lifeline, self._folder, self._relay, _log.level),
                env=_ONE_THREAD,
            )
            future = executor.submit(_execute, setup, self._folder)
        self._workers.append(_Worker(executor, future))

    def _ended(self, worker: _Worker) -> Ended | None:
        """Handle the end of a start or of a call; return the call, if it was one."""
        call, future = worker.call, worker.future
        assert future is not None
        worker.call = worker.future = None
        if call is not None:
            self._heartbeat.end(call.name)
        if isinstance(future.exception(), BrokenProcessPool) or worker.timed_out:
            self._workers.remove(worker)
            worker.kill()
            if call is None:
                self._failed_starts += 1
                if self._failed_starts == _MAX_FAILED_STARTS:
                    cause = "exceed the time limit" if worker.timed_out else "are killed"
                    raise WorkerLost(
                        f"{_MAX_FAILED_STARTS} worker processes in succession {cause} while they "
                        "start, possibly because memory ran out; finished runs are kept. One run "
                        "at a time needs the least memory: --jobs 1 (in Python: processes=1)"
                    )
                return None
            return Ended(call, Lost.TIMED_OUT if worker.timed_out else Lost.KILLED)
        result, error = _unpack(future.result())
        if error is not None:
            raise error
        self._failed_starts = 0
        return Ended(call, result) if call is not None else None

    def _kill_late(self) -> None:
        """Kill processes that exceed the time limit of a call or of their start."""
        if self._time_limit is None:
            return
        for worker in self._workers:
            starts = worker.call is None
            late = max(self._time_limit, self._start_limit) if starts else self._time_limit
            if worker.future is not None and monotonic() - worker.since > late:
                worker.timed_out = True
                worker.kill()


def _broken() -> Future:
    """Return the outcome of a call whose process has ended before it."""
    future = Future()
    future.set_exception(BrokenProcessPool())
    return future


def _pack(value: Any, folder: Path) -> bytes | Path:
    """Return a short message for a value: its pickle, or a new file with it.

    Functions of the program's main module are part of the pickle, so that a script needs no guard.
    """
    data: bytes = cloudpickle.dumps(value)
    if len(data) <= _SHORT:
        return data
    path = folder / uuid4().hex
    path.write_bytes(data)
    return path


def _unpack(message: bytes | Path) -> Any:
    """Return the value of a message of this program, and remove its file."""
    if isinstance(message, bytes):
        return pickle.loads(message)
    data = message.read_bytes()
    message.unlink()
    return pickle.loads(data)


def _start_worker(lifeline: Connection, folder: Path, relay: CompileRelay, log_level: int) -> None:
    """Initialise a worker process."""
    _log.setLevel(log_level)
    compile_listeners.append(relay.send)
    for number in _TERMINAL_SIGNALS:  # the terminal sends them to all processes; the parent reacts
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _END_SIGNALS)
    # kernels and planned scenarios stay in memory: a process that grows is not replaced
    process_executor._MAX_MEMORY_LEAK_SIZE = float("inf")
    Thread(target=_exit_with_parent, args=(lifeline, folder), daemon=True).start()


def _exit_with_parent(lifeline: Connection, folder: Path) -> None:
    """Exit when the process that started this one has ended for any reason."""
    with suppress(EOFError, OSError):
        lifeline.recv_bytes()
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def _execute(message: bytes | Path, folder: Path) -> bytes | Path:
    """Execute a function; return a message with its result, or its exception with a traceback."""
    result, error = None, None
    try:
        result = _unpack(message)()
    except Exception as raised:
        raised.add_note(f"in a worker process:\n{traceback.format_exc()}")
        error = raised
    except BaseException as raised:  # such as SystemExit, which ends this call only
        error = RuntimeError(f"{type(raised).__name__}: {raised}")
    try:
        return _pack((result, error), folder)
    except OSError:
        raise
    except Exception as failure:  # it cannot be pickled
        what = error or failure
        return _pack((None, RuntimeError(f"{type(what).__name__}: {what}")), folder)


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
