"""Plan of a study: its runs, numbered, computed when they are asked for."""

from __future__ import annotations

from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from itertools import accumulate, product
from math import prod
from typing import Any, NamedTuple, overload

from pydantic import ValidationError

from omnidrive.components.code import CodePermission
from omnidrive.components.fields import plain
from omnidrive.errors import InvalidStudy
from omnidrive.scenario.run_settings import RunSettings, faults_of, horizon_of, settings_of_runs
from omnidrive.scenario.scenario import Scenario
from omnidrive.scenario.scenario_file import listed, problems_of
from omnidrive.scenario.scenario_path import Keys, Setting
from omnidrive.scenario.variant import changed_sections, variant_data, variant_of
from omnidrive.study.design.axes import Axis, Label
from omnidrive.study.design.definition import Condition, StudyDefinition
from omnidrive.study.design.planned_run import PlannedRun
from omnidrive.study.design.random_factors import repetition_seed
from omnidrive.study.design.run_key import KeyMaker, PlanKeys

LARGE = 10_000_000
"""Number of runs from which a study asks for a confirmation."""

_MAX_GROUPS = 100_000  # combinations of the axes that decide which runs there are
_MAX_RUN_LISTS = 10_000  # of these, combinations of the axes that change tasks or controllers
_KEPT = 1024  # variants that are kept


class _RunList(NamedTuple):
    """Runs of each variant of a group of variants."""

    settings: tuple[RunSettings, ...]
    pairs: tuple[int, ...]
    """Index of each run among those that differ not only by the controller."""
    pair_count: int
    parts: tuple[dict[str, Any], ...]
    """What keys of the runs contain besides scenario, controller and run."""


class _Variant(NamedTuple):
    data: dict[str, Any]
    changed: list[str]
    """Sections that differ from those of the base scenario."""
    factors: dict[str, Label]
    text: str
    """Text of the scenario in the keys of its runs."""
    plan_keys: PlanKeys


class RunPlan(Sequence[PlannedRun]):
    """Runs of a study, of which only those that are asked for exist in memory.

    The repetition changes slowest, so that further repetitions leave the numbers of the present
    runs as they are; then the values of the axes, then the tasks, and the controllers change
    fastest.

    Args:
        definition: The study.

    Raises:
        InvalidStudy: Values of axes are not possible together, or too many combinations decide
            which runs there are.

    Attributes:
        definition: The study.
        per_repetition: Number of runs of one repetition.
    """

    def __init__(self, definition: StudyDefinition) -> None:
        self.definition = definition
        self._keys = KeyMaker()
        self._variants: OrderedDict[tuple[int, ...], _Variant] = OrderedDict()
        self._scenarios: OrderedDict[tuple[int, ...], tuple[Scenario, str]] = OrderedDict()
        axes = definition.axes
        used = {i for each in (*definition.where, *definition.leave_out) for i in each.values}
        self._run_axes = [i for i, axis in enumerate(axes) if _changes_runs(axis)]
        self._grouped = sorted({*used, *self._run_axes})
        self._others = [i for i in range(len(axes)) if i not in self._grouped]
        self._sizes = [len(axes[i].settings) for i in self._others]
        self._multiple = prod(self._sizes)
        self._groups = self._run_lists()
        runs = [self._multiple * len(each.settings) for each in self._groups]
        pairs = [self._multiple * each.pair_count for each in self._groups]
        self._starts = [0, *accumulate(runs)]
        self._pair_starts = [0, *accumulate(pairs)]
        self.per_repetition = self._starts[-1]
        if not self.per_repetition:
            raise InvalidStudy("the study has no runs: its conditions leave all of them out")

    def __len__(self) -> int:
        return self.per_repetition * self.definition.repetitions

    @overload
    def __getitem__(self, number: int) -> PlannedRun: ...
    @overload
    def __getitem__(self, number: slice) -> list[PlannedRun]: ...
    def __getitem__(self, number: int | slice) -> PlannedRun | list[PlannedRun]:
        """Return the run with a number, or the runs of a slice.

        Raises:
            IndexError: There is no such run.
        """
        if isinstance(number, slice):
            return [self._run(each) for each in range(*number.indices(len(self)))]
        if not -len(self) <= number < len(self):
            raise IndexError(f"the study has {len(self)} runs, there is none with number {number}")
        return self._run(number % len(self))

    def __iter__(self) -> Iterator[PlannedRun]:
        return map(self._run, range(len(self)))

    def keys(self, start: int, stop: int) -> list[str]:
        """Return the keys of the runs from ``start`` up to, but not including, ``stop``."""
        return [self._key(*self._place(number)) for number in range(start, min(stop, len(self)))]

    def _run(self, number: int) -> PlannedRun:
        repetition, group, values, index = place = self._place(number)
        runs = self._groups[group]
        variant = self._variant(repetition, group, values)
        pairing = repetition * self._pair_starts[-1] + self._pair_starts[group]
        pairing += values * runs.pair_count + runs.pairs[index]
        scenario, refused = self._scenario(repetition, group, values)
        settings = runs.settings[index]
        if self.definition.random.factors and settings.task != "horizon":  # of a random controller
            settings = settings._replace(horizon=horizon_of(scenario, settings.controller))
        return PlannedRun(
            number, self._key(*place), pairing, dict(variant.factors), scenario, settings,
            repetition, refused, variant.plan_keys, self._nominal(variant, group, index),
        )  # fmt: skip

    def _place(self, number: int) -> tuple[int, int, int, int]:
        """Return repetition, group, index of the other axes' values and index of the run there."""
        repetition, rest = divmod(number, self.per_repetition)
        group = bisect_right(self._starts, rest) - 1
        values, index = divmod(rest - self._starts[group], len(self._groups[group].settings))
        return repetition, group, values, index

    def _key(self, repetition: int, group: int, values: int, index: int) -> str:
        variant = self._variant(repetition, group, values)
        runs = self._groups[group]
        settings = runs.settings[index]
        controller = variant.data["controllers"][settings.controller]
        return self._keys.key(variant.text, controller, settings, runs.parts[index])

    def _nominal(self, variant: _Variant, group: int, index: int) -> str:
        """Return the key of the run without the fault of a run; "" in other tasks."""
        settings = self._groups[group].settings[index]
        if settings.task != "faults":
            return ""
        controller = variant.data["controllers"][settings.controller]
        return self._keys.key(variant.text, controller, settings._replace(fault=0), {"fault": None})

    def _indices(self, group: int, values: int) -> list[int]:
        """Return the index of the value of each axis."""
        axes = self.definition.axes
        indices = [0] * len(axes)
        for places, code in ((self._grouped, group), (self._others, values)):
            rest = code
            for i in reversed(places):
                rest, indices[i] = divmod(rest, len(axes[i].settings))
        return indices

    def _variant(self, repetition: int, group: int, values: int) -> _Variant:
        place = repetition, group, values
        found = self._variants.get(place)
        if found is None:
            found = self._variants[place] = self._make(*place)
            if len(self._variants) > _KEPT:
                self._variants.popitem(last=False)
        return found

    def _make(self, repetition: int, group: int, values: int) -> _Variant:
        definition = self.definition
        factors: dict[str, Label] = {}
        settings: list[Setting] = []
        for axis, index in zip(definition.axes, self._indices(group, values), strict=True):
            factors[axis.name] = axis.labels[index]
            settings += axis.settings[index]
        seed, count = definition.scenario.seed, definition.repetitions
        sample = definition.random.sample(repetition, count, seed)
        for factor, (value, label) in zip(definition.random.factors, sample, strict=True):
            factors[factor.name] = label
            is_range = not factor.choices
            settings.append(Setting(factor.keys, value, factor.relative, drawn=is_range))
        data = variant_data(definition.data, settings)
        changed = changed_sections(settings)
        if repetition:
            data = {**data, "seed": repetition_seed(data["seed"], repetition)}
            changed = list(dict.fromkeys([*changed, "seed"]))
        keys = self._keys
        return _Variant(data, changed, factors, keys.scenario_text(data), keys.plan_keys(data))

    def _scenario(self, repetition: int, group: int, values: int) -> tuple[Scenario, str]:
        """Return the scenario of a variant, or the base and why it is refused."""
        place = repetition, group, values
        found = self._scenarios.get(place)
        if found is None:
            variant = self._variant(*place)
            try:
                found = self._checked(variant.data, variant.changed), ""
            except InvalidStudy as error:
                found = self.definition.scenario, str(error)
            self._scenarios[place] = found
            if len(self._scenarios) > _KEPT:
                self._scenarios.popitem(last=False)
        return found

    def _checked(self, data: dict[str, Any], changed: Sequence[str]) -> Scenario:
        """Return the scenario with the sections ``changed`` of ``data``.

        Raises:
            InvalidStudy: The values are not possible together.
        """
        base = self.definition.scenario
        if not changed:
            return base
        if changed == ["seed"]:
            return base.model_copy(update={"seed": data["seed"]})
        try:
            return variant_of(base, data, changed, allow_code=CodePermission.UNREAD)
        except ValidationError as error:
            raise InvalidStudy(f"these values together: {listed(problems_of(error))}") from None

    def _run_lists(self) -> list[_RunList]:
        """Return the runs of each combination of the axes that decide which runs there are."""
        axes = self.definition.axes
        count = prod(len(axes[i].settings) for i in self._grouped)
        lists = prod(len(axes[i].settings) for i in self._run_axes)
        if count > _MAX_GROUPS or lists > _MAX_RUN_LISTS:
            raise InvalidStudy(
                f"axes of tasks and controllers and those in conditions have {count} combinations, "
                f"need at most {_MAX_GROUPS}, and {_MAX_RUN_LISTS} of the former; use fewer "
                "values there"
            )
        made: dict[tuple[Any, ...], _RunList] = {}
        found = []
        for indices in product(*(range(len(axes[i].settings)) for i in self._grouped)):
            chosen = dict(zip(self._grouped, indices, strict=True))
            of_runs = tuple(chosen[i] for i in self._run_axes)
            where, leave_out = (
                _matched(each, chosen)
                for each in (self.definition.where, self.definition.leave_out)
            )
            place = of_runs, where, leave_out
            if place not in made:
                made[place] = self._run_list(of_runs, where, leave_out)
            found.append(made[place])
        return found

    def _run_list(
        self, values: Sequence[int], where: tuple[int, ...], leave_out: tuple[int, ...]
    ) -> _RunList:
        """Return the runs that conditions leave, for values of the axes that change the runs.

        Args:
            values: Index of the value of each of these axes.
            where: Indices of the conditions ``where`` that the axes satisfy.
            leave_out: Indices of the conditions ``leave_out`` that the axes satisfy.
        """
        definition = self.definition
        axes = definition.axes
        of_axes = [
            setting
            for i, value in zip(self._run_axes, values, strict=True)
            for setting in axes[i].settings[value]
        ]
        data = variant_data(definition.data, of_axes)
        scenario = self._checked(data, changed_sections(of_axes))

        def is_planned(run: RunSettings) -> bool:
            """Return whether ``where`` and ``leave_out`` keep a run."""
            wanted = not definition.where or any(_fits(definition.where[i], run) for i in where)
            return wanted and not any(_fits(definition.leave_out[i], run) for i in leave_out)

        settings = tuple(run for run in settings_of_runs(scenario) if is_planned(run))
        pairs: dict[tuple[Any, ...], int] = {}
        indices = tuple(pairs.setdefault(_pair_of(run), len(pairs)) for run in settings)
        faults = (None, *faults_of(scenario))
        step = scenario.tasks.step
        parts = tuple(
            {"fault": plain(faults[run.fault])} if run.task == "faults"
            else {"displacement": plain(step.displacement)} if run.task == "step" and step
            else {}
            for run in settings
        )  # fmt: skip
        return _RunList(settings, indices, len(pairs), parts)


def _changes_runs(axis: Axis) -> bool:
    """Return whether values of an axis can change which runs a scenario has."""
    return any(map(_key_changes_runs, axis.keys))


def _key_changes_runs(keys: Keys) -> bool:
    head = keys[0]
    if head == "controllers":
        return len(keys) < 3 or keys[2] in {"type", "horizon"}
    return head in {"tasks", "preset", "plant"}


def _matched(conditions: Sequence[Condition], chosen: dict[int, int]) -> tuple[int, ...]:
    """Return the indices of the conditions that the values of axes satisfy."""
    return tuple(
        k
        for k, condition in enumerate(conditions)
        if all(chosen[i] in values for i, values in condition.values.items())
    )


def _fits(condition: Condition, run: RunSettings) -> bool:
    return all(getattr(run, name) in values for name, values in condition.run.items())


def _pair_of(run: RunSettings) -> tuple[Any, ...]:
    """Return the fields of a run that runs of other controllers share."""
    horizon = run.horizon if run.task == "horizon" else None
    return run.task, run.duration, horizon, run.repeat, run.fault


def check_size(plan: RunPlan, *, confirmed: bool = False) -> None:
    """Raise InvalidStudy if a plan has more runs than :data:`LARGE` and is not confirmed."""
    definition = plan.definition
    if len(plan) < LARGE or confirmed:
        return
    factors = [f"{each.path} {len(each.settings)}" for each in definition.axes]
    factors.append(f"repetitions {definition.repetitions}")
    raise InvalidStudy(
        f"the study has {len(plan):,} runs ({', '.join(factors)}): use fewer values, or confirm "
        "the number with --yes"
    )


_COMPILE_TIMES = {
    "holonomic-nmpc": 16.0, "fuzzy_t1": 9.0, "unicycle-nmpc": 3.0, "fuzzy_t2": 2.0, "fuzzy_t3": 2.0,
}  # fmt: skip
"""Approximate time to compile the kernels of a controller after those above it, s."""


def starting_order(plan: RunPlan) -> list[int]:
    """Return the numbers of the runs: one run of each controller first, then the longest ones.

    On an empty cache the first runs compile the kernels of different controllers at the same time,
    those with the longest compile times first.
    """
    types = {name: each.type for name, each in plan.definition.scenario.controllers.items()}
    runs = {run.number: run.settings for run in plan}
    longest = sorted(runs, key=lambda number: -runs[number].duration)
    first = {runs[number].controller: number for number in reversed(longest)}
    head = sorted(first, key=lambda name: -_COMPILE_TIMES.get(types[name], 0.0))
    order = [first[name] for name in head] + longest
    return list(dict.fromkeys(order))
