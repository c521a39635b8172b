"""Problems of tuning: what is tuned, towards what, on which runs; stored in a folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from json import dumps
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from omnidrive.components import Configured
from omnidrive.components.code import CodePermission
from omnidrive.components.fields import plain
from omnidrive.errors import InvalidInput, InvalidStudy, one_line
from omnidrive.files.str_path import StrPath, to_path
from omnidrive.files.yaml_file import read_yaml
from omnidrive.parameter import Bounds
from omnidrive.scenario import Scenario
from omnidrive.scenario.scenario_file import listed, problems_of
from omnidrive.scenario.section import Section
from omnidrive.study import StudyDefinition, definition_data, load_definition
from omnidrive.tuning.balanced import objective_of
from omnidrive.tuning.objective import BALANCED, Limit, Objective, parse_limit
from omnidrive.tuning.run_sets import (
    RunSets,
    check_apart,
    check_measured,
    default_sets,
    with_controllers,
)
from omnidrive.tuning.search import MAX_TRIALS
from omnidrive.tuning.space import ParameterSpace, parameter_space

SETTINGS_FILE, TRAINING_FILE, HELD_OUT_FILE = "tuning.yaml", "training.yaml", "held-out.yaml"
"""Names of the files of a folder from which tuning resumes."""

_RESUMABLE = ("trials", "minutes")  # settings that may change when tuning resumes


class TuningSettings(Section):
    """What is tuned, towards what, and for how long."""

    format: Literal["omnidrive-tuning-1"] = "omnidrive-tuning-1"
    """Name and version of the file format."""
    controller: str
    """Label of the controller in the scenario."""
    objectives: Annotated[tuple[str, ...], Field(min_length=1, max_length=4)] = (BALANCED,)
    """What is minimised, by default tracking errors and step responses together; several give a
    front."""
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
        raise InvalidInput(listed(problems_of(error, TuningSettings))) from None


@dataclass(frozen=True, eq=False)
class Tuning:
    """A problem of tuning.

    Attributes:
        settings: What is tuned, towards what, and for how long.
        sets: Training and held-out runs; the controller of the training set is that before tuning.

    Raises:
        InvalidInput: A setting is invalid, the controller does not exist, runs lack a metric of an
            objective or a limit, or the sets have a run in common.
    """

    settings: TuningSettings
    sets: RunSets

    def __post_init__(self) -> None:
        label = self.settings.controller
        if label not in self.sets.training.scenario.controllers:
            raise InvalidInput(f"the training set has no controller '{one_line(label, 60)}'")
        parts = (self.objectives, self.limits, self.space)  # which raise errors
        assert parts
        check_measured(self.sets, self.objectives, self.limits)
        check_apart(self.sets)

    @property
    def before(self) -> Configured:
        """The controller before tuning, with the values that it uses."""
        return self.space.controller

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """What is minimised."""
        return tuple(map(objective_of, self.settings.objectives))

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
            default = default_sets(scenario, label, list(map(objective_of, settings.objectives)))
        own = {label: scenario.controllers[label]}
        given = [
            definition or getattr(default, name)
            for name, definition in (("training", training), ("held_out", held_out))
        ]
        return cls(settings, RunSets(*(with_controllers(each, own) for each in given)))


def identity(tuning: Tuning) -> Any:
    """Return what two tunings of one folder must share."""
    settings = plain(tuning.settings)
    kept = {key: value for key, value in settings.items() if key not in _RESUMABLE}
    return dumps([kept, *(definition_data(each, "/study.yaml") for each in tuning.sets)])


def load_tuning(
    folder: StrPath, *, allow_code: bool | CodePermission = False, **changes: int | float | None
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
