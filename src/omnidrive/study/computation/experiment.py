"""Execution of a plan of runs, whose records are stored as soon as they are computed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from math import inf, isnan, nan
from time import monotonic

from omnidrive.evaluation.run_record import RunRecord
from omnidrive.execution.engine import Work, execute_blocks, must_be_in_process
from omnidrive.execution.worker_pool import Lost
from omnidrive.files.output_file import create_folder
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.parameter import Bounds, check_number
from omnidrive.simulation import Outcome
from omnidrive.study.computation.run_recording import lost_record, relabelled
from omnidrive.study.design.planned_run import PlannedRun
from omnidrive.study.progress import RunProgress
from omnidrive.study.storage.leases import Leases
from omnidrive.study.storage.store import KeyedPlan, Store

_BEST_BY = "me"  # metric of the best controller so far
_MAX_LEASED = 10_000  # runs of a request


class _Pace:
    """Time per run of the latest half of the runs.

    The first block of each process does not count, because it compiles kernels.

    Args:
        processes: Number of processes.
    """

    def __init__(self, processes: int) -> None:
        self._skipped = processes
        self._ends: deque[tuple[float, int]] = deque()

    def update(self, now: float, computed: int) -> float:
        """Consider the end of a block; return the time per run, s, infinite if it is unknown.

        Args:
            now: Present time, s.
            computed: Number of runs that are computed.
        """
        self._skipped -= 1
        if self._skipped > 0:
            return inf
        self._ends.append((now, computed))
        while len(self._ends) > 2 and 2 * self._ends[1][1] <= computed:
            self._ends.popleft()
        began, before = self._ends[0]
        return (now - began) / (computed - before) if computed > before else inf


@dataclass(slots=True)
class Experiment:
    """A plan that is executed into a store.

    Attributes:
        plan: The runs.
        compute: Picklable function that returns the records of the runs with these numbers.
        folder: Folder of the store; it is created.
        definition: Hash of the definition without its number of repetitions.
        first: Number of runs from the first one on that are computed at first. None: all.
        prepare: Called with the open store before anything else is done with it.
        order: Numbers of the runs in the order in which they start, in blocks of one run; for
            small plans. Empty: in the order of the plan.
    """

    plan: KeyedPlan
    compute: Callable[[Sequence[int]], list[RunRecord]]
    folder: StrPath
    definition: str
    first: int | None = None
    prepare: Callable[[Store], None] = lambda _: None
    order: Sequence[int] = ()
    _pace: _Pace = field(default_factory=lambda: _Pace(1), init=False)
    _computed: int = field(default=0, init=False)
    _unfinished: int = field(default=0, init=False)
    _means: dict[str, tuple[int, float]] = field(default_factory=dict, init=False)

    def execute(
        self,
        processes: int = 1,
        *,
        report: Callable[[RunProgress], None] = lambda _: None,
        time_limit: float | None = None,
        in_process: bool | None = None,
        extend: Callable[[Store], int | None] = lambda _: None,
        scheduler: str | None = None,
    ) -> None:
        """Compute and store the runs that are not stored; equal runs, with one key, once.

        It can be interrupted at any time, and executed again, also by other processes meanwhile.

        Args:
            processes: Number of worker processes.
            report: Called with the progress at the start, after each block and at the end.
            time_limit: Largest wall time of a run in a worker process, s; blocks are then single
                runs. None: no limit.
            in_process: Whether to compute in this process. None: with one process, if possible.
            extend: Called when all runs are stored; returns how many runs from the first one on
                are to be computed, at most those of the plan, or None: no more.
            scheduler: Address of a Dask scheduler, whose workers compute. None: processes of this
                computer.

        Raises:
            InvalidStore: The folder has no usable store.
            CannotWrite: The store cannot be written.
            WorkerLost: Worker processes end while they start.
        """
        if time_limit is not None:
            check_number("run_timeout", time_limit, Bounds(0.1, 1e6, "s"))
        create_folder(folder := to_path(self.folder))
        work = Work(
            compute=self.compute,
            lost=lambda number, lost: record_of_lost(self.plan[number], lost, time_limit),
            name=lambda number: f"run {number} ({self.plan[number].name})",
            largest=1 if time_limit is not None or self.order else _MAX_LEASED,
        )
        here = in_process
        if here is None:
            alone = processes == 1 and time_limit is None
            here = scheduler is None and (alone or must_be_in_process())
        with Store(folder) as store:
            self._begin(store)
            plan = PlanPrefix(self.plan, len(self.plan) if self.first is None else self.first)
            with Leases(store, plan, order=self.order) as leases:
                source = _UnstoredRuns(store, leases, plan, processes, extend)
                self._pace, before = _Pace(1 if here else processes), store.count
                report(self._progress(before, len(plan)))
                blocks = execute_blocks(
                    source, work, processes, time_limit=time_limit, in_process=here,
                    scheduler=scheduler,
                )  # fmt: skip
                with closing(blocks):  # which ends the workers
                    for records in blocks:
                        source.add(records)
                        self._note(records)
                        report(self._progress(before + source.added, len(plan), records))
            report(self._progress(store.count, len(plan)))  # other processes share the runs

    def _begin(self, store: Store) -> None:
        """Prepare the store for the plan."""
        self.prepare(store)
        store.begin(self.definition)

    def _note(self, records: Sequence[RunRecord]) -> None:
        """Update the progress."""
        self._computed += len(records)
        for record in records:
            self._unfinished += not record.finished
            value = record.metrics.get(_BEST_BY, nan)
            if record.finished and not isnan(value):
                count, mean = self._means.get(record.controller, (0, 0.0))
                mean += (value - mean) / (count + 1)
                self._means[record.controller] = count + 1, mean

    def _progress(self, done: int, total: int, latest: Sequence[RunRecord] = ()) -> RunProgress:
        """Return the progress."""
        each = self._pace.update(monotonic(), self._computed)
        means = {name: mean for name, (_, mean) in self._means.items()}
        best = min(means.items(), key=lambda item: item[1]) if len(means) > 1 else None
        left = (total - done) * each if done < total else 0.0
        return RunProgress(done, total, self._unfinished, left, best, latest)


def record_of_lost(run: PlannedRun, lost: Lost, time_limit: float | None = None) -> RunRecord:
    """Return the record of a planned run whose process was lost."""
    if lost is Lost.TIMED_OUT:
        return lost_record(run, Outcome.TIMED_OUT, f"{time_limit or 0.0:g} s")
    reason = "three times; if memory ran out, --jobs 1 needs the least"
    return lost_record(run, Outcome.KILLED, reason)


@dataclass(slots=True)
class PlanPrefix:
    """The first runs of a plan.

    Attributes:
        plan: The plan.
        length: Number of the runs.
    """

    plan: KeyedPlan
    length: int

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, number: int) -> PlannedRun:
        return self.plan[number]

    def keys(self, start: int, stop: int) -> Sequence[str]:
        """Return the keys of the runs from ``start`` to before ``stop``."""
        return self.plan.keys(start, stop)


class _UnstoredRuns:
    """Numbers of the runs to compute: leased, not stored, and each key once.

    Attributes:
        added: Number of runs that were stored.
    """

    def __init__(
        self,
        store: Store,
        leases: Leases,
        plan: PlanPrefix,
        processes: int,
        extend: Callable[[Store], int | None],
    ) -> None:
        self._store, self._leases, self._plan = store, leases, plan
        self._processes, self._extend = processes, extend
        self._equal: dict[str, list[int]] = {}  # other numbers of the keys that are computed
        self.added = 0

    def take(self, count: int) -> list[int] | None:
        """Lease runs; store those at once whose results are known."""
        while True:
            fair = -(-self._leases.left // (2 * self._processes))  # small blocks at the end
            numbers = self._leases.take(min(count, max(fair, 1)))
            if numbers is None:
                length = self._extend(self._store)
                if length is None:
                    return None
                self._plan.length = length
            elif wanted := self._unknown(numbers):
                return wanted
            elif not numbers:
                return []

    def _unknown(self, numbers: Sequence[int]) -> list[int]:
        """Return those of leased runs that must be computed; store the others, or later."""
        keys = {number: self._plan.keys(number, number + 1)[0] for number in numbers}
        known = self._store.results(dict.fromkeys(keys.values()))
        copies = [relabelled(known[key], self._plan[n]) for n, key in keys.items() if key in known]
        if copies:
            self._store.add(copies)
            self.added += len(copies)
        wanted = []
        for number, key in keys.items():
            if key in self._equal:
                self._equal[key].append(number)
            elif key not in known:
                self._equal[key] = []
                wanted.append(number)
        return wanted

    def add(self, records: Sequence[RunRecord]) -> None:
        """Store records, and those of the runs with the same keys."""
        copies = [
            relabelled(record, self._plan[number])
            for record in records
            for number in self._equal.pop(record.key, ())
        ]
        self._store.add([*records, *copies])
        self.added += len(records) + len(copies)
