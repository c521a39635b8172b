"""Execution of the runs of a study in one process or several, with the same results."""

from __future__ import annotations

import logging
import logging.handlers
import os
import pickle
import signal
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from ctypes import Array, c_char
from functools import partial
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import RawArray
from queue import Empty, SimpleQueue
from threading import Thread

from omnidrive.compiled.compilation import CompileRelay, compile_listeners
from omnidrive.errors import WorkerLost
from omnidrive.evaluation import FaultResult, StepResult, TrackResult
from omnidrive.study.jobs import Job, run_job
from omnidrive.study.planned_scenario import PlannedScenario
from omnidrive.study.scenario import Scenario
from omnidrive.visualization import Observer

Result = TrackResult | StepResult | FaultResult
_Logged = tuple[Result, list[logging.LogRecord]]
_Finished = tuple[Job, _Logged | BaseException]

_shared: list[PlannedScenario] = []  # one item in a worker process, used by all its runs
_records: SimpleQueue[logging.LogRecord] = SimpleQueue()  # of the present run in a worker process

_COMPILE_TIMES = {
    "holonomic-nmpc": 16.0, "fuzzy_t1": 9.0, "unicycle-nmpc": 3.0, "fuzzy_t2": 2.0, "fuzzy_t3": 2.0,
}  # fmt: skip
"""Approximate time to compile the kernels of a controller after those above it, s."""

_TERMINAL_SIGNALS = {
    getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)
}
_END_SIGNALS = _TERMINAL_SIGNALS | {signal.SIGTERM}


def execute(
    planned: PlannedScenario,
    jobs: Sequence[Job],
    processes: int,
    observers: Sequence[Observer] = (),
) -> Generator[tuple[Job, Result], None, None]:
    """Yield each job and its result when it is finished.

    The order depends on ``processes``, the results do not: every run has its own plant, controller
    and random numbers. The runs are sequential if there are observers, if the plant is exclusive,
    or if a component was typed into a Python session, which a worker process cannot import.

    Args:
        planned: The planned scenario.
        jobs: Runs to execute.
        processes: Number of worker processes; 1: in this process.
        observers: Observers of every run.

    Raises:
        WorkerLost: A worker process was killed; results yielded before are valid.
    """
    queue = _starting_order(planned.scenario, jobs)
    scenario = planned.scenario
    components = (*scenario.controllers.values(), scenario.plant)
    sequential = (
        scenario.plant_capabilities.exclusive
        or bool(observers)
        or not all(each.is_importable for each in components)
    )
    if sequential or processes <= 1 or len(queue) <= 1:
        for job in queue:
            yield job, run_job(planned, job, observers)
        return
    data = pickle.dumps(planned)
    # shared memory, not an argument: writing a large argument to a worker that cannot start blocks
    shared = RawArray(c_char, len(data))
    shared.raw = data
    relay = CompileRelay()
    with _signals_blocked():  # this starts the resource tracker process of Python
        pool = ProcessPoolExecutor(
            min(processes, len(queue)),
            mp_context=get_context("spawn"),
            initializer=_start_worker,
            initargs=(shared, relay, logging.getLogger("omnidrive").level),
        )
    finished: SimpleQueue[_Finished] = SimpleQueue()
    workers: list[BaseProcess] = []
    try:
        with ThreadPoolExecutor(1) as starter:  # Ctrl-C would interrupt a start in the main thread
            starter.submit(_start_workers, pool, queue, finished, workers).result()
        for _ in queue:
            yield _next_finished(finished, workers, relay)
    except BrokenProcessPool as error:
        raise WorkerLost from error
    except BaseException:  # the runs in progress are abandoned
        _kill_workers(pool, workers)
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _starting_order(scenario: Scenario, jobs: Sequence[Job]) -> list[Job]:
    """Sort runs: one run of each controller first, then the longest ones.

    On an empty cache the first runs compile the kernels of different controllers at the same time,
    those with the longest compile times first.
    """
    longest = sorted(jobs, key=lambda job: -job.duration)
    first = {job.controller: job for job in reversed(longest)}
    types = {label: controller.type for label, controller in scenario.controllers.items()}
    head = sorted(first.values(), key=lambda job: -_COMPILE_TIMES.get(types[job.controller], 0.0))
    return head + [job for job in longest if first[job.controller] is not job]


def _start_workers(
    pool: ProcessPoolExecutor,
    queue: Sequence[Job],
    finished: SimpleQueue[_Finished],
    workers: list[BaseProcess],
) -> None:
    """Submit all jobs, which starts the workers; append these to ``workers``.

    A thread of the pool puts the results into ``finished``: the main thread takes no lock of a
    future, which it would keep if a signal interrupted it at that moment.
    """

    def put(job: Job, future: Future[_Logged]) -> None:
        if not future.cancelled():
            finished.put((job, future.exception() or future.result()))

    with _signals_blocked():
        others = active_children()
        for job in queue:
            pool.submit(_run, job).add_done_callback(partial(put, job))
        workers += [process for process in active_children() if process not in others]


def _next_finished(
    finished: SimpleQueue[_Finished], workers: Sequence[BaseProcess], relay: CompileRelay
) -> tuple[Job, Result]:
    """Wait for the next finished job, while all workers are alive, and log what its worker logged.

    Workers write nothing to the terminal: their messages would break the progress display.

    Raises:
        WorkerLost: A worker ended while it was sending a result; the pool itself would wait for the
            rest of the result without end.
    """
    while True:
        relay.forward()
        try:
            job, outcome = finished.get(timeout=1.0)
        except Empty:
            if wait([process.sentinel for process in workers], timeout=0):
                raise WorkerLost from None
            continue
        if isinstance(outcome, BaseException):
            raise outcome
        result, records = outcome
        for record in records:
            logging.getLogger(record.name).handle(record)
        return job, result


def _kill_workers(pool: ProcessPoolExecutor, workers: Sequence[BaseProcess]) -> None:
    """Kill the workers, and close the result pipe.

    The thread of the pool may be reading an incomplete result. Its read ends when the write end of
    the pipe is closed in all processes, including this one.
    """
    for process in workers:
        process.kill()
    results = getattr(pool, "_result_queue", None)
    if results is not None:
        results._writer.close()


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


def _start_worker(shared: Array[c_char], relay: CompileRelay, log_level: int) -> None:
    """Initialise a worker process.

    Args:
        shared: The pickled scenario.
        relay: Channel for reports of compilations.
        log_level: Log level of the parent.
    """
    logging.getLogger("omnidrive").setLevel(log_level)
    logging.getLogger().addHandler(logging.handlers.QueueHandler(_records))
    logging.captureWarnings(True)
    compile_listeners.append(relay.send)
    for number in _TERMINAL_SIGNALS:  # the terminal sends them to all processes; the parent reacts
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _END_SIGNALS)
    Thread(target=_exit_with_parent, daemon=True).start()
    _shared[:] = [pickle.loads(shared.raw)]


def _exit_with_parent() -> None:
    """Exit when the parent process has ended for any reason."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _run(job: Job) -> _Logged:
    """Return the result of a run and what it logged."""
    result = run_job(_shared[0], job)
    return result, [_records.get() for _ in range(_records.qsize())]
