"""Execution of the runs of a study into its folder, which holds its definition and its store."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import ceil, isfinite
from typing import Any

from omnidrive import visualization  # imports only the modules in use
from omnidrive.components.code import CodePermission
from omnidrive.errors import CannotWrite, InvalidInput, InvalidLog, one_line
from omnidrive.evaluation import RunRecord
from omnidrive.evaluation.statistics.run_table import REFUSED
from omnidrive.evaluation.statistics.stop_rule import StopRule
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.simulation.saved_run import load_run
from omnidrive.study.computation.experiment import Experiment
from omnidrive.study.computation.numbered_runs import NumberedRuns, is_sequential, series_file
from omnidrive.study.computation.run_recording import relabelled
from omnidrive.study.design.definition import StudyDefinition
from omnidrive.study.design.definition_file import definition_data, load_definition, save_definition
from omnidrive.study.design.run_key import plan_digest
from omnidrive.study.design.run_plan import RunPlan, starting_order
from omnidrive.study.folder import RunFolder
from omnidrive.study.output_paths import DEFINITION_FILE
from omnidrive.study.progress import ProgressListener
from omnidrive.study.storage.store import Store
from omnidrive.study.stored_study import stored_study
from omnidrive.study.study import Study
from omnidrive.study.study_folder import DESCRIPTIONS, SCENARIO_FILE, check_unchanged, note_file

MAX_SEQUENTIAL = 10_000
"""Largest number of repetitions that a stop rule may ask for."""

_KEYS_IN_HASH = 256
_MAX_ORDERED = 1000  # runs of a study whose longest runs start first


class StudyExecution:
    """Execution of the runs that the folder of a study does not hold yet.

    Stored runs are not computed again, however the process that computed them ended; the folder may
    hold fewer repetitions. Other processes may execute the same study at the same time; they share
    the runs. Results depend neither on the processes nor on interruptions.

    Args:
        definition: The study.
        folder: The folder.
        planned: The planned scenario of a comparison; None: the study is no comparison.
        observers: Observers of every run; with observers, the runs are sequential.
        until: Repetitions are added until this rule is satisfied. None: those of the definition.

    Attributes:
        definition: The study.
        folder: Path of the folder.
        plan: The runs, with ``until`` those of the largest number of repetitions.
        is_begun: Whether the folder is that of the study.
    """

    def __init__(
        self,
        definition: StudyDefinition,
        folder: RunFolder,
        planned: PlannedScenario | None = None,
        *,
        observers: Sequence[visualization.Observer] = (),
        until: StopRule | None = None,
    ) -> None:
        self.definition, self.folder, self._planned = definition, folder.path, planned
        self._inputs, self._observers, self._until = folder, observers, until
        largest = definition
        if until is not None:
            largest = definition.with_repetitions(max(MAX_SEQUENTIAL, definition.repetitions))
        self.plan = RunPlan(largest)
        self._file = self.folder / (SCENARIO_FILE if planned else DEFINITION_FILE)
        self._digest = self._digest_of_runs()
        self.is_begun = False

    def execute(
        self,
        processes: int,
        progress: ProgressListener,
        *,
        run_timeout: float | None = None,
        scheduler: str | None = None,
    ) -> None:
        """Compute the runs that are not stored.

        Raises:
            InvalidInput: Parts of a run of a comparison could not be made; it is computed again by
                the next call.
            OmnidriveError: See :func:`~omnidrive.study.run_study`.
        """
        plan, definition = self.plan, self.definition
        compute = NumberedRuns(
            plan.definition, self.folder / "series", self._planned, tuple(self._observers)
        )
        here = run_timeout is None and is_sequential(definition.scenario, self._observers)
        single = definition.series == "all" and len(plan) <= _MAX_ORDERED
        Experiment(
            plan,
            compute,
            self.folder,
            self._digest,
            first=plan.per_repetition * definition.repetitions,
            prepare=self._prepare,
            order=starting_order(plan) if single else (),
        ).execute(
            min(processes, len(plan)),
            report=progress.runs,
            time_limit=run_timeout,
            in_process=here or None,
            extend=self._extension(progress),
            scheduler=scheduler,
        )
        if self._planned is not None:
            self._forget_refused()

    def study(self) -> Study:
        """Return the study as its folder holds it.

        Raises:
            InvalidInput: No run is stored.
        """
        with Store(self.folder, read_only=False) as store:
            until = store.fact("until") or ""
        found = stored_study(self.folder, self.definition, until, read_only=False)
        found.planned = self._planned
        return found

    def _extension(self, progress: ProgressListener) -> Callable[[Store], int | None]:
        """Return the function that extends the runs as the stop rule asks for."""
        if self._until is None:
            return lambda _: None
        return _Extension(self._until, self.plan, progress.note)

    def _forget_refused(self) -> None:
        """Remove the runs whose parts could not be made; raise InvalidInput if there are any."""
        with Store(self.folder) as store:  # runs of another process, too
            stored = self._stored(store)
            refused = {n: each for n, each in stored.items() if each.outcome == REFUSED}
            store.forget(refused)
        if refused:
            raise InvalidInput(next(iter(refused.values())).detail)

    def _digest_of_runs(self) -> str:
        """Return the SHA-256 of what determines the runs of the study and their numbers.

        Versions and components count by the keys of the first runs; the number of repetitions does
        not count, nor do the names of the files of a comparison, which its folder has copies of.
        """
        plan = self.plan
        if self._planned is not None:
            return plan_digest(plan.keys(0, len(plan)))
        keys = plan.keys(0, min(plan.per_repetition, _KEYS_IN_HASH))
        text = json.dumps([_content(plan.definition), keys], sort_keys=True)
        return sha256(text.encode()).hexdigest()

    def _prepare(self, store: Store) -> None:
        """Check that the store is new or of these runs; write inputs; forget runs without a log."""
        if self._planned is not None:
            self._check_runs(store)
            self._inputs.save_inputs(self._planned)
        elif (self.folder / SCENARIO_FILE).is_file():
            raise CannotWrite(
                f"{one_line(str(self.folder))} holds a comparison; choose another folder with --out"
            )
        elif not self._file.is_file() or self._is_extended(store):
            save_definition(self.definition, self._file)
        self.is_begun = True
        note_file(store, self._file, RunPlan(self.definition))
        if self._until is not None:  # as StopRule.parse reads it
            store.note("until", f"{self._until.measure.name}:{self._until.half_width!r}")
        if self._planned is not None:
            stored = self._stored(store)
            store.forget(number for number, each in stored.items() if not self._has_log(each))

    def _check_runs(self, store: Store) -> None:
        """Raise CannotWrite unless the store is new or holds these runs."""
        if store.fact("definition") not in {None, self._digest}:
            raise CannotWrite(
                f"{one_line(str(self.folder))} holds the runs of another study, of other "
                "versions or of other code; choose a new folder with --out"
            )

    def _is_extended(self, store: Store) -> bool:
        """Return whether the folder holds the study with fewer repetitions.

        Raises:
            CannotWrite: It holds another study.
            InvalidStore: Its study file was changed after the runs were computed.
        """
        present = load_definition(self._file, allow_code=CodePermission.UNREAD)
        if _content(present) != _content(self.definition):
            raise CannotWrite(
                f"{one_line(str(self.folder))} holds another study, '{present.name}'; choose "
                "another folder with --out"
            )
        check_unchanged(store, self._file)
        return present.repetitions < self.definition.repetitions

    def _stored(self, store: Store) -> dict[int, RunRecord]:
        """Return the stored records by number."""
        keys = dict(enumerate(self.plan.keys(0, len(self.plan))))
        numbers, found = store.numbers(0, len(self.plan)), store.results(list(keys.values()))
        return {
            n: relabelled(found[key], self.plan[n])
            for n, key in keys.items()
            if n in numbers and key in found
        }

    def _has_log(self, record: RunRecord) -> bool:
        """Return whether the log of a stored run can be read, or was lost with its process."""
        if record.is_lost:
            return True
        name = series_file(self.definition, self.plan[record.number])
        try:
            load_run(self.folder / "series" / name)
        except InvalidLog:
            return False
        return True


@dataclass(frozen=True, slots=True)
class _Extension:
    """Number of runs that a stop rule asks for."""

    rule: StopRule
    plan: RunPlan
    note: Callable[[str], None]

    def __call__(self, store: Store) -> int | None:
        """Return how many runs are to be computed in all; None: no more."""
        state = self.rule.check(store.records())
        self.note(state.text)
        maximum = self.plan.definition.repetitions
        if state.reached or state.repetitions >= maximum:
            return None
        done = state.repetitions
        more = 0.5 * (state.needed - done) if isfinite(state.needed) else 0.0
        wanted = done + min(max(ceil(more), done // 4, 2), max(done, 2))
        return min(wanted, maximum) * self.plan.per_repetition


def _content(definition: StudyDefinition) -> dict[str, Any]:
    """Return what determines the runs of a study and their numbers."""
    data = definition_data(definition, "/study.yaml")
    return {key: value for key, value in data.items() if key not in DESCRIPTIONS}
