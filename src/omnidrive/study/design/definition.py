"""Definition of a study: a base scenario, what varies, and how often it is repeated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, get_args

from omnidrive.components.fields import plain
from omnidrive.errors import InvalidStudy
from omnidrive.parameter import check_choice
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.scenario_path import code_in
from omnidrive.study.design.axes import Axis
from omnidrive.study.design.random_factors import RandomFactors

FORMAT = "omnidrive-study-1"
"""Name and version of the file format."""

MAX_REPETITIONS = 1_000_000
"""Largest number of repetitions."""

SeriesKept = Literal["none", "failed", "all"]
"""Runs whose time series are kept."""


class Condition(NamedTuple):
    """Values of axes and of runs, all of which a run must have to match."""

    source: dict[str, Any]
    """The condition as in the study file."""
    values: Mapping[int, frozenset[int]]
    """Indices of values by the index of their axis."""
    run: Mapping[str, tuple[Any, ...]]
    """Values of fields of the run: controller, task, duration, horizon and fault."""


@dataclass(frozen=True, eq=False)
class StudyDefinition:
    """A study: every combination of the values of its axes, repeated with different seeds.

    The random numbers and the values of the random factors depend on the seed of the scenario and
    on the repetition only: every controller and every value of an axis meets the same ones.

    Attributes:
        name: Name of the study, for titles.
        scenario: Base scenario, with the controllers and the tasks.
        axes: What varies systematically.
        random: What is drawn once per repetition.
        repetitions: Number of repetitions, each with a seed of its own.
        question: The question that the study answers, for its report; may be empty.
        where: A run is planned only if it matches one of these conditions; empty: no condition.
        leave_out: Runs that match one of these conditions are not planned.
        series: Runs whose time series are kept.

    Raises:
        InvalidInput: ``series`` is not one of its names.
    """

    name: str
    scenario: Scenario
    axes: tuple[Axis, ...] = ()
    random: RandomFactors = field(default_factory=RandomFactors)
    repetitions: int = 1
    question: str = ""
    where: tuple[Condition, ...] = ()
    leave_out: tuple[Condition, ...] = ()
    series: SeriesKept = "none"

    def __post_init__(self) -> None:
        check_choice("choice of series", self.series, get_args(SeriesKept))

    @classmethod
    def from_scenario(cls, scenario: Scenario, *, series: SeriesKept = "none") -> StudyDefinition:
        """Return the study of the runs of one scenario, in their order.

        With all series, it is the comparison of ``omnidrive compare``.
        """
        return cls(scenario.name, scenario, series=series)

    @property
    def is_one_scenario(self) -> bool:
        """Whether the runs are all those of one scenario, once each."""
        varied = (*self.axes, *self.random.factors, *self.where, *self.leave_out)
        return not varied and self.repetitions == 1

    @property
    def is_comparison(self) -> bool:
        """Whether it is the study of a scenario file, as of ``omnidrive compare``."""
        named = self.name == self.scenario.name and not self.question
        return self.is_one_scenario and self.series == "all" and named

    @cached_property
    def data(self) -> dict[str, Any]:
        """The base scenario as plain data."""
        return scenario_data(self.scenario)

    @property
    def names_code(self) -> bool:
        """Whether a component is code that is not installed, so that its file needs permission."""
        values: list[tuple[str, Any]] = list(self.data.items())
        for axis in self.axes:
            for settings in axis.settings:
                values += [(".".join(map(str, each.keys)), each.value) for each in settings]
        for factor in self.random.factors:
            values += [(factor.path, each) for each in factor.choices]
        return any(True for path, value in values for _ in code_in(path, plain(value)))

    @property
    def factor_names(self) -> tuple[str, ...]:
        """Names of all axes, then of all random factors."""
        factors = self.random.factors
        return (*(each.name for each in self.axes), *(each.name for each in factors))

    def with_repetitions(self, repetitions: int) -> StudyDefinition:
        """Return the study with another number of repetitions; the runs of present ones stay.

        Raises:
            InvalidStudy: The number is out of range, or the random factors have a method that
                needs a fixed one.
        """
        if not 1 <= repetitions <= MAX_REPETITIONS:
            raise InvalidStudy(f"repetitions is {repetitions}, need 1 to {MAX_REPETITIONS}")
        if repetitions != self.repetitions and not self.random.is_extendable:
            raise InvalidStudy(
                "the method latin-hypercube divides the ranges among a fixed number of "
                "repetitions; use sobol or independent to add repetitions"
            )
        return replace(self, repetitions=repetitions)
