"""Execution of the runs of one scenario, which keep their logs."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import partial

from omnidrive import visualization  # imports only the modules in use
from omnidrive.execution.engine import ListSource, Work, execute_blocks, must_be_in_process
from omnidrive.execution.worker_pool import Lost
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.run_settings import RunSettings, run_name
from omnidrive.scenario.run_simulation import Result, simulate_run, unfinished
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation import Outcome

_COMPILE_TIMES = {
    "holonomic-nmpc": 16.0, "fuzzy_t1": 9.0, "unicycle-nmpc": 3.0, "fuzzy_t2": 2.0, "fuzzy_t3": 2.0,
}  # fmt: skip
"""Approximate time to compile the kernels of a controller after those above it, s."""


def execute_jobs(
    planned: PlannedScenario,
    jobs: Sequence[RunSettings],
    processes: int,
    observers: Sequence[visualization.Observer] = (),
    *,
    run_timeout: float | None = None,
) -> Generator[tuple[RunSettings, Result], None, None]:
    """Yield each job and its result when it is finished.

    The order depends on ``processes``, the results do not: every run has its own plant, controller
    and random numbers. A run whose process is killed is executed again; if that happens three
    times, its outcome says so, and the other runs go on.

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
    here = run_timeout is None and (is_sequential(planned.scenario, observers) or not parallel)
    work = Work(
        _Observed(planned, tuple(observers)) if here else _Alone(planned),
        partial(_lost, planned, run_timeout),
        partial(run_name, planned.scenario),
        largest=1,
    )
    count = min(processes, max(len(queue), 1))
    blocks = execute_blocks(
        ListSource(queue, count), work, count, time_limit=run_timeout, in_process=here
    )
    for results in blocks:
        yield from results


def is_sequential(scenario: Scenario, observers: Sequence[visualization.Observer] = ()) -> bool:
    """Return whether the runs must be executed in this process.

    That is so if there are observers, if the plant is exclusive, if a component was typed into a
    Python session, which a worker process cannot import, or if this process is a daemon, such as
    one of a pool, which may not start processes.
    """
    return (
        scenario.plant_capabilities.exclusive
        or bool(observers)
        or must_be_in_process()
        or not scenario.is_importable
    )


def _starting_order(scenario: Scenario, jobs: Sequence[RunSettings]) -> list[RunSettings]:
    """Sort runs: one run of each controller first, then the longest ones.

    On an empty cache the first runs compile the kernels of different controllers at the same time,
    those with the longest compile times first.
    """
    longest = sorted(jobs, key=lambda job: -job.duration)
    first = {job.controller: job for job in reversed(longest)}
    types = {label: controller.type for label, controller in scenario.controllers.items()}
    head = sorted(first.values(), key=lambda job: -_COMPILE_TIMES.get(types[job.controller], 0.0))
    return head + [job for job in longest if first[job.controller] is not job]


@dataclass(frozen=True, slots=True)
class _Observed:
    """Function that executes runs in this process."""

    planned: PlannedScenario
    observers: tuple[visualization.Observer, ...]

    def __call__(self, jobs: Sequence[RunSettings]) -> list[tuple[RunSettings, Result]]:
        """Return runs and their results."""
        return [(job, simulate_run(self.planned, job, self.observers)) for job in jobs]


@dataclass(frozen=True, slots=True)
class _Alone:
    """Function that executes runs in a worker process."""

    planned: PlannedScenario

    def __call__(self, jobs: Sequence[RunSettings]) -> list[tuple[RunSettings, Result]]:
        """Return runs and their results."""
        return [(job, self._result(job)) for job in jobs]

    def _result(self, job: RunSettings) -> Result:
        """Return the result of a run.

        KeyboardInterrupt and the like end this run only, because a component raised them: the
        process ignores the signals of the terminal.
        """
        try:
            return simulate_run(self.planned, job)
        except Exception:
            raise
        except BaseException as error:
            reason = f"by {type(error).__name__} of a component"
            return unfinished(self.planned, job, Outcome.KILLED, reason)


def _lost(
    planned: PlannedScenario, run_timeout: float | None, job: RunSettings, lost: Lost
) -> tuple[RunSettings, Result]:
    """Return a run whose process was lost, and its result."""
    if lost is Lost.TIMED_OUT:
        return job, unfinished(planned, job, Outcome.TIMED_OUT, f"{run_timeout:g} s")
    reason = "three times; if memory ran out, --jobs 1 needs the least"
    return job, unfinished(planned, job, Outcome.KILLED, reason)
