"""Tuning of one controller: search on the training set, gain on the held-out set."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from json import dumps
from pathlib import Path
from time import monotonic
from typing import Annotated, Any, Literal, NamedTuple

import yaml
from pydantic import Field, ValidationError

from omnidrive.components import Configured
from omnidrive.components.fields import plain
from omnidrive.errors import CannotWrite, InvalidInput, InvalidStudy, one_line
from omnidrive.files.output_file import create_folder, output_file, remove_abandoned
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.parameter import Bounds
from omnidrive.study import (
    RunPlan,
    RunRecord,
    Scenario,
    StudyDefinition,
    definition_data,
    load_definition,
    save_definition,
)
from omnidrive.study.scenario_file import problems_of
from omnidrive.study.section import Section
from omnidrive.study.store import Store
from omnidrive.tuning.gain import HeldOut, held_out_gain
from omnidrive.tuning.objective import Limit, Objective, parse_limit, parse_objective
from omnidrive.tuning.run_sets import RunSets, check_apart, default_sets, with_controllers
from omnidrive.tuning.search import (
    MAX_TRIALS,
    Budget,
    SearchResult,
    Trial,
    best_trial,
    score_of,
    search,
)
from omnidrive.tuning.space import ParameterSpace, parameter_space
from omnidrive.tuning.stored_runs import RunEvaluator

SETTINGS_FILE, TRAINING_FILE, HELD_OUT_FILE = "tuning.yaml", "training.yaml", "held-out.yaml"
"""Names of the files of a folder from which tuning resumes."""

BEFORE, TUNED = "before", "tuned"
"""Labels of the controllers of the held-out study."""

_CONFIRMED = 3  # best trials that are repeated with more repetitions
_MORE_REPETITIONS = 3  # factor of the repetitions
_RESUMABLE = ("trials", "minutes")  # settings that may change when tuning resumes


class TuningSettings(Section):
    """What is tuned, towards what, and for how long."""

    format: Literal["omnidrive-tuning-1"] = "omnidrive-tuning-1"
    """Name and version of the file format."""
    controller: str
    """Label of the controller in the scenario."""
    objectives: Annotated[tuple[str, ...], Field(min_length=1, max_length=4)] = ("me",)
    """What is minimised; several give a front."""
    limits: Annotated[tuple[str, ...], Field(max_length=20)] = ()
    """Hard limits that every training run keeps."""
    parameters: Annotated[tuple[str, ...], Field(max_length=100)] = ()
    """Patterns of the names of the tuned parameters; see :func:`parameter_space`."""
    ranges: Annotated[dict[str, tuple[float, float]], Field(max_length=1000)] = Field(
        default_factory=dict
    )
    """Narrower ranges of parameters by name."""
    trials: Annotated[int, Bounds(2, MAX_TRIALS, "")] = 200
    """Largest number of trials."""
    minutes: Annotated[float, Bounds(0.01, 100_000.0, "min")] | None = None
    """Largest wall time of the search, min; None: no limit."""
    seed: Annotated[int, Bounds(0, 2**32 - 1, "")] = 1
    """Seed of the optimiser."""


def settings_of(given: Mapping[str, Any]) -> TuningSettings:
    """Return checked settings; a value of None stands for the default.

    Raises:
        InvalidInput: A value is invalid.
    """
    try:
        return TuningSettings.model_validate({k: v for k, v in given.items() if v is not None})
    except ValidationError as error:
        raise InvalidInput("; ".join(problems_of(error, TuningSettings))) from None


@dataclass(frozen=True, eq=False)
class Tuning:
    """A problem of tuning.

    Attributes:
        settings: What is tuned, towards what, and for how long.
        sets: Training and held-out runs; the controller of the training set is that before tuning.

    Raises:
        InvalidInput: A setting is invalid, the controller does not exist, or the sets have a run in
            common.
    """

    settings: TuningSettings
    sets: RunSets

    def __post_init__(self) -> None:
        label = self.settings.controller
        if label not in self.sets.training.scenario.controllers:
            raise InvalidInput(f"the training set has no controller '{one_line(label, 60)}'")
        parts = (self.objectives, self.limits, self.space)  # which raise errors
        assert parts
        check_apart(self.sets)

    @property
    def before(self) -> Configured:
        """The controller before tuning, with the values that it uses."""
        return self.space.controller

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """What is minimised."""
        return tuple(map(parse_objective, self.settings.objectives))

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Hard limits."""
        return tuple(map(parse_limit, self.settings.limits))

    @property
    def space(self) -> ParameterSpace:
        """The tuned parameters."""
        scenario = self.sets.training.scenario
        return parameter_space(
            scenario.controllers[self.settings.controller],
            scenario.preset,
            choose=self.settings.parameters,
            ranges=self.settings.ranges,
        )

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        settings: TuningSettings,
        *,
        training: StudyDefinition | None = None,
        held_out: StudyDefinition | None = None,
    ) -> Tuning:
        """Return the tuning of a controller of a scenario.

        Args:
            scenario: The scenario.
            settings: What is tuned.
            training: Training runs; None: those of :func:`default_sets`. Its other controllers do
                not run.
            held_out: Held-out runs, likewise.

        Raises:
            InvalidInput: See :class:`Tuning`.
            OmnidriveError: The motion of the scenario cannot be planned.
        """
        label = settings.controller
        if label not in scenario.controllers:
            raise InvalidInput(f"the scenario has no controller '{one_line(label, 60)}'")
        default: RunSets | None = None
        if training is None or held_out is None:
            default = default_sets(scenario, label)
        own = {label: scenario.controllers[label]}
        given = [
            definition or getattr(default, name)
            for name, definition in (("training", training), ("held_out", held_out))
        ]
        return cls(settings, RunSets(*(with_controllers(each, own) for each in given)))


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

    The best trials of one objective are repeated with three times the repetitions, and the best of
    these is chosen, or the values before tuning if they are as good. Only then the held-out runs
    are simulated, with the chosen parameters and with those before tuning.

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
    training, settings = tuning.sets.training, tuning.settings
    with (
        RunEvaluator(processes, in_process=not _is_parallel(training)) as evaluator,
        _opened(path / "training", training) as store,
    ):
        candidates = _Candidates(training, settings.controller, store, evaluator)
        seconds = None if settings.minutes is None else 60.0 * settings.minutes

        def note(trials: Sequence[Trial]) -> None:
            """Report the trials so far."""
            best = best_trial(trials).score
            text = _score_text(tuning.objectives, best.objectives)
            report("trials", len(trials), settings.trials, text)

        found = search(
            tuning.space,
            tuning.objectives,
            tuning.limits,
            candidates,
            Budget(settings.trials, seconds),
            settings.seed,
            report=note,
        )
        chosen = found.best
        if len(tuning.objectives) == 1:
            report("confirmation", 0, 0, "")
            chosen = _confirmed(tuning, found, candidates)
        after = tuning.space.controller_with(chosen.values)
        assert after is not None
        records = _held_out_records(tuning, after, path / "held-out", evaluator, report)
    held_out = held_out_gain(*records, tuning.objectives)
    return TuningResult(tuning, found, chosen, after, held_out, path, monotonic() - began)


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
        return self.repeated(controllers, self._training.repetitions)

    def repeated(
        self, controllers: Sequence[Configured], repetitions: int
    ) -> list[list[RunRecord]]:
        """Return the training runs of each controller with a number of repetitions."""
        training = replace(self._training, repetitions=repetitions)
        plans = [
            list(RunPlan(with_controllers(training, {self._label: each}))) for each in controllers
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


def _confirmed(tuning: Tuning, found: SearchResult, candidates: _Candidates) -> Trial:
    """Return the best of the first trial and the best ones, from more repetitions than before.

    A trial that is only as good as the first one is not chosen.
    """
    first = found.trials[0]
    ordered = sorted(found.trials, key=lambda each: each.score.order)
    chosen = [first, *(each for each in ordered[:_CONFIRMED] if each is not first)]
    made = [tuning.space.controller_with(each.values) for each in chosen]
    valid = [(trial, each) for trial, each in zip(chosen, made, strict=True) if each is not None]
    repetitions = _MORE_REPETITIONS * tuning.sets.training.repetitions
    runs = candidates.repeated([each for _, each in valid], repetitions)
    scores = [score_of(each, tuning.objectives, tuning.limits) for each in runs]
    best = min(range(len(valid)), key=lambda k: scores[k].order)  # the first of equal ones
    return valid[best][0]


def _held_out_records(
    tuning: Tuning, after: Configured, folder: Path, evaluator: RunEvaluator, report: Report
) -> tuple[list[RunRecord], list[RunRecord]]:
    """Return the held-out runs before and after tuning, which are stored as a study."""
    definition = with_controllers(tuning.sets.held_out, {BEFORE: tuning.before, TUNED: after})
    create_folder(folder)
    save_definition(definition, folder / "study.yaml")
    runs = list(RunPlan(definition))
    with _opened(folder, definition) as store:
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


def _opened(folder: Path, definition: StudyDefinition) -> Store:
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
        present = load_tuning(path, allow_code=True)
        if _identity(present) != _identity(tuning):
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


def _identity(tuning: Tuning) -> Any:
    """Return what two tunings of one folder must share."""
    settings = plain(tuning.settings)
    kept = {key: value for key, value in settings.items() if key not in _RESUMABLE}
    return dumps([kept, *(definition_data(each, "/study.yaml") for each in tuning.sets)])


def load_tuning(
    folder: StrPath, *, allow_code: bool = False, **changes: int | float | None
) -> Tuning:
    """Return the problem in the folder of a tuning.

    Args:
        folder: The folder.
        allow_code: See :func:`~omnidrive.study.load_definition`.
        **changes: Other values of ``trials`` and ``minutes``; None: as before.

    Raises:
        InvalidStudy: The folder holds no tuning, or an invalid one.
    """
    path = to_path(folder)
    file = path / SETTINGS_FILE
    data = read_yaml(file, "tuning", InvalidStudy)
    name = one_line(str(file))
    if not isinstance(data, dict) or data.get("format") != "omnidrive-tuning-1":
        raise InvalidStudy(f"{name} is no tuning of this version: need format: omnidrive-tuning-1")
    given = {key: value for key, value in changes.items() if value is not None}
    try:
        settings = settings_of({**data, **given})
    except InvalidInput as error:
        raise InvalidStudy(f"{name}: {error}") from None
    sets = (load_definition(path / each, allow_code=allow_code)
            for each in (TRAINING_FILE, HELD_OUT_FILE))  # fmt: skip
    return Tuning(settings, RunSets(*sets))
