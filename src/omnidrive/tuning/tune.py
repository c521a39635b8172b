"""Tuning of one controller: search on the training set, gain on the held-out set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from hashlib import sha256
from json import dumps
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import yaml

from omnidrive.components import Configured
from omnidrive.components.code import CodePermission
from omnidrive.components.fields import plain
from omnidrive.errors import CannotWrite, one_line
from omnidrive.evaluation import RunRecord
from omnidrive.evaluation.run_record import TIMING
from omnidrive.files.output_file import create_folder, output_file, remove_abandoned
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.study import (
    RunPlan,
    StudyDefinition,
    definition_data,
    save_definition,
)
from omnidrive.study.storage.store import Store
from omnidrive.tuning.balanced import VALIDATION_TOLERANCE, BalancedObjective
from omnidrive.tuning.gain import BETTER, WORSE, HeldOut, held_out_gain, validation_gain
from omnidrive.tuning.objective import Objective
from omnidrive.tuning.problem import (
    HELD_OUT_FILE,
    SETTINGS_FILE,
    TRAINING_FILE,
    Tuning,
    TuningSettings,
    identity,
    load_tuning,
)
from omnidrive.tuning.run_sets import validation_set, with_controllers
from omnidrive.tuning.search import Budget, SearchResult, Trial, best_trial, score_of, search
from omnidrive.tuning.space import tunable
from omnidrive.tuning.stored_runs import RunEvaluator

BEFORE, TUNED = "before", "tuned"
"""Labels of the controllers of the held-out study."""

_CONFIRMED = 6  # best trials that are repeated with more repetitions


class TuningResult(NamedTuple):
    """Result of tuning."""

    tuning: Tuning
    search: SearchResult
    chosen: Trial
    """The trial whose values the tuned controller has; trial 0: nothing better was found."""
    after: Configured
    """The tuned controller."""
    held_out: HeldOut
    """Gain on the held-out runs."""
    folder: Path
    seconds: float
    """Wall time of this call, s."""


Report = Callable[[str, int, int, str], None]
"""Receiver of the progress: name of the part, finished steps, all steps (0: unknown), and the best
objectives so far."""


def _no_report(part: str, done: int, total: int, best: str) -> None:
    """Do nothing."""


def tune(
    tuning: Tuning, folder: StrPath, *, processes: int = 1, report: Report = _no_report
) -> TuningResult:
    """Search for better parameters, confirm the best ones, and measure the gain.

    The best trials of one objective are compared on validation runs with other seeds and motions,
    and the best of these is chosen, or the values before tuning if no gain is shown there.
    Only then the held-out runs are simulated, with the chosen parameters and with those before
    tuning.

    Every run is stored: a call with the same settings and folder continues where an interrupted one
    ended; ``trials`` and ``minutes`` may differ.

    Args:
        tuning: The problem.
        folder: New folder, or that of the same problem.
        processes: Number of worker processes; it does not affect the results of equal trials.
        report: Called with the progress.

    Raises:
        CannotWrite: The folder holds another problem, or cannot be written.
        InvalidStore: The folder has a damaged store.
        MissingExtra: The extra `tuning` is not installed.
    """
    began, path = monotonic(), to_path(folder)
    _prepare_folder(tuning, path)
    with _evaluator(tuning, processes) as evaluator:
        found, chosen = run_search(tuning, path, evaluator, report)
        after = tuning.space.controller_with(chosen.values)
        assert after is not None
        records = _held_out_records(tuning, after, path / "held-out", evaluator, report)
    axes = [each.name for each in tuning.sets.held_out.axes]
    held_out = held_out_gain(*records, tuning.objectives, axes)
    return TuningResult(tuning, found, chosen, after, held_out, path, monotonic() - began)


def equal_budget(
    definition: StudyDefinition,
    trials: int,
    folder: StrPath,
    *,
    processes: int = 1,
    report: Report = _no_report,
) -> StudyDefinition:
    """Return a study whose controllers are all tuned with the same number of trials.

    Each controller is tuned for the default objective on the training runs of :func:`default_sets`,
    which have another seed than the study. A controller without parameters to tune stays as it is.

    Args:
        definition: The study.
        trials: Number of trials of each controller.
        folder: Folder of the searches, one folder below it per controller; as of :func:`tune`.
        processes: Number of worker processes.
        report: Called with the progress.

    Raises:
        CannotWrite: See :func:`tune`.
        MissingExtra: The extra `tuning` is not installed.
    """
    folder, scenario = to_path(folder), definition.scenario
    seed = (scenario.seed + _BUDGET_SEED) % 2**53
    base = scenario.model_copy(update={"seed": seed})
    controllers = dict(scenario.controllers)
    for label, controller in scenario.controllers.items():
        if not tunable(controller, scenario.preset):
            continue
        settings = TuningSettings(controller=label, trials=trials)
        tuning, path = Tuning.of(base, settings), folder / label
        _prepare_folder(tuning, path)

        def labelled(part: str, done: int, total: int, best: str, label: str = label) -> None:
            """Report the progress of one controller."""
            report(f"{label}: {part}", done, total, best)

        with _evaluator(tuning, processes) as evaluator:
            _, chosen = run_search(tuning, path, evaluator, labelled)
        controllers[label] = tuning.space.controller_with(chosen.values) or controller
    return with_controllers(definition, controllers)


_BUDGET_SEED = 2**41  # difference of the seeds of a study and of the tuning before it


def _evaluator(tuning: Tuning, processes: int) -> RunEvaluator:
    """Return the processes that compute the runs of a tuning."""
    metrics = {
        *(term.metric.name for each in tuning.objectives for term in each.terms),
        *(each.metric.name for each in tuning.limits),
    }
    is_parallel = _is_parallel(tuning.sets.training)
    return RunEvaluator(processes, timed=bool(metrics & {*TIMING}), in_process=not is_parallel)


def run_search(
    tuning: Tuning, path: Path, evaluator: RunEvaluator, report: Report
) -> tuple[SearchResult, Trial]:
    """Return the search of a tuning and the chosen trial."""
    training, settings = tuning.sets.training, tuning.settings
    with open_store(path / "training", training) as store:
        candidates = _Candidates(training, settings.controller, store, evaluator)
        seconds = None if settings.minutes is None else 60.0 * settings.minutes

        def note(trials: Sequence[Trial]) -> None:
            """Report the trials so far."""
            best = best_trial(trials).score
            text = _score_text(tuning.objectives, best.objectives)
            report("trials", len(trials), max(settings.trials, len(trials)), text)

        found = search(
            tuning.space,
            tuning.objectives,
            tuning.limits,
            candidates,
            Budget(settings.trials, seconds),
            settings.seed,
            axes=[each.name for each in training.axes],
            report=note,
        )
        chosen = found.best
        if len(tuning.objectives) == 1:
            report("confirmation", 0, 0, "")
            chosen = validate_best(tuning, found, candidates)
    return found, chosen


class _Candidates:
    """Runs controllers on the training set."""

    def __init__(
        self, training: StudyDefinition, label: str, store: Store, evaluator: RunEvaluator
    ) -> None:
        self._training, self._label = training, label
        self._store, self._evaluator = store, evaluator
        self._count = 0

    def __call__(self, controllers: Sequence[Configured]) -> list[list[RunRecord]]:
        """Return the training runs of each controller."""
        return self.on(self._training, controllers)

    def on(
        self, definition: StudyDefinition, controllers: Sequence[Configured]
    ) -> list[list[RunRecord]]:
        """Return the runs of each controller in a study."""
        plans = [
            list(RunPlan(with_controllers(definition, {self._label: each}))) for each in controllers
        ]
        runs = []
        for run in (run for plan in plans for run in plan):
            runs.append(run._replace(number=self._count))
            self._count += 1
        if not runs:
            return []
        records = self._evaluator.records(runs, self._store)
        size = len(plans[0])
        return [records[k * size : (k + 1) * size] for k in range(len(plans))]


def validate_best(tuning: Tuning, found: SearchResult, candidates: _Candidates) -> Trial:
    """Return the best of the best trials on the validation runs, or the first trial.

    A trial is chosen only if it shows a gain over the values before tuning on these runs, and on
    none of their motions a loss: the best of many trials on few runs is partly luck, or fits their
    motion alone, and a gain on one motion does not outweigh a loss on another.
    """
    first = found.trials[0]
    ordered = sorted(found.trials, key=lambda each: each.score.order)
    chosen = [first, *(each for each in ordered[:_CONFIRMED] if each is not first)]
    made = [tuning.space.controller_with(each.values) for each in chosen]
    valid = [(trial, each) for trial, each in zip(chosen, made, strict=True) if each is not None]
    validation = validation_set(tuning.sets.training)
    axes = [each.name for each in validation.axes]
    runs = candidates.on(validation, [each for _, each in valid])
    objective = tuning.objectives[0].relative_to(runs[0], axes)
    if isinstance(objective, BalancedObjective):
        objective = replace(objective, tolerance=VALIDATION_TOLERANCE)
    scores = [score_of(each, [objective], tuning.limits) for each in runs]
    for k in sorted(range(1, len(valid)), key=lambda k: scores[k].order):
        if scores[0].violation > scores[k].violation:
            return valid[k][0]
        if scores[k].violation > scores[0].violation:
            continue
        if _shows_loss(runs[0], runs[k], objective, axes):
            continue
        if _shows_gain(runs[0], runs[k], objective):
            return valid[k][0]
    return first


def _shows_loss(
    before: Sequence[RunRecord],
    after: Sequence[RunRecord],
    objective: Objective,
    axes: Sequence[str],
) -> bool:
    """Return whether an interval shows a loss at any values of the axes."""
    for values in {tuple(each.factors[name] for name in axes) for each in after}:
        there = [
            [each for each in runs if tuple(each.factors[name] for name in axes) == values]
            for runs in (before, after)
        ]
        if validation_gain(there[0], there[1], objective).verdict == WORSE:
            return True
    return False


def _shows_gain(
    before: Sequence[RunRecord], after: Sequence[RunRecord], objective: Objective
) -> bool:
    """Return whether the interval of a gain excludes zero or, of one repetition, all runs gain.

    Of one repetition the balanced objective, which permits no worse part, gains as a whole.
    """
    if validation_gain(before, after, objective).verdict == BETTER:
        return True
    pairs = [(b, a) for b, a in zip(before, after, strict=True) if objective.counts(a)]
    single = len({each.repetition for each in after}) == 1
    if single and isinstance(objective, BalancedObjective):
        return objective.value(after) < 1.0
    return single and all(objective.value([b]) < objective.value([a]) for a, b in pairs)


def _held_out_records(
    tuning: Tuning, after: Configured, folder: Path, evaluator: RunEvaluator, report: Report
) -> tuple[list[RunRecord], list[RunRecord]]:
    """Return the held-out runs before and after tuning, which are stored as a study."""
    definition = with_controllers(tuning.sets.held_out, {BEFORE: tuning.before, TUNED: after})
    create_folder(folder)
    save_definition(definition, folder / "study.yaml")
    runs = list(RunPlan(definition))
    with open_store(folder, definition) as store:
        done = 0

        def note(count: int) -> None:
            """Report the finished runs."""
            nonlocal done
            done += count
            report("held-out runs", done, len(runs), "")

        report("held-out runs", 0, len(runs), "")
        records = evaluator.records(runs, store, report=note)
    return (
        [each for each in records if each.controller == BEFORE],
        [each for each in records if each.controller == TUNED],
    )


def open_store(folder: Path, definition: StudyDefinition) -> Store:
    """Return the open store of a definition in a folder, which is created."""
    create_folder(folder)
    store = Store(folder)
    content = dumps(definition_data(definition, folder / "study.yaml"), sort_keys=True)
    store.begin(sha256(content.encode()).hexdigest())
    return store


def _is_parallel(definition: StudyDefinition) -> bool:
    """Return whether other processes can compute the runs."""
    scenario = definition.scenario
    parts = (*scenario.controllers.values(), scenario.plant)
    return not scenario.plant_capabilities.exclusive and all(each.is_importable for each in parts)


def _score_text(objectives: Sequence[Objective], values: Sequence[float]) -> str:
    return ", ".join(
        f"{each.text} {value:.4g}" for each, value in zip(objectives, values, strict=True)
    )


def _prepare_folder(tuning: Tuning, path: Path) -> None:
    """Create the folder with the problem, or check that it holds the same one."""
    create_folder(path)
    remove_abandoned(path)
    settings = plain(tuning.settings)
    if (path / SETTINGS_FILE).is_file():
        present = load_tuning(path, allow_code=CodePermission.UNREAD)
        if identity(present) != identity(tuning):
            raise CannotWrite(
                f"{one_line(str(path))} holds another tuning; choose another folder with --out"
            )
    elif any(path.iterdir()):
        raise CannotWrite(f"{one_line(str(path))} is not empty; choose a new folder with --out")
    else:
        save_definition(tuning.sets.training, path / TRAINING_FILE)
        save_definition(tuning.sets.held_out, path / HELD_OUT_FILE)
    with output_file(path / SETTINGS_FILE) as part:
        part.write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")
