"""Execution of the runs of one scenario, with their logs, by the machine of all studies."""

from __future__ import annotations

from collections.abc import Sequence

from omnidrive import visualization  # imports only the modules in use
from omnidrive.errors import CannotWrite, InvalidInput, InvalidLog, one_line
from omnidrive.evaluation import FaultResult, StepResult, StudyResults, TrackResult
from omnidrive.scenario.planned_scenario import PlannedScenario
from omnidrive.scenario.run_settings import RunSettings, settings_of_runs
from omnidrive.scenario.run_simulation import Result, evaluate, unfinished
from omnidrive.scenario.scenario import Scenario
from omnidrive.simulation import Outcome
from omnidrive.simulation.saved_run import load_run
from omnidrive.study.definition import StudyDefinition
from omnidrive.study.experiment import Experiment
from omnidrive.study.folder import RunFolder
from omnidrive.study.progress import Stopwatch
from omnidrive.study.run_experiment import NumberedRuns, is_sequential, series_file
from omnidrive.study.run_key import plan_digest
from omnidrive.study.run_plan import RunPlan, starting_order
from omnidrive.study.run_record import RunRecord
from omnidrive.study.run_recording import REFUSED, relabelled
from omnidrive.study.setup_facts import controller_types
from omnidrive.study.store import Store
from omnidrive.study.study_folder import SCENARIO_FILE, note_file


class ScenarioExecution:
    """Execution of the runs of a planned scenario into a folder.

    Args:
        planned: The planned scenario.
        folder: The folder.
        clock: Stopwatch whose listener is notified of each run that is finished or was stored.
        observers: Observers of every run; with observers, the runs are sequential.
        is_kept: Whether results.json is written after each run.

    Attributes:
        plan: The runs.
    """

    def __init__(
        self,
        planned: PlannedScenario,
        folder: RunFolder,
        clock: Stopwatch,
        observers: Sequence[visualization.Observer] = (),
        *,
        is_kept: bool = True,
    ) -> None:
        self._planned, self._folder, self._clock = planned, folder, clock
        self._observers, self._is_kept = observers, is_kept
        self._definition = StudyDefinition.from_scenario(planned.scenario, series="all")
        self.plan = RunPlan(self._definition)
        self._digest = plan_digest(self.plan.keys(0, len(self.plan)))
        self._finished: dict[RunSettings, Result] = {}

    def execute(self, processes: int, run_timeout: float | None) -> StudyResults:
        """Compute the runs that are not stored, and return all results in the order of the plan.

        Raises:
            InvalidInput: Parts of a run could not be made; it is computed again by the next call.
            OmnidriveError: See :func:`~omnidrive.study.run_study`.
        """
        folder, plan = self._folder.path, self.plan
        compute = NumberedRuns(
            self._definition, folder / "series", self._planned, tuple(self._observers)
        )
        here = run_timeout is None and is_sequential(self._planned.scenario, self._observers)
        Experiment(
            plan, compute, folder, self._digest, prepare=self._prepare, order=starting_order(plan)
        ).execute(
            min(processes, len(plan)),
            report=lambda progress: self._add(progress.latest),
            time_limit=run_timeout,
            in_process=here or None,
        )
        with Store(folder) as store:  # of another process, too
            stored = self._stored(store)
            refused = {n: each for n, each in stored.items() if each.outcome == REFUSED}
            store.forget(refused)
        if refused:
            raise InvalidInput(next(iter(refused.values())).detail)
        self._add([e for n, e in stored.items() if plan[n].settings not in self._finished])
        return self._results()

    def _prepare(self, store: Store) -> None:
        """Check that the store is new or of these runs; write inputs; forget runs without a log."""
        if store.fact("definition") not in {None, self._digest}:
            raise CannotWrite(
                f"{one_line(str(self._folder.path))} holds the runs of another study, of other "
                "versions or of other code; choose a new folder with --out"
            )
        self._folder.save_inputs(self._planned)
        note_file(store, self._folder.path / SCENARIO_FILE, self.plan)
        stored = self._stored(store)
        self._add(list(stored.values()))
        store.forget(n for n in stored if self.plan[n].settings not in self._finished)

    def _stored(self, store: Store) -> dict[int, RunRecord]:
        """Return the stored records by number."""
        keys = dict(enumerate(self.plan.keys(0, len(self.plan))))
        numbers, found = store.numbers(0, len(self.plan)), store.results(list(keys.values()))
        return {
            n: relabelled(found[key], self.plan[n])
            for n, key in keys.items()
            if n in numbers and key in found
        }

    def _add(self, records: Sequence[RunRecord]) -> None:
        """Add the results of stored runs whose logs can be read; write them, and tell the names."""
        results = {r.number: each for r in records if (each := self._result(r)) is not None}
        self._finished |= {self.plan[n].settings: each for n, each in results.items()}
        if results and self._is_kept:
            self._folder.save_results(self._planned, self._results(), self._clock.seconds)
        for each in results.values():
            self._clock.progress.done(each.name)

    def _result(self, record: RunRecord) -> Result | None:
        """Return the result of a stored run; None: its log cannot be read, or it was refused."""
        settings = self.plan[record.number].settings
        for outcome in (Outcome.KILLED, Outcome.TIMED_OUT):
            if record.outcome == outcome.name.lower():
                reason = record.detail.removeprefix(f"{outcome.value}: ")
                lost = unfinished(self._planned, settings, outcome, reason)
                self._folder.save_series(lost.name, lost.run)
                return lost
        name = series_file(self._definition, self.plan[record.number])
        try:
            run = load_run(self._folder.path / "series" / name)
        except InvalidLog:
            return None
        return evaluate(self._planned, settings, run)

    def _results(self) -> StudyResults:
        order = settings_of_runs(self._planned.scenario)
        return collect_results(self._planned, order, self._finished)


def collect_results(
    planned: PlannedScenario, order: Sequence[RunSettings], finished: dict[RunSettings, Result]
) -> StudyResults:
    """Return the results of the finished runs of a scenario, in that order."""
    done = [finished[run] for run in order if run in finished]
    scenario = planned.scenario
    return StudyResults(
        title=_title(scenario),
        robot=planned.robot,
        plant=scenario.plant.type,
        dt=scenario.sample_time,
        obstacles=planned.obstacles,
        free_space=planned.free_space,
        grid_path=planned.plan.grid_path if planned.plan else None,
        spline=planned.path,
        tracks=tuple(r for r in done if isinstance(r, TrackResult)),
        steps=tuple(r for r in done if isinstance(r, StepResult)),
        faults=tuple(r for r in done if isinstance(r, FaultResult)),
        types=controller_types(scenario),
    )


def _title(scenario: Scenario) -> str:
    """Return the title of a study: its preset, or the controller if there is only one."""
    facts = [f"preset {scenario.preset}", f"plant {scenario.plant.type}"]
    if len(scenario.controllers) == 1:
        facts[:1] = [*scenario.controllers, *(facts[:1] if scenario.preset != "paper" else ())]
    return f"{scenario.name}: {', '.join(facts)}"
