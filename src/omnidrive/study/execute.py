"""Doing many runs, on one core or several, with the same numbers."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from omnidrive.evaluation import StepResult, TrackResult
from omnidrive.study.jobs import Job, run_job
from omnidrive.study.prepared import Prepared

Result = TrackResult | StepResult

_shared: list[Prepared] = []  # in a worker process: what its runs share


def execute(
    prepared: Prepared, jobs: Sequence[Job], processes: int
) -> Iterator[tuple[Job, Result]]:
    """Yield each job with its result as it finishes; the order depends on ``processes``.

    Every run owns its plant, controller and random numbers, so results do not depend on it.
    Runs are started longest first.
    """
    queue = sorted(jobs, key=lambda job: -job.duration)
    if processes <= 1 or len(queue) <= 1:
        for job in queue:
            yield job, run_job(prepared, job)
        return
    pool = ProcessPoolExecutor(
        min(processes, len(queue)),
        mp_context=get_context("spawn"),
        initializer=_start_worker,
        initargs=(prepared,),
    )
    try:
        futures = {pool.submit(_run, job): job for job in queue}
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BaseException:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _start_worker(prepared: Prepared) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C means
    _shared[:] = [prepared]


def _run(job: Job) -> Result:
    return run_job(_shared[0], job)
