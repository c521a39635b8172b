"""Doing many runs, on one core or several, with the same numbers."""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures import wait as wait_for_futures
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from ctypes import Array, c_char
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from multiprocessing.sharedctypes import RawArray
from threading import Thread

from omnidrive.errors import WorkerLost
from omnidrive.evaluation import FaultResult, StepResult, TrackResult
from omnidrive.study.jobs import Job, run_job
from omnidrive.study.planned_scenario import PlannedScenario
from omnidrive.study.scenario import PREDICTIVE
from omnidrive.visualization import Observer

Result = TrackResult | StepResult | FaultResult

_shared: list[PlannedScenario] = []  # in a worker process: what its runs share

_KEYBOARD = {getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)}
_ENDINGS = _KEYBOARD | {signal.SIGTERM}


def execute(
    planned: PlannedScenario,
    jobs: Sequence[Job],
    processes: int,
    observers: Sequence[Observer] = (),
) -> Generator[tuple[Job, Result], None, None]:
    """Yield each job with its result as it finishes; the order depends on ``processes``.

    Every run owns its plant, controller and random numbers, so results do not depend on it.
    Runs are started longest first; of equally long ones those of predictive controllers, whose
    kernels take longest to compile. They are done one by one where ``observers`` see them, and in
    CoppeliaSim, which holds one robot.

    Raises:
        WorkerLost: A worker process was killed; what was yielded before stands.
    """
    queue = sorted(jobs, key=lambda job: (-job.duration, job.controller not in PREDICTIVE))
    alone = planned.scenario.plant_capabilities.exclusive or bool(observers)
    if alone or processes <= 1 or len(queue) <= 1:
        for job in queue:
            yield job, run_job(planned, job, observers)
        return
    data = pickle.dumps(planned)
    shared = RawArray(c_char, len(data))  # a worker that cannot start would never read it from us
    shared.raw = data
    with _undisturbed():  # this starts Python's own helper, the resource tracker
        pool = ProcessPoolExecutor(
            min(processes, len(queue)),
            mp_context=get_context("spawn"),
            initializer=_start_worker,
            initargs=(shared,),
        )
    futures: dict[Future[Result], Job] = {}
    workers: list[BaseProcess] = []
    try:
        with ThreadPoolExecutor(1) as aside:  # Ctrl-C would break a start in the main thread
            aside.submit(_start, pool, queue, futures, workers).result()
        for future in _as_completed(futures, workers):
            yield futures[future], future.result()
    except BrokenProcessPool as error:
        raise WorkerLost from error
    except BaseException:  # nobody waits for the runs that are under way
        _end(pool, workers)
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _start(
    pool: ProcessPoolExecutor,
    queue: Sequence[Job],
    futures: dict[Future[Result], Job],
    workers: list[BaseProcess],
) -> None:
    """Hand over all jobs, which starts the workers."""
    with _undisturbed():
        others = active_children()
        for job in queue:
            futures[pool.submit(_run, job)] = job
        workers += [process for process in active_children() if process not in others]


def _as_completed(
    futures: Iterable[Future[Result]], workers: Sequence[BaseProcess]
) -> Iterator[Future[Result]]:
    """Futures as they are done, as long as all workers live.

    Raises:
        WorkerLost: A worker has died in the middle of an answer, for the rest of which the pool
            itself would wait for ever.
    """
    open_ = set(futures)
    while open_:
        done, open_ = wait_for_futures(open_, timeout=1.0, return_when=FIRST_COMPLETED)
        if not done and wait([process.sentinel for process in workers], timeout=0):
            raise WorkerLost
        yield from done


def _end(pool: ProcessPoolExecutor, workers: Sequence[BaseProcess]) -> None:
    """Kill the workers, and wake the pool's own thread should it wait for the rest of an answer.

    It reads a pipe that ends once nobody holds its other side: neither the workers, nor we.
    """
    for process in workers:
        process.kill()
    answers = getattr(pool, "_result_queue", None)
    if answers is not None:
        answers._writer.close()


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Hold back the signals that end a command from what this thread starts meanwhile."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _ENDINGS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_worker(shared: Array[c_char]) -> None:
    """Made ready by the parent: what all runs share, pickled by itself in memory of both."""
    for number in _KEYBOARD:  # the terminal tells all its processes; the parent decides
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _ENDINGS)
    Thread(target=_end_with_parent, daemon=True).start()
    _shared[:] = [pickle.loads(shared.raw)]


def _end_with_parent() -> None:
    """Wait for the death of the parent process, whatever its cause, and follow."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _run(job: Job) -> Result:
    return run_job(_shared[0], job)
