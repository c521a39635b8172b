"""Evaluation of planned runs, each of which is stored and computed once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from types import TracebackType

from omnidrive.evaluation import RunRecord
from omnidrive.execution.engine import (
    ListSource,
    Work,
    execute_blocks,
    execute_on,
    must_be_in_process,
    start_worker,
)
from omnidrive.execution.worker_pool import WorkerPool
from omnidrive.simulation import Run
from omnidrive.study import PlannedRun, run_block
from omnidrive.study.computation.experiment import record_of_lost
from omnidrive.study.computation.run_recording import relabelled
from omnidrive.study.storage.store import Store


def _ignore(run: PlannedRun, log: Run) -> None:
    """Do nothing with the log of a run."""


def _run_singly(runs: Sequence[PlannedRun]) -> list[RunRecord]:
    """Simulate runs one at a time, not in compiled loops, which measure no computing times."""
    return run_block(runs, _ignore, series="all")


def _work(*, timed: bool) -> Work[PlannedRun, RunRecord]:
    return Work(
        compute=_run_singly if timed else run_block,
        lost=record_of_lost,
        name=lambda run: f"run {run.number}",
        largest=1_000,
    )


class RunEvaluator:
    """Worker processes that compute the runs of several stores; use it in a ``with`` statement."""

    def __init__(self, processes: int, *, timed: bool = False, in_process: bool = False) -> None:
        """Start nothing yet: processes start with the first runs.

        Args:
            processes: Number of worker processes; 1: in this process.
            timed: Whether the records need computing times.
            in_process: Whether to compute in this process.
        """
        self._processes = processes
        self._work = _work(timed=timed)
        self._stack = ExitStack()
        self._pool: WorkerPool | None = None
        if not (in_process or processes == 1 or must_be_in_process()):
            self._pool = WorkerPool(processes, partial(start_worker, self._work.compute))

    def __enter__(self) -> RunEvaluator:
        if self._pool is not None:
            self._stack.enter_context(self._pool)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    def records(
        self,
        runs: Sequence[PlannedRun],
        store: Store,
        *,
        report: Callable[[int], None] = lambda count: None,
    ) -> list[RunRecord]:
        """Return the records of runs in their order; those that the store lacks are computed.

        Args:
            runs: The runs; equal ones, with one key, are computed once.
            store: The store.
            report: Called with the number of new records after each block.

        Raises:
            CannotWrite: The store cannot be written.
            WorkerLost: Worker processes end while they start.
        """
        known = store.results({run.key: None for run in runs})
        missing = {run.key: run for run in runs if run.key not in known}
        source = ListSource(list(missing.values()), self._processes)
        blocks = (
            execute_blocks(source, self._work, 1, in_process=True)
            if self._pool is None
            else execute_on(self._pool, source, self._work)
        )
        for records in blocks:
            store.add(records)
            known |= {record.key: record for record in records}
            report(len(records))
        found = [relabelled(known[run.key], run) for run in runs]
        new = store.numbers(min(r.number for r in runs), max(r.number for r in runs) + 1)
        store.add([record for record in found if record.number not in new])
        return found
