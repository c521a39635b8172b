"""Execution of the runs of one scenario, with their logs, by the machine of all studies."""

from __future__ import annotations

from collections.abc import Sequence

from omnidrive import visualization  # imports only the modules in use
from omnidrive.errors import CannotWrite, InvalidInput, InvalidLog, one_line
from omnidrive.evaluation import RunRecord
from omnidrive.evaluation.run_table import REFUSED
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.simulation.saved_run import load_run
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.experiment import Experiment
from omnidrive.study.folder import RunFolder
from omnidrive.study.progress import Stopwatch
from omnidrive.study.run_experiment import NumberedRuns, is_sequential, series_file
from omnidrive.study.run_key import plan_digest
from omnidrive.study.run_plan import RunPlan, starting_order
from omnidrive.study.run_recording import relabelled
from omnidrive.study.store import Store
from omnidrive.study.study_folder import SCENARIO_FILE, note_file


class ScenarioExecution:
    """Execution of the runs of a planned scenario into a folder.

    Args:
        planned: The planned scenario.
        folder: The folder.
        clock: Stopwatch whose listener is notified of each run that is finished or was stored.
        observers: Observers of every run; with observers, the runs are sequential.

    Attributes:
        definition: The study.
        folder: Path of the folder.
        plan: The runs.
        is_begun: Whether the folder is that of the study.
    """

    def __init__(
        self,
        planned: PlannedScenario,
        folder: RunFolder,
        clock: Stopwatch,
        observers: Sequence[visualization.Observer] = (),
    ) -> None:
        self._planned, self._folder, self._clock = planned, folder, clock
        self._observers, self._named = observers, set[int]()
        self.definition = StudyDefinition.from_scenario(planned.scenario, series="all")
        self.plan = RunPlan(self.definition)
        self._digest = plan_digest(self.plan.keys(0, len(self.plan)))
        self.is_begun, self.folder = False, folder.path

    def execute(self, processes: int, run_timeout: float | None) -> None:
        """Compute the runs that are not stored.

        Raises:
            InvalidInput: Parts of a run could not be made; it is computed again by the next call.
            OmnidriveError: See :func:`~omnidrive.study.run_study`.
        """
        folder, plan = self._folder.path, self.plan
        compute = NumberedRuns(
            self.definition, folder / "series", self._planned, tuple(self._observers)
        )
        here = run_timeout is None and is_sequential(self._planned.scenario, self._observers)
        Experiment(
            plan, compute, folder, self._digest, prepare=self._prepare, order=starting_order(plan)
        ).execute(
            min(processes, len(plan)),
            report=lambda progress: self._tell(progress.latest),
            time_limit=run_timeout,
            in_process=here or None,
        )
        with Store(folder) as store:  # of another process, too
            stored = self._stored(store)
            refused = {n: each for n, each in stored.items() if each.outcome == REFUSED}
            store.forget(refused)
        if refused:
            raise InvalidInput(next(iter(refused.values())).detail)
        self._tell(list(stored.values()))

    def _prepare(self, store: Store) -> None:
        """Check that the store is new or of these runs; write inputs; forget runs without a log."""
        if store.fact("definition") not in {None, self._digest}:
            raise CannotWrite(
                f"{one_line(str(self._folder.path))} holds the runs of another study, of other "
                "versions or of other code; choose a new folder with --out"
            )
        self.is_begun = True
        self._folder.save_inputs(self._planned)
        note_file(store, self._folder.path / SCENARIO_FILE, self.plan)
        stored = self._stored(store)
        store.forget(number for number, each in stored.items() if not self._has_log(each))
        self._tell([each for each in stored.values() if self._has_log(each)])

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
            load_run(self._folder.path / "series" / name)
        except InvalidLog:
            return False
        return True

    def _tell(self, records: Sequence[RunRecord]) -> None:
        """Notify the listener of runs that are finished, once each."""
        for each in records:
            if each.number not in self._named and each.outcome != REFUSED:
                self._named.add(each.number)
                self._clock.progress.done(each.name)
