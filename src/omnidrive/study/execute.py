"""Execution of the runs of a study in one process or several, with the same results."""

from __future__ import annotations

import logging
import logging.handlers
import pickle
from collections.abc import Generator, Sequence
from contextlib import closing
from ctypes import Array, c_char
from functools import partial
from multiprocessing import current_process
from multiprocessing.sharedctypes import RawArray
from queue import SimpleQueue

from omnidrive.compiled.compilation import CompileRelay, compile_listeners
from omnidrive.simulation import Outcome
from omnidrive.study.heartbeat import Heartbeat
from omnidrive.study.jobs import Job, Result, job_name, run_job, unfinished
from omnidrive.study.planned_scenario import PlannedScenario
from omnidrive.study.scenario import Scenario
from omnidrive.study.workers import Call, Lost, Workers
from omnidrive.visualization import Observer

_shared: list[PlannedScenario] = []  # one item in a worker process, used by all its runs
_records: SimpleQueue[logging.LogRecord] = SimpleQueue()  # of the present run in a worker process

_COMPILE_TIMES = {
    "holonomic-nmpc": 16.0, "fuzzy_t1": 9.0, "unicycle-nmpc": 3.0, "fuzzy_t2": 2.0, "fuzzy_t3": 2.0,
}  # fmt: skip
"""Approximate time to compile the kernels of a controller after those above it, s."""


def execute(
    planned: PlannedScenario,
    jobs: Sequence[Job],
    processes: int,
    observers: Sequence[Observer] = (),
    *,
    run_timeout: float | None = None,
) -> Generator[tuple[Job, Result], None, None]:
    """Yield each job and its result when it is finished.

    The order depends on ``processes``, the results do not: every run has its own plant, controller
    and random numbers. A run whose process is killed is executed once more; if that is killed too,
    its outcome says so, and the other runs go on.

    Args:
        planned: The planned scenario.
        jobs: Runs to execute.
        processes: Number of worker processes; 1: in this process.
        observers: Observers of every run.
        run_timeout: Largest wall time of a run, s; the runs are executed in worker processes, also
            if it is one, so :func:`is_sequential` must be false. None: no limit.

    Raises:
        WorkerLost: Worker processes end while they start.
    """
    queue = _starting_order(planned.scenario, jobs)
    parallel = processes > 1 and len(queue) > 1
    if run_timeout is None and (is_sequential(planned.scenario, observers) or not parallel):
        with Heartbeat() as heartbeat:
            for job in queue:
                heartbeat.begin(job_name(planned, job))
                result = run_job(planned, job, observers)
                heartbeat.end(job_name(planned, job))
                yield job, result
    else:
        yield from _in_workers(planned, queue, processes, run_timeout)


def is_sequential(scenario: Scenario, observers: Sequence[Observer] = ()) -> bool:
    """Return whether the runs must be executed in this process.

    That is so if there are observers, if the plant is exclusive, if a component was typed into a
    Python session, which a worker process cannot import, or if this process is a daemon, such as
    one of a pool, which may not start processes.
    """
    components = (*scenario.controllers.values(), scenario.plant)
    return (
        scenario.plant_capabilities.exclusive
        or bool(observers)
        or current_process().daemon
        or not all(each.is_importable for each in components)
    )


def _in_workers(
    planned: PlannedScenario, queue: Sequence[Job], processes: int, run_timeout: float | None
) -> Generator[tuple[Job, Result], None, None]:
    """Execute runs in worker processes; see :func:`execute`."""
    data = pickle.dumps(planned)
    # shared memory, not an argument: writing a large argument to a worker that cannot start blocks
    shared = RawArray(c_char, len(data))
    shared.raw = data
    relay = CompileRelay()
    workers = Workers(
        min(processes, len(queue)),
        partial(_start_worker, shared, relay, logging.getLogger("omnidrive").level),
        time_limit=run_timeout,
        on_tick=relay.forward,
    )
    calls = [Call(job_name(planned, job), partial(_run, job)) for job in queue]
    logged: set[tuple[str, str]] = set()
    with closing(workers.outcomes(calls)) as outcomes:
        for index, outcome in outcomes:
            if outcome is Lost.TIMED_OUT:
                reason = f"{run_timeout:g} s"
                yield queue[index], unfinished(planned, queue[index], Outcome.TIMED_OUT, reason)
            elif outcome is Lost.KILLED:
                reason = "twice; if memory ran out, --jobs 1 needs the least"
                yield queue[index], unfinished(planned, queue[index], Outcome.KILLED, reason)
            else:
                result, records = outcome
                log_new(records, logged)
                yield queue[index], result


def log_new(records: Sequence[logging.LogRecord], logged: set[tuple[str, str]]) -> None:
    """Log what worker processes logged, once; ``logged``: loggers and messages so far."""
    for record in records:
        message = record.name, record.getMessage()
        if message not in logged:
            logged.add(message)
            logging.getLogger(record.name).handle(record)


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


def _start_worker(shared: Array[c_char], relay: CompileRelay, log_level: int) -> None:
    """Initialise a worker process.

    Workers write nothing to the terminal, which would break the progress display: what a run logs
    is sent with its result.

    Args:
        shared: The pickled scenario.
        relay: Channel for reports of compilations.
        log_level: Log level of the parent.
    """
    logging.getLogger("omnidrive").setLevel(log_level)
    logging.getLogger().addHandler(logging.handlers.QueueHandler(_records))
    logging.captureWarnings(True)
    compile_listeners.append(relay.send)
    _shared[:] = [pickle.loads(shared.raw)]


def _run(job: Job) -> tuple[Result, list[logging.LogRecord]]:
    """Return the result of a run and what it logged.

    KeyboardInterrupt and the like end this run only, because a component raised them: this process
    ignores the signals of the terminal.
    """
    try:
        result = run_job(_shared[0], job)
    except Exception:
        raise
    except BaseException as error:
        reason = f"by {type(error).__name__} of a component"
        result = unfinished(_shared[0], job, Outcome.KILLED, reason)
    return result, [_records.get() for _ in range(_records.qsize())]
